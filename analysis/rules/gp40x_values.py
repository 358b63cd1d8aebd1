"""Rules on the values that runners hand over: missing, lost, overwritten, unused, mismatched."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.data_flow import DataFlow, Lost, Overwritten
from gpsfsm.analysis.flow import placeholder
from gpsfsm.analysis.rules.base import (
    Rule,
    go,
    hear,
    locate,
    look,
    note,
    phrase,
    plan,
    say,
    tell_pose,
)
from gpsfsm.analysis.words import listed
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event
from gpsfsm.model.finding import Finding, Related, Severity
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.decisions.data_flow import Missing
    from gpsfsm.analysis.flow import How, Need
    from gpsfsm.model.plan import Attribute


_STEP = "put a step that outputs it right before this one"


def _find_missing_input(context: Context) -> Iterator[Finding]:
    """One finding per runner; a parameter that nothing can ever give is GP204."""
    for number, missing in missing_inputs(context).items():
        names = [need.name for need in missing]
        always = missing[0].how == "always"
        runner = context.runner(number)
        what = listed([f"'{name}'" for name in names], most=4)
        it = "it" if len(names) == 1 else "them"
        lacks = f"no step provides {it}" if always else f"not every run provides {it}"
        yield MISSING_INPUT.finding(
            f"{context.place(runner)} needs {what}, but {lacks}: "
            f"{_reason(context, number, names[0])}",
            context.plan.location(runner),
            hint=_hint(context, number, names),
            related=tuple(_producers(context, number, names[0])),
            scenario=context.triggering(MISSING_INPUT.code, number),
        )


def _reason(context: Context, number: int, name: str) -> str:
    values = context.values
    source = values.source[number]
    need = _need(context, number, name)
    binding = context.bindings[number]
    assert binding is not None
    if not need.arriving:
        return "only the plan itself can set it"
    if name in binding.written and not need.literal:
        return "it takes the value only from the step before it, not from the plan"
    if source < 0:
        return why_nothing_arrives(context, number)
    arriving = values.arriving[number] or {}
    before = context.place(context.runner(source))
    if name in arriving:
        return f"{before} outputs it only sometimes"
    outputs = listed([f"'{output}'" for output in arriving], most=3)
    gives = f"outputs {f'only {outputs}' if outputs else 'nothing'}"
    match _trigger(context, number):
        case Event.FAILED:
            return f"it runs after {before} has failed, which {gives} in that case"
        case Event.STARTED:
            return f"it runs as soon as {before} has started, which {gives} at that point"
        case _:
            return f"{before}, the step right before it, {gives}"


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
        return f"{_STEP}, with no control or recovery in between"
    inputs = listed([f"'{need.name}'" for need in needs if not need.literal], most=3)
    return f"{write}, and put a step that outputs {inputs} right before this one"


def _producers(context: Context, number: int, name: str) -> Iterator[Related]:
    """The last runners before it that give the value, if to somebody else."""
    flow: DataFlow = context.answers["data_flow"]
    sources = [lost.source for lost in flow.lost if (lost.runner, lost.name) == (number, name)]
    for source in sources[-2:]:
        yield context.related(
            context.runner(source), f"outputs '{name}', but only to its direct successor"
        )


MISSING_INPUT = Rule(
    code="GP401",
    name="missing-input",
    severity=Severity.ERROR,
    summary="A runner needs a value that, in some run, no step provides.",
    why=(
        "The output of a runner reaches only its direct successor. It is lost at the end of a "
        "parallel control, at the end of a step with a recovery, and at every step that does "
        "not use it. The runner then works without the value, or not at all."
    ),
    fix="write the value in the plan, or put the step that outputs it right before this one",
    bad=plan(hear(), go(1.0, 2.0), note()),
    good=plan(go(1.0, 2.0), hear(), note()),
    options=("--select", "GP401"),
    find=_find_missing_input,
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
            return "there is no step before it"
        if source.kind is NodeKind.JOIN:
            before = context.place(context.plan.elements[source.origin])
            return f"no value passes the end of {before}"
    return "no step passes a value to it"


def _find_lost_value(context: Context) -> Iterator[Finding]:
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
        yield LOST_VALUE.finding(
            f"'{clip(attribute.text, 60)}' is taken literally: the output '{name}' of "
            f"{context.place(giver)} does not reach this step, because "
            f"{_end(context, source, event, number)}",
            context.plan.location(taker, attribute),
            length=len(attribute.name),
            related=(context.related(giver, f"outputs '{name}'"),),
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
            return "it is output only on failure, and this step runs after a success"
        return "it is output only on success, and this step runs after a failure"
    automaton = context.automaton
    for node in automaton.outputs.get(Signal(automaton.runner_node(source), event), ()):
        if automaton.nodes[node].kind is NodeKind.RUNNER:
            follower = context.place(context.runner(automaton.runner_number(node)))
            return f"an output reaches only the direct successor, here {follower}"
        if automaton.nodes[node].kind is NodeKind.JOIN:
            control = context.place(context.plan.elements[automaton.nodes[node].origin])
            return f"no value passes the end of {control}"
    return "an output reaches only the direct successor, and no runner directly follows here"


LOST_VALUE = Rule(
    code="GP402",
    name="lost-value",
    severity=Severity.ERROR,
    summary="A runner needs a value that another one outputs, but never receives it.",
    why=(
        "Values travel along one connection, to the direct successor, under the same name. "
        "There are no variables: a placeholder is not looked up anywhere, but taken literally."
    ),
    fix="put the runner that needs the value right after the one that outputs it",
    bad=plan(phrase("Greet the guest.", flush="true", uuid="guest"), go(0.0, 0.0), say("$text")),
    good=plan(go(0.0, 0.0), phrase("Greet the guest.", flush="true", uuid="guest"), say("$text")),
    find=_find_lost_value,
)


def _find_overwritten_literal(context: Context) -> Iterator[Finding]:
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
        verb = f"{'are' if several else 'is'} {how}"
        yield OVERWRITTEN_LITERAL.finding(
            f"the value{'s' * several} written for {names} {verb} replaced by the "
            f"output{'s' * several} of {context.place(source)}",
            context.plan.location(runner, attribute),
            length=len(attribute.name),
            related=(context.related(source, f"outputs {names}"),),
            scenario=context.triggering(OVERWRITTEN_LITERAL.code, number),
            unless=unless,
        )


def _attribute(context: Context, literal: Overwritten) -> Attribute:
    binding = context.bindings[literal.runner]
    assert binding is not None
    return binding.written[literal.name]


OVERWRITTEN_LITERAL = Rule(
    code="GP403",
    name="overwritten-literal",
    severity=Severity.WARNING,
    summary="An incoming value replaces the one written in the plan.",
    why=(
        "A value from the step before takes precedence over the attribute of the same name. "
        "An instruction written there never reaches the runner, and a robot may be sent to "
        "where it already is."
    ),
    fix=(
        "remove the attribute if the incoming value is the right one; otherwise put a step that "
        "outputs no such value between the two"
    ),
    bad=plan(look("Who is there?"), note(text="Summarise what the robot sees.", uuid="scene")),
    good=plan(look("Who is there?"), note(uuid="scene")),
    options=("--select", "GP403"),
    find=_find_overwritten_literal,
)


_MAX_RELATED = 20


def _find_unused_output(context: Context) -> Iterator[Finding]:
    """One finding per interface of which an instance gives something that nobody reads.

    What somebody misses is told there. The empty answer of a prompt that only fills its buffer
    does not count as an output.
    """
    flow: DataFlow = context.answers["data_flow"] or DataFlow()
    missed = {value.source for value in flow.lost}
    prompts = context.prompts.all if context.prompts is not None else ()
    empty = {each.runner: {each.answer} for each in prompts if each.flush is False}
    groups: dict[tuple[str, tuple[str, ...]], list[int]] = {}
    for unused in flow.unused:
        binding = context.bindings[unused.runner]
        assert binding is not None
        outputs = {output.name for output in binding.provider.outputs if not output.status}
        outputs -= empty.get(unused.runner, set())
        unread = tuple(name for name in unused.names if name in outputs)
        if unused.runner not in missed and outputs and len(unread) == len(outputs):
            groups.setdefault((binding.interface.name, unread), []).append(unused.runner)
    for (_, unread), numbers in groups.items():
        first, *others = (context.runner(number) for number in numbers)
        names = listed([f"'{name}'" for name in unread])
        what = "output" if len(unread) == 1 else "outputs"
        more = f" ({len(others)} more like this)" if others else ""
        yield UNUSED_OUTPUT.finding(
            f"nothing uses the {what} of {context.place(first)}: {names}{more}",
            context.plan.location(first),
            related=tuple(
                context.related(other, "its output is not used either")
                for other in others[:_MAX_RELATED]
            ),
        )


UNUSED_OUTPUT = Rule(
    code="GP404",
    name="unused-output",
    severity=Severity.INFO,
    summary="Nothing uses the output of a runner.",
    why=(
        "A value reaches only the direct successor. If that step does not read it, the runner "
        "looked, listened or asked for nothing."
    ),
    fix="put a runner that uses the value right after it; nothing if only its success matters",
    bad=plan(hear()),
    good=plan(hear(), note(uuid="guest")),
    options=("--select", "GP404"),
    find=_find_unused_output,
)


def _find_mismatched_value(context: Context) -> Iterator[Finding]:
    """One finding per value."""
    flow: DataFlow = context.answers["data_flow"] or DataFlow()
    for value in flow.mismatched:
        taker, giver = context.runner(value.runner), context.runner(value.source)
        yield MISMATCHED_VALUE.finding(
            f"{context.place(taker)} expects '{value.name}' of type {value.wanted}, but "
            f"{context.place(giver)} outputs it as {value.arriving}",
            context.plan.location(taker),
            related=(context.related(giver, f"outputs '{value.name}'"),),
            scenario=context.triggering(MISMATCHED_VALUE.code, value.runner),
        )


MISMATCHED_VALUE = Rule(
    code="GP405",
    name="mismatched-value",
    severity=Severity.ERROR,
    summary="An incoming value has the wrong type.",
    why=(
        "Names decide what a value is used for; types are not converted. A runner that "
        "receives text where it expects a number fails, and in the original stack the engine "
        "crashes with it."
    ),
    fix="put a step that outputs no value of this name between the two",
    bad="",  # no two runners of the built-in library disagree
    good=plan(locate(), tell_pose(flush="true")),
    find=_find_mismatched_value,
)


RULES = (
    MISSING_INPUT,
    LOST_VALUE,
    OVERWRITTEN_LITERAL,
    UNUSED_OUTPUT,
    MISMATCHED_VALUE,
)
