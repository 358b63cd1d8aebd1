"""Rules on engines other than the paper's: rejected, differing, aborted, cut off, waiting, altered.

GP701 to GP703 need only documentation: the first two are reported where a plan is read for the
engine, GP703 where its behaviour on paper and on the engine is compared
(``checking/engine_check.py``).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.on_engine import Cause, Loss
from gpsfsm.analysis.rules.base import Rule, control, go, hear, look, note, plan, runner, say
from gpsfsm.analysis.words import listed
from gpsfsm.compile.fabric import PROFILES
from gpsfsm.compile.validation import Renamed, Validation
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.capability import ValueType
from gpsfsm.model.engine import OptionType
from gpsfsm.model.event import End
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.printable import printable
from gpsfsm.model.story import Statement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.on_engine import OnEngine
    from gpsfsm.compile.validation import Taken
    from gpsfsm.model.capability import Binding
    from gpsfsm.model.engine import Parameter
    from gpsfsm.model.plan import Attribute


def _find_aborts_engine(engine: OnEngine) -> Iterator[Finding]:
    """One finding per join."""
    if engine.same:
        return
    context = engine.context
    joins = sorted(context.automaton.traits.breaking)
    solver = context.deciders.solver
    broken = solver.decide([solver.encoding.breaks(join) for join in joins])
    for join, aborts in zip(joins, broken, strict=True):
        if aborts:
            yield _aborts_engine_finding(engine, join)


def _aborts_engine_finding(engine: OnEngine, join: int) -> Finding:
    context = engine.context
    control = context.plan.elements[context.automaton.nodes[join].origin]
    early = join in context.automaton.deadly
    if join in context.automaton.traits.looping:
        what = (
            f"{engine.name} crashes when {context.place(control)} is done: its join is connected "
            "to itself, because another control follows directly"
        )
        closing = Statement.JOIN_LOOPS
    else:
        what = (
            f"{engine.name} crashes when a second success arrives at the join of "
            f"{context.place(control)}"
        )
        what += "" if early else ", after the plan has completed"
        closing = Statement.SECOND_INPUT
    return ABORTS_ENGINE.finding(
        what,
        context.plan.location(control),
        scenario=context.scenario(
            ABORTS_ENGINE.code, Claim(breaks=join, ends=End.ABORT if early else None), closing
        ),
    )


ABORTS_ENGINE = Rule(
    code="GP704",
    name="aborts-engine",
    severity=Severity.ERROR,
    summary="The engine crashes while it runs the plan.",
    why=(
        "A join of these engines starts a thread for each input and does not wait for the "
        "previous one: the second input ends the server process. Robots keep their last command, "
        "and the queue of plans is lost."
    ),
    fix=(
        "put a runner between two controls that follow each other, and use recovery or "
        "sequential instead of parallel controls; gpsfsm port can do this"
    ),
    bad=plan(
        go(1.0, 2.0),
        control("recovery", go(0.0, 2.0)),
        control("recovery", go(0.0, 0.0)),
        say("Hello."),
    ),
    good=plan(go(1.0, 2.0), control("recovery", go(0.0, 2.0), go(0.0, 0.0)), say("Hello.")),
    options=("--engine", "fabric-v2"),
    find_on_engine=_find_aborts_engine,
)


def _find_skipped_on_engine(engine: OnEngine) -> Iterator[Finding]:
    """One finding per runner whose missing STARTED skips others."""
    context = engine.context
    for cause, numbers in engine.lost.items():
        if cause.loss is not Loss.NO_STARTED:
            continue
        first = context.runner(context.automaton.runner_number(cause.node))
        trigger = engine.trigger(context.automaton.runner_number(cause.node))
        assert trigger is not None
        before = context.runner(context.automaton.runner_number(trigger.node))
        names = listed([context.place(context.runner(number)) for number in numbers])
        yield SKIPPED_ON_ENGINE.finding(
            f"{engine.name} never runs {names}: it starts the units of a parallel control on the "
            f"STARTED of the runner before, {context.place(before)}, which does not emit it",
            context.plan.location(first.parent),
            related=tuple(
                context.related(context.runner(number), "never runs") for number in numbers
            ),
        )


SKIPPED_ON_ENGINE = Rule(
    code="GP705",
    name="skipped-on-engine",
    severity=Severity.ERROR,
    summary="The engine silently skips runners of a parallel control.",
    why=(
        "fabric-v2 starts each unit of a parallel control on the STARTED of the runner before "
        "it, but its runners no longer emit STARTED, except those that wait for a topic. A "
        "parallel_any then continues without its units, and a parallel_all waits for ever."
    ),
    fix="run the units one after the other on this engine; gpsfsm port reports what that changes",
    bad=plan(go(1.0, 2.0), control("parallel_any", look("Is the door open?"), say("Hello."))),
    good=plan(go(1.0, 2.0), look("Is the door open?"), say("Hello.")),
    options=("--engine", "fabric-v2"),
    find_on_engine=_find_skipped_on_engine,
)


_CAUSES = (Loss.JOIN_EVENT, Loss.UNCONNECTED)


def _find_cut_off_on_engine(engine: OnEngine) -> Iterator[Finding]:
    """One finding per cause; what waits for a join that never fires is told by GP707."""
    context = engine.context
    for cause, numbers in engine.lost.items():
        if cause.loss not in _CAUSES:
            continue
        first = context.runner(numbers[0])
        names = listed([context.place(context.runner(number)) for number in numbers])
        yield CUT_OFF_ON_ENGINE.finding(
            f"{engine.name} never reaches {names}: {_reason(engine, cause)}",
            context.plan.location(first),
            related=tuple(
                context.related(context.runner(number), "never runs") for number in numbers[1:]
            ),
        )


def _reason(engine: OnEngine, cause: Cause) -> str:
    context = engine.context
    if cause.loss is Loss.UNCONNECTED:
        return "no event that can happen is connected to it"
    join = context.plan.elements[context.automaton.nodes[cause.node].origin]
    return (
        f"it waits for an event that the join of {context.place(join)} never emits, because one "
        "control directly follows another"
    )


CUT_OFF_ON_ENGINE = Rule(
    code="GP706",
    name="cut-off-on-engine",
    severity=Severity.ERROR,
    summary="The engine never reaches a part of the plan that the paper reaches.",
    why=(
        "These engines connect what follows a control to its last runner or join. If one control "
        "directly follows another, they use an event that joins never emit: everything from there "
        "on, including the completion of the plan, is out of reach."
    ),
    fix=(
        "put a runner between controls that follow each other, or merge them; gpsfsm port can do "
        "this"
    ),
    bad=plan(
        go(1.0, 2.0),
        control("recovery", go(0.0, 2.0)),
        control("recovery", go(0.0, 0.0)),
        say("Hello."),
    ),
    good=plan(go(1.0, 2.0), control("recovery", go(0.0, 2.0), go(0.0, 0.0)), say("Hello.")),
    options=("--engine", "fabric-v2"),
    find_on_engine=_find_cut_off_on_engine,
)


def _find_waits_on_engine(engine: OnEngine) -> Iterator[Finding]:
    """One finding per join that never fires although an input of it can come.

    A join at which two inputs abort the engine is told by GP704.
    """
    context, automaton = engine.context, engine.context.automaton
    solver = context.deciders.solver
    # A join that needs one input fires with the first that comes.
    joins = [node.index for node in automaton.nodes if node.kind is NodeKind.JOIN and node.need > 1]
    encoding = solver.encoding
    fires = solver.decide([encoding.triggered(join) for join in joins])
    for join, fired in zip(joins, fires, strict=True):
        inputs = automaton.inputs[join]
        if fired or not inputs:
            continue
        came = solver.decide([encoding.happens(signal) for signal in inputs])
        deadly = join in automaton.traits.breaking and sum(came) > 1
        if any(came) and not deadly:
            yield _waits_on_engine_finding(engine, join, sum(came))


def _waits_on_engine_finding(engine: OnEngine, join: int, inputs: int) -> Finding:
    context = engine.context
    node = context.automaton.nodes[join]
    control = context.plan.elements[node.origin]
    lost = [
        number
        for cause, numbers in engine.lost.items()
        if cause.loss is Loss.JOIN_WAITS and cause.node == join
        for number in numbers
    ]
    behind = ""
    if lost:
        names = listed([context.place(context.runner(number)) for number in lost])
        behind = f" and never reaches {names}"
    return WAITS_ON_ENGINE.finding(
        f"on {engine.name} the join of {context.place(control)} waits for {node.need} successes, "
        f"of which only {inputs} can arrive: the plan hangs there{behind}",
        context.plan.location(control),
        related=tuple(context.related(context.runner(number), "never runs") for number in lost),
    )


WAITS_ON_ENGINE = Rule(
    code="GP707",
    name="waits-on-engine",
    severity=Severity.ERROR,
    summary="A join of the engine waits for more successes than can arrive.",
    why=(
        "These engines connect every success in the whole plan that leads nowhere yet to the next "
        "join, including those from before the control, and count it as an input. Nothing ends "
        "the wait: the plan keeps running, and all plans in the queue after it wait too."
    ),
    fix="run the units one after the other on this engine; gpsfsm port reports what that changes",
    bad=plan(go(1.0, 2.0), control("parallel_all", look("Is the door open?"), say("Hello."))),
    good=plan(go(1.0, 2.0), look("Is the door open?"), say("Hello.")),
    options=("--engine", "fabric-v2"),
    find_on_engine=_find_waits_on_engine,
)


_EXPECTED = {
    ValueType.DOUBLE: OptionType.DOUBLE,
    ValueType.INT: OptionType.INT,
    ValueType.STRING: OptionType.STRING,
    ValueType.BOOL: OptionType.BOOL,
}
_WORDS = {
    OptionType.BOOL: "a Boolean",
    OptionType.DOUBLE: "a double",
    OptionType.INT: "an integer",
    OptionType.STRING: "a string",
}


def _find_kills_runner(engine: OnEngine) -> Iterator[Finding]:
    """One finding per attribute that is read as another type than the runner casts it to."""
    context = engine.context
    for number, binding in enumerate(context.compiled.bindings):
        if binding is None:
            continue
        for parameter in engine.parameters[number]:
            expected = _expected(binding, parameter)
            if expected in (None, parameter.type) or parameter.type not in _WORDS:
                continue
            if _replaced(engine, number, parameter.name):
                continue
            assert expected is not None
            yield _kills_runner_finding(engine, number, parameter, expected)


def _expected(binding: Binding, parameter: Parameter) -> OptionType | None:
    declared = binding.provider.parameter(parameter.name)
    return None if declared is None else _EXPECTED.get(declared.type)


def _replaced(engine: OnEngine, number: int, name: str) -> bool:
    """True if the value never reaches the runner: what triggers it hands over another one."""
    trigger = engine.trigger(number)
    runners = len(engine.context.plan.runners)
    if trigger is None or not 0 < trigger.node <= runners:
        return False
    source = engine.context.compiled.bindings[trigger.node - 1]
    return source is not None and any(
        output.name == name and output.event is trigger.event and not output.optional
        for output in source.provider.outputs
    )


def _kills_runner_finding(
    engine: OnEngine, number: int, parameter: Parameter, expected: OptionType
) -> Finding:
    context = engine.context
    element = context.runner(number)
    attribute = next(each for each in element.attributes if each.name == parameter.name)
    text = printable(attribute.text)
    return KILLS_RUNNER.finding(
        f'{engine.name} reads {parameter.name}="{text}" as {_WORDS[parameter.type]}, but '
        f"{context.place(element)} accepts only {_WORDS[expected]}: "
        "the server crashes when this runner starts",
        context.plan.location(element, attribute),
        hint=_hint(parameter, attribute.text, expected),
        length=len(parameter.name),
    )


def _hint(parameter: Parameter, text: str, expected: OptionType) -> str:
    """The same value, written so that the engine reads the type."""
    number = parameter.type in (OptionType.INT, OptionType.DOUBLE)
    if expected is OptionType.DOUBLE and parameter.type is OptionType.INT:
        return f'write {parameter.name}="{float(int(parameter.value)):.1f}"'
    if expected is OptionType.INT and number and float(parameter.value).is_integer():
        return f'write {parameter.name}="{int(parameter.value)}"'
    if expected is OptionType.STRING:
        return (
            f'write {parameter.name}="{printable(text)} " with a trailing space: no number or '
            "Boolean ends with a space"
        )
    if expected is OptionType.BOOL:
        return "write true or false, in lower case"
    return f"write {_WORDS[expected]}"


KILLS_RUNNER = Rule(
    code="GP708",
    name="kills-runner",
    severity=Severity.ERROR,
    summary="The engine reads an attribute as a type that crashes the runner.",
    why=(
        "fabric-v2 guesses the type of an attribute from its text, and its runners cast the value "
        "strictly: an integer where a double is expected ends the server process. 1.0 is a "
        "double, 1 is not."
    ),
    fix="write the value so that the engine reads the type that the runner expects",
    bad=plan(runner("nav2_capabilities/WaypointRunner", x="1", y="2.0")),
    good=plan(runner("nav2_capabilities/WaypointRunner", x="1.0", y="2.0")),
    options=("--engine", "fabric-v2"),
    find_on_engine=_find_kills_runner,
)


def _find_altered_by_engine(engine: OnEngine) -> Iterator[Finding]:
    """One finding per attribute that is another number on the engine."""
    context = engine.context
    for number, parameters in enumerate(engine.parameters):
        element = context.runner(number)
        written = {attribute.name: attribute for attribute in element.attributes}
        for parameter in parameters:
            attribute = written.get(parameter.name)
            if attribute is None or not _altered(attribute, parameter):
                continue
            yield ALTERED_BY_ENGINE.finding(
                f'{engine.name} changes {parameter.name}="{printable(attribute.text)}" of '
                f"{context.place(element)} to {printable(parameter.text) or 'an empty text'}",
                context.plan.location(element, attribute),
                length=len(parameter.name),
            )


def _altered(attribute: Attribute, parameter: Parameter) -> bool:
    """True if the text that the engine passes on is another value than the plan means."""
    if parameter.type not in (OptionType.DOUBLE, OptionType.INT):
        return False
    try:
        passed = float(parameter.text)
    except ValueError:
        return True
    meant = attribute.value
    if isinstance(meant, bool | str):  # the engine sees a number where the plan has none
        return True
    if isinstance(meant, int) and abs(meant) > 1 << 53:
        return int(parameter.value) != meant
    return float(meant) != passed and not (math.isnan(float(meant)) and math.isnan(passed))


ALTERED_BY_ENGINE = Rule(
    code="GP709",
    name="altered-by-engine",
    severity=Severity.WARNING,
    summary="The engine changes the value of an attribute.",
    why=(
        "fabric-v2 keeps six decimals of a number, takes integers modulo 2 to the 32nd, reads "
        "an empty text as 0, and interprets hexadecimal and similar texts as numbers."
    ),
    fix="write a value that survives: at most six decimals, and integers of at most 32 bits",
    bad=plan(runner("nav2_capabilities/WaypointRunner", x="0.1234567", y="2.0")),
    good=plan(runner("nav2_capabilities/WaypointRunner", x="0.123457", y="2.0")),
    options=("--engine", "fabric-v2"),
    find_on_engine=_find_altered_by_engine,
)


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
            yield UNRECEIVED_INPUT.finding(
                f"{engine.name} accepts this plan because '{alias}' is another name of the input "
                f"'{wanted}' of {context.place(runner)}, but at run time only the name counts",
                context.plan.location(runner),
                hint=f"write {wanted} instead of {alias}",
            )
            continue
        giver = context.runner(taken.giver)
        yield UNRECEIVED_INPUT.finding(
            f"{engine.name} accepts this plan because {context.place(giver)} has an output for "
            f"the input '{wanted}' of {context.place(runner)}, but at run time passes nothing: "
            f"{_reason_of(taken)}",
            context.plan.location(runner),
            hint=_hint_for(taken, context),
            related=(context.related(giver, "has the output"),),
        )


def _reason_of(taken: Taken) -> str:
    output = printable(taken.output.name)
    if taken.output.event is not taken.event:
        return (
            f"'{output}' comes with {taken.output.event.name}, but this step is triggered by "
            f"{taken.event.name}"
        )
    return f"the output is called '{output}', and only the name counts"


def _hint_for(taken: Taken, context: Context) -> str:
    provider = context.bindings[taken.runner]
    name = printable(taken.wanted.name)
    if provider is not None and provider.provider.parameter(taken.wanted.name) is not None:
        return f'write {name}="…" in the plan'
    return f"put a step that outputs '{name}' right before this one"


UNRECEIVED_INPUT = Rule(
    code="GP710",
    name="unreceived-input",
    severity=Severity.WARNING,
    summary="The engine accepts an input of a runner that receives no value at run time.",
    why=(
        "Before the run, fabric-v3 accepts any output whose name, semantic key or alias is one of "
        "the input's, from any step that leads directly to the runner, with any event. At run "
        "time it passes values on by name only, and only with the event to which they belong: the "
        "runner then starts without the value that was validated."
    ),
    fix="write the value in the plan, or put a step that outputs it by this name right before",
    bad=plan(hear(), control("recovery", note(uuid="visit"))),
    good=plan(hear(), note(uuid="visit")),
    options=("--engine", "fabric-v3"),
    find_on_engine=_find_unreceived_input,
)

RULES = (
    Rule(
        code="GP701",
        name="rejected-by-engine",
        severity=Severity.ERROR,
        summary="The engine does not accept the text of the plan.",
        why=(
            "The engines read plans with their own parser and check. A plan that they reject "
            "never runs: it gets no identifier, or it is listed as failed. The engine's own "
            "message follows 'engine message'. fabric-v3 also rejects plans whose runners lack a "
            "required input."
        ),
        fix="rewrite the plan for the engine with gpsfsm port, or change what the message names",
        bad=plan(go(1.0, 2.0)) + "That is all.\n",
        good=plan(go(1.0, 2.0)),
        options=("--engine", "fabric-v2"),
    ),
    Rule(
        code="GP702",
        name="crashes-engine",
        severity=Severity.ERROR,
        summary="The engine crashes while it reads the plan.",
        why=(
            "Some texts make the engine's server read data that does not exist. The whole process "
            "ends, and with it all plans in its queue."
        ),
        fix="rewrite the plan for the engine with gpsfsm port, or change what the message names",
        bad=plan(go(1.0, 2.0), control("sequential", "<!-- nothing to do -->")),
        good=plan(go(1.0, 2.0)),
        options=("--engine", "fabric-v2"),
    ),
    Rule(
        code="GP703",
        name="differs-on-engine",
        severity=Severity.ERROR,
        summary="The plan behaves differently on this engine than in the paper.",
        why=(
            "The published engines do not connect controls as the paper draws them, and they have "
            "no give-up. The robot then does not do what was checked, simulated and agreed on. "
            "The scenario is the first in which the difference shows. A plan that hangs where it "
            "should give up does not count as a difference, because the engine cannot give up."
        ),
        fix=(
            "rewrite the plan with gpsfsm port; on these engines, use only runners in sequence, "
            "each with at most one recovery of runners right after it"
        ),
        bad=plan(go(1.0, 2.0), control("parallel_all", look("Is the door open?"), say("Hello."))),
        good=plan(go(1.0, 2.0), control("recovery", go(0.0, 2.0)), say("Hello.")),
        options=("--engine", "fabric-v2"),
    ),
    ABORTS_ENGINE,
    SKIPPED_ON_ENGINE,
    CUT_OFF_ON_ENGINE,
    WAITS_ON_ENGINE,
    KILLS_RUNNER,
    ALTERED_BY_ENGINE,
    UNRECEIVED_INPUT,
)
