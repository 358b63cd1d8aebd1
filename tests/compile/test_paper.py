"""The compiler against the table of semantics, section 3, edge by edge."""

from __future__ import annotations

import pytest

from gpsfsm.compile import compile_plan
from gpsfsm.model.automaton import Automaton, NodeKind
from gpsfsm.model.event import Event
from tests.oracle import P, par_all, par_any, plan, rec, seq
from tests.support import plan_of

SHORT = {Event.SUCCEEDED: "S", Event.FAILED: "F", Event.STARTED: "ST"}


def edges(whole: P, *, start_chain: bool = False) -> set[str]:
    """Connections as ``A-S->B``; joins as ``any1``, ``all2`` with their number of inputs."""
    automaton = compile_plan(plan_of(whole), start_chain=start_chain).automaton
    names = {node.index: _name(automaton, node.index) for node in automaton.nodes}
    return {
        f"{names[source]}-{SHORT[event]}->{names[target]}"
        for source, event, target in automaton.edges
    }


def _name(automaton: Automaton, index: int) -> str:
    node = automaton.nodes[index]
    if node.kind is NodeKind.RUNNER:
        return automaton.plan.elements[node.origin].interface
    if node.kind is NodeKind.JOIN:
        return f"join{node.need}/{len(automaton.inputs[index])}"
    return node.kind.value


@pytest.mark.parametrize(
    ("whole", "wanted"),
    [
        (plan("A"), "start-S->A A-S->complete A-F->give_up"),
        (plan(), "start-S->complete"),
        (plan(seq(), par_all(), par_any()), "start-S->complete"),
        (
            plan("A", "B"),
            "start-S->A A-S->B B-S->complete A-F->join1/2 B-F->join1/2 join1/2-S->give_up",
        ),
        (
            plan("A", rec("B")),
            "start-S->A A-F->B B-F->give_up A-S->join1/2 B-S->join1/2 join1/2-S->complete",
        ),
        (
            plan("A", rec("B", "C")),
            "start-S->A A-F->B B-F->C C-F->give_up A-S->join1/3 B-S->join1/3 C-S->join1/3 "
            "join1/3-S->complete",
        ),
        (
            plan(par_all("A", "B")),
            "start-S->A start-S->B A-S->join2/2 B-S->join2/2 join2/2-S->complete A-F->join1/2 "
            "B-F->join1/2 join1/2-S->give_up",
        ),
        (
            plan(par_any("A", "B")),
            "start-S->A start-S->B A-S->join1/2 B-S->join1/2 join1/2-S->complete A-F->join2/2 "
            "B-F->join2/2 join2/2-S->give_up",
        ),
        # one unit: no join
        (plan(par_all("A")), "start-S->A A-S->complete A-F->give_up"),
        (plan(par_any("A")), "start-S->A A-S->complete A-F->give_up"),
        # a recovery that guards nothing is compiled, but never triggered
        (
            plan(rec("A", "B"), "C"),
            "A-F->B start-S->C C-S->complete C-F->give_up",
        ),
        # a recovery without steps changes nothing
        (plan("A", rec()), "start-S->A A-S->complete A-F->give_up"),
        (plan("A", rec(rec("B"))), "start-S->A A-S->complete A-F->give_up"),
        # inside a parallel control a recovery guards the unit before it
        (
            plan(par_any("A", rec("B"))),
            "start-S->A A-F->B B-F->give_up A-S->join1/2 B-S->join1/2 join1/2-S->complete",
        ),
        # an empty control cannot fail: a join that needs its failure waits for ever
        (
            plan(par_any("A", seq()), "B"),
            "start-S->A start-S->join1/2 A-S->join1/2 join1/2-S->B B-S->complete A-F->join2/1 "
            "join2/1-S->join1/2 B-F->join1/2 join1/2-S->give_up",
        ),
    ],
)
def test_connections(whole: P, wanted: str) -> None:
    assert edges(whole) == set(wanted.split())


def test_a_second_recovery_guards_the_guard() -> None:
    assert {"A-F->B", "B-F->C", "C-F->give_up"} <= edges(plan("A", rec("B"), rec("C")))


@pytest.mark.parametrize(
    ("whole", "wanted"),
    [
        (plan(par_all("A", "B", "C")), "start-S->A A-ST->B B-ST->C"),
        (plan(par_any(seq(), "A", "B")), "start-S->A A-ST->B"),
        (plan(par_all(seq(par_all("A", "B"), "C"), "D")), "start-S->A A-ST->B A-ST->D"),
    ],
)
def test_connections_when_runners_may_not_start(whole: P, wanted: str) -> None:
    assert set(wanted.split()) <= edges(whole, start_chain=True)
    assert "start-S->B" not in edges(whole, start_chain=True)


def test_the_graph_is_the_same_and_frozen() -> None:
    automaton = compile_plan(plan_of(plan("A", rec("B"), par_all("C", "D")))).automaton
    graph = automaton.graph
    actual = sorted((s, Event(data["event"]), t) for s, t, data in graph.edges(data=True))
    assert actual == sorted(automaton.edges)
    assert graph.nodes[0]["kind"] == "start"
    with pytest.raises(Exception, match=r"[Ff]rozen"):
        graph.add_node("other")


def test_deep_plans_do_not_exhaust_the_stack() -> None:
    depth = 5_000
    text = '<Plan><Runner interface="A" provider="A"/>'
    text += '<Control type="parallel_any">' * depth + '<Runner interface="B" provider="B"/>'
    text += "</Control>" * depth + "</Plan>"
    from gpsfsm.syntax import Limits, parse

    parsed = parse(text, limits=Limits(max_depth=depth + 10))
    assert parsed.plan is not None
    automaton = compile_plan(parsed.plan).automaton
    assert len(automaton.edges) == 6  # single units need no joins
