"""SMV models of an automaton, for NuSMV: the most natural encoding and an expert's.

All runner instances are variables of one module, and any number of them may move at once; a join
is a definition over the outcomes of its inputs. ``natural``: a runner instance is idle, running,
succeeded or failed. ``expert``: being idle while triggered already says "running", so one value,
and with it one bit of each variable, is saved.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from benchmarks.other_tools.questions import (
    CanMiss,
    Cone,
    Question,
    Style,
    completes,
    cone_of,
)
from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Set


def smv_of(
    automaton: Automaton,
    question: Question | None = None,
    *,
    style: Style = "natural",
    never_fails: Set[int] = frozenset(),
) -> str:
    """The SMV model with one CTL formula: is it true that a node can be triggered, or that after
    the signal of a CanMiss it always still can be (so that the answer "no" means: missed)?
    """
    cone = cone_of(automaton, question or completes(automaton), never_fails)
    # Document order: it keeps what belongs together close together in the decision diagrams.
    runners = [node for node in sorted(cone.nodes) if cone.node(node).kind is NodeKind.RUNNER]
    others = [node for node in cone.nodes if cone.node(node).kind is not NodeKind.RUNNER]
    running = "running, " if style == "natural" else ""
    lines = ["MODULE main", "VAR"]
    lines += [f"  r{node} : {{idle, {running}succeeded, failed}};" for node in runners]
    lines.append("DEFINE")
    lines += [f"  n{node} := {_trigger(cone, node)};" for node in others if node != 0]
    lines += [f"  n{node} := {_trigger(cone, node)};" for node in runners]
    lines.append("ASSIGN")
    for node in runners:
        lines += _moves(cone, node, style)
    return "\n".join([*lines, f"CTLSPEC {_formula(cone)}", ""])


def _moves(cone: Cone, node: int, style: Style) -> list[str]:
    outcomes = ", ".join(event.value.lower() for event in cone.events(node))
    if style == "natural":
        cases = f"r{node} = idle & n{node} : running; r{node} = running : {{running, {outcomes}}}"
    else:
        cases = f"r{node} = idle & n{node} : {{idle, {outcomes}}}"
    return [
        f"  init(r{node}) := idle;",
        f"  next(r{node}) := case {cases}; TRUE : r{node}; esac;",
    ]


def _signal(cone: Cone, signal: Signal) -> str:
    node, event = signal
    if cone.node(node).kind is NodeKind.RUNNER:
        return f"n{node}" if event is Event.STARTED else f"r{node} = {event.value.lower()}"
    return "TRUE" if node == 0 else f"n{node}"


def _trigger(cone: Cone, node: int) -> str:
    """When a node has been triggered, or a join has fired."""
    inputs = [cone.edges[number] for number in cone.into[node]]
    terms = [_signal(cone, Signal(edge.source, edge.event)) for edge in inputs]
    if not terms or len(terms) < cone.node(node).need:
        return "FALSE"
    return (" & " if cone.collects(node) else " | ").join(terms)


def _formula(cone: Cone) -> str:
    question = cone.question
    assert question is not None
    if not isinstance(question, CanMiss):
        return f"EF n{question.node}"
    if question.after is None:
        return f"AG EF n{question.node}"
    return f"AG (({_signal(cone, question.after)}) -> EF n{question.node})"
