"""Rule GP710 (unreceived-input): an engine validates an input that then nothing is handed to."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, control, hear, note, plan
from gpsfsm.compile.fabric import PROFILES
from gpsfsm.compile.validation import Renamed, Validation
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.printable import printable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.on_engine import OnEngine
    from gpsfsm.compile.validation import Taken


def _find_unreceived_input(engine: OnEngine) -> Iterator[Finding]:
    """One finding per input."""
    if not PROFILES[engine.name].validated:
        return
    context = engine.context
    validation = Validation(context.compiled, context.capabilities.library)
    for taken in validation.unreceived():
        runner, wanted = context.runner(taken.runner), printable(taken.wanted.name)
        if isinstance(taken, Renamed):
            alias = printable(taken.alias)
            yield RULE.finding(
                f"{engine.name} lets this plan pass because '{alias}' is another name of the input "
                f"'{wanted}' of {context.place(runner)}, and at run time the name alone counts",
                context.plan.location(runner),
                hint=f"write {wanted} in place of {alias}",
            )
            continue
        giver = context.runner(taken.giver)
        yield RULE.finding(
            f"{engine.name} lets this plan pass because {context.place(giver)} has an output for "
            f"the input '{wanted}' of {context.place(runner)}, and hands nothing over there: "
            f"{_reason(taken)}",
            context.plan.location(runner),
            hint=_hint(taken, context),
            related=(context.related(giver, "has the output"),),
        )


def _reason(taken: Taken) -> str:
    output = printable(taken.output.name)
    if taken.output.event is not taken.event:
        return (
            f"'{output}' goes with {taken.output.event.name}, and what leads here is "
            f"{taken.event.name}"
        )
    return f"the output is called '{output}', and at run time the name alone counts"


def _hint(taken: Taken, context: Context) -> str:
    provider = context.bindings[taken.runner]
    name = printable(taken.wanted.name)
    if provider is not None and provider.provider.parameter(taken.wanted.name) is not None:
        return f'write {name}="…" in the plan'
    return f"put a step that hands over '{name}' right before this one"


RULE = Rule(
    code="GP710",
    name="unreceived-input",
    severity=Severity.WARNING,
    summary="The engine validates an input of a runner to which nothing is handed over.",
    why=(
        "fabric-v3 looks for an output whose name, semantic key or alias is one of the input's, at "
        "any step that leads straight to the runner, with any event. When the plan runs it hands "
        "values over by their names alone, and with the event to which they belong: the runner "
        "then starts without the value that was validated."
    ),
    fix="write the value in the plan, or put a step that hands it over by this name right before",
    bad=plan(hear(), control("recovery", note(uuid="visit"))),
    good=plan(hear(), note(uuid="visit")),
    options=("--engine", "fabric-v3"),
    find_on_engine=_find_unreceived_input,
)
