"""GP401: a runner needs a value that nothing gives it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.data_flow import DataFlow
from gpsfsm.analysis.rules.base import Rule, go, hear, note, plan
from gpsfsm.analysis.words import listed
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.event import Event
from gpsfsm.model.finding import Finding, Related, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.decisions.data_flow import Missing
    from gpsfsm.analysis.flow import Need

_STEP = "put a step that gives it right before this one"


def find(context: Context) -> Iterator[Finding]:
    """One finding per runner; a parameter that nothing can ever give is GP204."""
    for number, missing in missing_inputs(context).items():
        names = [need.name for need in missing]
        always = missing[0].how == "always"
        runner = context.runner(number)
        what = listed([f"'{name}'" for name in names], most=4)
        verb = f"gives {'it' if len(names) == 1 else 'them'}{'' if always else ' in every run'}"
        yield RULE.finding(
            f"{context.place(runner)} needs {what}, and nothing {verb}: "
            f"{_reason(context, number, names[0])}",
            context.plan.location(runner),
            hint=_hint(context, number, names),
            related=tuple(_producers(context, number, names[0])),
            scenario=context.triggering(RULE.code, number),
        )


def _reason(context: Context, number: int, name: str) -> str:
    values = context.values
    source = values.source[number]
    need = _need(context, number, name)
    binding = context.bindings[number]
    assert binding is not None
    if not need.arriving:
        return "only what the plan writes counts"
    if name in binding.written and not need.literal:
        return "what the plan writes does not count, it takes the value from the step before it"
    if source < 0:
        return why_nothing_arrives(context, number)
    arriving = values.arriving[number] or {}
    before = context.place(context.runner(source))
    if name in arriving:
        return f"{before} gives it only sometimes"
    outputs = listed([f"'{output}'" for output in arriving], most=3)
    gives = f"gives {f'only {outputs}' if outputs else 'nothing'}"
    match _trigger(context, number):
        case Event.FAILED:
            return f"it runs when {before} has failed, which {gives} then"
        case Event.STARTED:
            return f"it runs as soon as {before} has started, which {gives} yet"
        case _:
            return f"{before}, which comes right before it, {gives}"


def _trigger(context: Context, number: int) -> Event:
    """The event that triggers an instance."""
    automaton = context.automaton
    return automaton.inputs[automaton.runner_node(number)][0].event


def _need(context: Context, number: int, name: str) -> Need:
    binding = context.bindings[number]
    assert binding is not None
    return next(need for need in context.values.needs(binding) if need.name == name)


def _hint(context: Context, number: int, names: Sequence[str]) -> str:
    needs = [_need(context, number, name) for name in names]
    written = " ".join(f'{need.name}="…"' for need in needs if need.literal)
    write = f"write {written} in the plan"
    if all(need.literal for need in needs):
        return f"{write}, or {_STEP}" if all(need.arriving for need in needs) else write
    if not written:
        return f"{_STEP}, with no control and no recovery between"
    inputs = listed([f"'{need.name}'" for need in needs if not need.literal], most=3)
    return f"{write}, and put a step that gives {inputs} right before this one"


def _producers(context: Context, number: int, name: str) -> Iterator[Related]:
    """The last runners before it that give the value, if to somebody else."""
    flow: DataFlow = context.answers["data_flow"]
    sources = [lost.source for lost in flow.lost if (lost.runner, lost.name) == (number, name)]
    for source in sources[-2:]:
        yield context.related(
            context.runner(source), f"gives '{name}', but only to its direct successor"
        )


RULE = Rule(
    code="GP401",
    name="missing-input",
    severity=Severity.ERROR,
    summary="A runner needs a value, and in some run nothing gives it.",
    why=(
        "What a runner gives reaches its direct successor only. It gets lost at the end of a "
        "parallel control, at the end of a step with a recovery, and at every step that does not "
        "use it. The runner then works with nothing, or not at all."
    ),
    fix="write the value in the plan, or put the step that gives it right before this one",
    bad=plan(hear(), go(1.0, 2.0), note()),
    good=plan(go(1.0, 2.0), hear(), note()),
    options=("--select", "GP401"),
    find=find,
)


def missing_inputs(context: Context) -> Mapping[int, Sequence[Missing]]:
    """The needs that GP401 names, by runner: those that are always missing, else the others.

    A parameter that nothing can ever give is left to GP204.
    """
    flow: DataFlow = context.answers.get("data_flow") or DataFlow()
    groups: dict[int, list[Missing]] = {}
    for need in flow.missing:
        if need.kind == "input" or need.how == "sometimes":
            groups.setdefault(need.runner, []).append(need)
    return {
        number: [need for need in missing if need.how == "always"] or missing
        for number, missing in groups.items()
    }


def why_nothing_arrives(context: Context, number: int) -> str:
    """The reason why nothing arrives at an instance that no other instance triggers directly."""
    automaton = context.automaton
    for signal in automaton.inputs[automaton.runner_node(number)]:
        source = automaton.nodes[signal.node]
        if source.kind is NodeKind.START:
            return "nothing comes before it that could hand over a value"
        if source.kind is NodeKind.JOIN:
            before = context.place(context.plan.elements[source.origin])
            return f"no value gets past the end of {before}"
    return "nothing hands over a value to it"
