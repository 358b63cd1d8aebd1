"""GP403: what the plan writes for a parameter is replaced by a value that arrives."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.data_flow import DataFlow, Overwritten
from gpsfsm.analysis.flow import placeholder
from gpsfsm.analysis.rules.base import Rule, look, note, plan
from gpsfsm.analysis.rules.gp401_missing_input import missing_inputs
from gpsfsm.analysis.words import listed
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.plan import Location

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.flow import How
    from gpsfsm.model.plan import Attribute


def find(context: Context) -> Iterator[Finding]:
    """One finding per runner. A placeholder is meant to be replaced: GP207 speaks of those."""
    flow: DataFlow = context.answers["data_flow"] or DataFlow()
    missing = missing_inputs(context)
    groups: dict[tuple[int, How, str], list[Overwritten]] = {}
    for literal in flow.overwritten:
        if not placeholder(_attribute(context, literal).text):
            reported = any(literal.name == need.name for need in missing.get(literal.runner, ()))
            key = literal.runner, literal.how, "GP401" if reported else ""
            groups.setdefault(key, []).append(literal)
    for (number, how, unless), overwritten in groups.items():
        runner, source = context.runner(number), context.runner(overwritten[0].source)
        attribute = _attribute(context, overwritten[0])
        names = listed([f"'{literal.name}'" for literal in overwritten], most=7)
        several = len(overwritten) > 1
        verb = "is always" if how == "always" else "is sometimes"
        gives = (
            "gives values of these names, and those count"
            if several
            else ("gives a value of that name, and that one counts")
        )
        yield RULE.finding(
            f"what the plan writes for {names} {verb} replaced: {context.place(source)} {gives}",
            Location(attribute.line, attribute.column, context.plan.path(runner)),
            length=len(attribute.name),
            related=(context.related(source, f"gives {names}"),),
            scenario=context.triggering(RULE.code, number),
            unless=unless,
        )


def _attribute(context: Context, literal: Overwritten) -> Attribute:
    binding = context.bindings[literal.runner]
    assert binding is not None
    return binding.written[literal.name]


RULE = Rule(
    code="GP403",
    name="overwritten-literal",
    severity=Severity.WARNING,
    summary="A value that arrives replaces what the plan writes.",
    why=(
        "What arrives from the step before counts more than the attribute of the same name. An "
        "instruction that is written there never reaches the runner, and a robot that is sent "
        "somewhere may go where it already is."
    ),
    fix=(
        "remove the attribute if the value that arrives is the right one; else put a step that "
        "gives no such value between the two"
    ),
    bad=plan(look("Who is there?"), note(text="Summarise what the robot sees.", uuid="scene")),
    good=plan(look("Who is there?"), note(uuid="scene")),
    options=("--select", "GP403"),
    find=find,
)
