"""GP402: a value that a later runner waits for in vain."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.data_flow import DataFlow, Lost
from gpsfsm.analysis.rules.base import Rule, go, phrase, plan, say
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.analysis.context import Context
    from gpsfsm.model.plan import Attribute


def find(context: Context) -> Iterator[Finding]:
    """One finding per attribute that asks for a value; a missing need is GP401 or GP204."""
    flow: DataFlow = context.answers["data_flow"] or DataFlow()
    missing = {(need.runner, need.name) for need in flow.missing}
    groups: dict[tuple[int, str], list[Lost]] = {}
    for value in flow.lost:
        if (value.runner, value.name) not in missing:
            groups.setdefault((value.runner, value.name), []).append(value)
    for (number, name), lost in groups.items():
        binding = context.bindings[number]
        assert binding is not None
        attribute = binding.written[name]
        source, event = _meant(context, number, name, attribute, lost)
        giver, taker = context.runner(source), context.runner(number)
        yield RULE.finding(
            f"'{clip(attribute.text, 60)}' is used as it is written: what "
            f"{context.place(giver)} gives as '{name}' never gets here, because "
            f"{_end(context, source, event, number)}",
            Location(attribute.line, attribute.column, context.plan.path(taker)),
            length=len(attribute.name),
            related=(context.related(giver, f"gives '{name}'"),),
        )


def _meant(
    context: Context, number: int, name: str, attribute: Attribute, lost: Sequence[Lost]
) -> tuple[int, Event]:
    """The producer that the placeholder names, else the one right before, else the nearest.

    With it comes the event with which it gives the value.
    """
    for candidate in reversed(lost):
        if context.runner(candidate.source).interface in attribute.text:
            return candidate.source, candidate.event
    before = context.values.source[number]
    binding = context.bindings[before] if before >= 0 else None
    for output in binding.provider.outputs if binding is not None else ():
        if output.name == name:
            return before, output.event
    return lost[-1].source, lost[-1].event


def _end(context: Context, source: int, event: Event, number: int) -> str:
    """The reason why the value does not arrive."""
    if context.values.source[number] == source:
        if event is Event.FAILED:
            return "it is only given on failure, and this step runs after a success"
        return "it is only given on success, and this step runs after a failure"
    automaton = context.automaton
    for node in automaton.outputs.get(Signal(automaton.runner_node(source), event), ()):
        if automaton.nodes[node].kind is NodeKind.RUNNER:
            follower = context.place(context.runner(automaton.runner_number(node)))
            return f"a value reaches the direct successor only, here {follower}"
        if automaton.nodes[node].kind is NodeKind.JOIN:
            control = context.place(context.plan.elements[automaton.nodes[node].origin])
            return f"no value gets past the end of {control}"
    return "a value reaches the direct successor only, and here no runner follows directly"


RULE = Rule(
    code="GP402",
    name="lost-value",
    severity=Severity.ERROR,
    summary="A runner asks for a value that another one gives, and never gets it.",
    why=(
        "Values travel along one connection, to the direct successor, and under the same name. "
        "There are no variables: what a placeholder asks for is not looked up anywhere, and the "
        "placeholder itself is used as it stands."
    ),
    fix="put the runner that needs the value right behind the one that gives it",
    bad=plan(phrase("Greet the guest.", flush="true", uuid="guest"), go(0.0, 0.0), say("$text")),
    good=plan(go(0.0, 0.0), phrase("Greet the guest.", flush="true", uuid="guest"), say("$text")),
    find=find,
)
