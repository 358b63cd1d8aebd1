"""Rules on recoveries: those that guard nothing, are not needed, or do the wrong step."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, ask, control, go, look, plan, say
from gpsfsm.analysis.rules.names import either
from gpsfsm.analysis.words import listed
from gpsfsm.compile import UnitKind
from gpsfsm.late import pattern
from gpsfsm.model.event import Outcome
from gpsfsm.model.finding import Confidence, Finding, Severity
from gpsfsm.model.plan import NOT_PARAMETERS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.analysis.context import Context
    from gpsfsm.model.plan import Element


def _find_recovery_without_predecessor(context: Context) -> Iterator[Finding]:
    """One finding per recovery; its runners are listed under it."""
    units = context.units
    dead = [unit for unit, kind in enumerate(units.kinds) if kind is UnitKind.DEAD]
    idle = sum(len(context.runners_in(unit)) for unit in dead) == len(context.plan.runners)
    end = "; the plan has no other steps, so it completes without doing anything" if idle else ""
    for unit in sorted(dead, key=lambda unit: units.elements[unit]):
        runners = context.runners_in(unit)
        if not runners:
            continue  # an empty recovery is GP109's
        element = context.plan.elements[units.elements[unit]]
        names = listed([context.place(context.runner(number)) for number in runners])
        verb = "runs" if len(runners) == 1 else "run"
        yield RECOVERY_WITHOUT_PREDECESSOR.finding(
            f"this recovery has no step before it to recover from, so {names} never {verb}{end}",
            context.plan.location(element),
            related=tuple(
                context.related(context.runner(number), "never runs") for number in runners
            ),
        )


RECOVERY_WITHOUT_PREDECESSOR = Rule(
    code="GP307",
    name="recovery-without-predecessor",
    severity=Severity.ERROR,
    summary="A recovery comes first in its control, so it has no step to recover from.",
    why=(
        "A recovery runs when the sibling right before it fails. Without that sibling it never "
        "runs, and the plan continues as if it were not there. Models write this when they "
        "mistake a recovery for a list of alternatives that begins with the goal."
    ),
    fix="put the goal before the recovery, and only the alternatives inside it",
    bad=plan(control("recovery", go(1.0, 3.0), go(0.0, 2.0)), go(0.0, 0.0)),
    good=plan(go(1.0, 3.0), control("recovery", go(0.0, 2.0)), go(0.0, 0.0)),
    find=_find_recovery_without_predecessor,
)


def _find_needless_recovery(context: Context) -> Iterator[Finding]:
    """One finding per recovery; the runners that never run are listed under it."""
    units = context.units
    reported: set[int] = set()
    for unit in context.unreached_roots:
        parent = units.parents[unit]
        if parent < 0 or units.kinds[parent] is not UnitKind.GUARD or parent in reported:
            continue
        reported.add(parent)
        position = units.positions[unit]
        siblings = units.children[parent]
        runners = [number for other in siblings[position:] for number in context.runners_in(other)]
        if not runners:
            continue
        before = context.place(context.element_of(siblings[position - 1]))
        assumed = " under the assumptions" if context.options.assumptions else ""
        names = listed([context.place(context.runner(number)) for number in runners])
        verb = "runs" if len(runners) == 1 else "run"
        yield NEEDLESS_RECOVERY.finding(
            f"{before} cannot fail{assumed}, so {names} in this recovery never {verb}",
            context.plan.location(units.elements[parent]),
            related=tuple(
                context.related(context.runner(number), "never runs") for number in runners
            ),
        )


NEEDLESS_RECOVERY = Rule(
    code="GP308",
    name="needless-recovery",
    severity=Severity.WARNING,
    summary="A recovery follows something that cannot fail.",
    why=(
        "Its steps never run. Often the recovery was meant for another step, which is then left "
        "without one."
    ),
    fix="remove the steps that never run, or move them after a step that can fail",
    bad=plan(say("I am leaving."), control("recovery", say("Mind the robot.")), go(1.0, 1.0)),
    good=plan(say("I am leaving."), go(1.0, 1.0), control("recovery", say("The way is blocked."))),
    options=("--assume", "SpeechRunner never fails"),
    find=_find_needless_recovery,
)


def _find_recovery_repeats_action(context: Context) -> Iterator[Finding]:
    """One finding per runner that repeats the guarded action or an earlier step."""
    units = context.units
    guards = [unit for unit, kind in enumerate(units.kinds) if kind is UnitKind.GUARD]
    for guard in sorted(guards, key=lambda unit: units.elements[unit]):
        tried: dict[tuple[object, ...], Element] = {}
        for step in units.children[guard]:
            for unit in _in_sequence(context, step):
                runner = context.element_of(unit)
                if context.reached[unit] and runner.action in tried:
                    yield _repeats_action_finding(context, runner, tried[runner.action])
            if units.kinds[step] is UnitKind.RUNNER:
                tried[context.element_of(step).action] = context.element_of(step)


def _repeats_action_finding(context: Context, runner: Element, before: Element) -> Finding:
    consistent = context.options.consistent
    again = " and fails again, because equal actions have equal outcomes" if consistent else ""
    return RECOVERY_REPEATS_ACTION.finding(
        f"{context.place(runner)} repeats the action that failed at {before.where}{again}",
        context.plan.location(runner),
        severity=Severity.WARNING if consistent else Severity.INFO,
        hint="try another action" if consistent else "",
        related=(context.related(before, "the first attempt"),),
    )


def _in_sequence(context: Context, unit: int) -> Iterator[int]:
    """The runners of a unit that is a runner, or a sequence of such."""
    pending = [unit]
    while pending:
        current = pending.pop()
        if context.units.kinds[current] is UnitKind.RUNNER:
            yield current
        elif context.units.kinds[current] is UnitKind.SEQUENCE:
            pending.extend(reversed(context.units.children[current]))


RECOVERY_REPEATS_ACTION = Rule(
    code="GP309",
    name="recovery-repeats-action",
    severity=Severity.INFO,
    summary="A recovery repeats the action that has just failed.",
    why=(
        "A second attempt can make sense, for example in a crowded corridor. If the world does "
        "not change in between, it fails again."
    ),
    fix="try another action, or keep this one if a second attempt makes sense",
    bad=plan(go(1.0, 3.0), control("recovery", go(1, 3)), go(0.0, 0.0)),
    good=plan(go(1.0, 3.0), control("recovery", go(1.0, 2.0)), go(0.0, 0.0)),
    severities="info; warning under --consistent, where the repetition is proved to be useless",
    find=_find_recovery_repeats_action,
)


_NUMBER = pattern(r"-?\d+(?:\.\d+)?")


def _find_recovery_holds_goal(context: Context) -> Iterator[Finding]:
    """One finding per recovery for which the plan itself shows that it holds a goal.

    From its shape alone nobody can tell a goal with its alternative from two alternatives. So one
    of three signs is required, each of which makes no sense if the steps are two alternatives.
    """
    units = context.units
    guards = [unit for unit, kind in enumerate(units.kinds) if kind is UnitKind.GUARD]
    misread = _orphaned_list(context)
    for guard in sorted(guards, key=lambda unit: units.elements[unit]):
        guarded, first, *others = units.children[guard]
        if not others or units.kinds[first] is not UnitKind.RUNNER:
            continue
        goal, before = context.element_of(first), context.element_of(guarded)
        sign = (
            _named_after(context.plan.elements[units.elements[guard]], goal, before)
            or _in_a_row(context, guard)
            or misread
        )
        if sign and context.reached[first] and goal.action != before.action:
            yield RECOVERY_HOLDS_GOAL.finding(
                f"{context.place(goal)} runs only after {context.place(before)} has failed, but "
                f"looks like a goal of its own: {sign}",
                context.plan.location(goal),
                related=(context.related(before, "must fail first"),),
            )


def _named_after(recovery: Element, goal: Element, before: Element) -> str:
    """The recovery's name holds the coordinates of its first step, not of what it guards."""
    label = recovery.text("name") or ""
    named = {float(number) for number in _NUMBER.findall(label)[:20]}
    mine, theirs = _coordinates(goal), _coordinates(before)
    if len(mine) > 1 and mine <= named and not (theirs and theirs <= named):
        return f"the recovery is named after it ('{label[:40]}')"
    return ""


def _coordinates(runner: Element) -> set[float]:
    return {
        float(value)
        for value in runner.parameters.values()
        if isinstance(value, int | float) and not isinstance(value, bool)
    }


def _in_a_row(context: Context, guard: int) -> str:
    """The recovery stands right beside another one, and both have several steps."""
    units = context.units
    neighbours = (units.parents[guard], units.children[guard][0])
    for other in neighbours:
        if other >= 0 and units.kinds[other] is UnitKind.GUARD:
            inner = guard if other == units.parents[guard] else other
            outer = other if inner == guard else guard
            nested = units.children[outer][0] == inner
            if nested and len(units.children[other]) > 2:
                return "another recovery with several steps is right next to this one"
    return ""


def _orphaned_list(context: Context) -> str:
    """The plan has a recovery with several steps that guards nothing."""
    units = context.units
    for unit, kind in enumerate(units.kinds):
        if kind is UnitKind.DEAD and len(units.children[unit]) > 1:
            where = context.plan.elements[units.elements[unit]].where
            return f"the recovery at {where} also lists a goal and its alternative"
    return ""


RECOVERY_HOLDS_GOAL = Rule(
    code="GP310",
    name="recovery-holds-goal",
    severity=Severity.WARNING,
    summary="A recovery seems to contain a goal together with its alternative.",
    why=(
        "Models mistake a recovery for a fallback that tries its children in order, goal "
        "first. It is not: it runs only after the sibling before it has failed, so in a "
        "normal run the goal is silently skipped. The rule reports this only if the plan "
        "itself gives a sign: the recovery is named after its first step, is next to "
        "another recovery with several steps, or is in the same plan as a recovery that guards "
        "nothing."
    ),
    fix="put the goal before the recovery, and only its alternatives inside it",
    bad=plan(
        go(2.0, -0.5),
        control("recovery", go(1.0, 3.0), go(0.0, 2.0), name="recovery_for_1_3"),
        go(-2.0, 0.0),
    ),
    good=plan(
        go(2.0, -0.5),
        go(1.0, 3.0),
        control("recovery", go(0.0, 2.0), name="recovery_for_1_3"),
        go(-2.0, 0.0),
    ),
    confidence=Confidence.HEURISTIC,
    find=_find_recovery_holds_goal,
)


_ASKING = frozenset(
    ("if", "whether", "unless", "else", "otherwise", "check", "determine", "decide", "condition")
)
_FAILING = ("fail", "error", "abort")
_YES_OR_NO = pattern(
    r"(?i)(?:^|[.,;:!?] *)"
    r"(?:(?:is|are|was|were|do|does|did|has|have|had|can|could|will|would|should)(?:n['\u2019]t)? "
    r"|any(?:body|one|thing)? )[^?.!]*\?|\b(?:whether"
    r"|(?:tell|say|check|see|determine|verify|confirm)(?: me| us)? if) "
)
_ABSENT = frozenset(("no", "not", "none", "nobody", "nothing", "without", "absent", "missing"))
_TRIES = frozenset(("again", "retry"))
_TROUBLE = pattern(
    r"(?i)\b(?:fail|error|abort|timeout|broken|defect|unavailable|offline|too.?dark|blind"
    r"|(?:camera|picture|image|photo|analysis|vision)s?\b.*\b(?:not|no|un)"
    r"|(?:no|not|without)\b.*\b(?:camera|picture|image|photo|analysis|vision)"
    r"|(?:can(?:not|.t| not)|could(?:n.t| not)|unable to) (?:\w+ )?"
    r"(?:see|look|tell|say|recogni[sz]e|detect|analy[sz]e|judge|ask))"
)
_WORD = pattern(r"[A-Z]?[a-z]+|[A-Z]+")
_MAX_TEXT = 2000


def _find_condition_as_recovery(context: Context) -> Iterator[Finding]:
    """One finding per recovery that stands where the plan asks what a runner answers.

    That is a recovery behind a yes-or-no question that a runner answers in words, or of a block
    that ends with a prompt that cannot fail. That prompt or the name of the recovery must ask
    something, or the recovery send the prompt. If such a prompt is guarded alone, the recovery
    never runs at all: that is GP308.
    """
    yield from _find_answered_questions(context)
    units = context.units
    guards = [unit for unit, kind in enumerate(units.kinds) if kind is UnitKind.GUARD]
    prompts = () if context.prompts is None else context.prompts.all
    uuids = {prompt.runner: prompt.uuid or "" for prompt in prompts}
    sent = {prompt.runner: prompt.uuid or "" for prompt in prompts if prompt.flush is not False}
    for guard in sorted(guards, key=lambda unit: units.elements[unit]):
        guarded, first = units.children[guard][0], units.children[guard][1]
        last = _last_step(context, guarded)
        if last < 0 or not context.reached[first] or not _answers_only(context, last):
            continue
        if not _asks(context, last, guard) and not _sends(context, sent, uuids[last], guard):
            continue  # the prompt may just as well tell what has been done
        prompt = context.runner(last)
        able = [
            number
            for number in context.runners_in(guarded)
            if number != last and _can_fail(context, number)
        ]
        causes = either([context.place(context.runner(number)) for number in able])
        yield CONDITION_AS_RECOVERY.finding(
            f"this recovery does not depend on what {context.place(prompt)} says: this prompt "
            f"never fails, so the recovery runs only if {causes} fails",
            context.plan.location(units.elements[guard]),
            related=(context.related(prompt, "never fails, whatever it says"),),
            hint=_condition_hint(context),
        )


def _find_answered_questions(context: Context) -> Iterator[Finding]:
    """One finding per recovery of a question that is answered in words, and not by a failure."""
    units = context.units
    guards = [unit for unit, kind in enumerate(units.kinds) if kind is UnitKind.GUARD]
    for guard in sorted(guards, key=lambda unit: units.elements[unit]):
        guarded, first = units.children[guard][0], units.children[guard][1]
        number = _question(context, guard) if context.reached[first] else -1
        if number < 0:
            continue
        runner = context.runner(number)
        others = [
            context.place(context.runner(other))
            for other in context.runners_in(guarded)
            if other != number and _can_fail(context, other)
        ]
        more = f", or {either(others)} fails" if others else ""
        yield CONDITION_AS_RECOVERY.finding(
            f"{context.place(runner)} succeeds whatever the answer is, so this recovery runs only "
            f"if there is no answer at all{more}",
            context.plan.location(units.elements[guard]),
            related=(context.related(runner, "succeeds even if the answer is no"),),
            hint=_condition_hint(context),
        )


def _question(context: Context, guard: int) -> int:
    """The number of the runner whose answer a recovery seems to mean, or -1.

    It is what the recovery guards, or the last step of that. A step before others is only meant if
    the recovery is named after a condition: else it is for the failures of those others.
    """
    units = context.units
    guarded = units.children[guard][0]
    last = _last_step(context, guarded, alone=True)
    steps = [last] if last >= 0 else []
    label = context.plan.elements[units.elements[guard]].text("name") or ""
    if last >= 0 and _answers_only(context, last):
        return -1  # a prompt that cannot fail, which has its own finding
    if _words(label[:_MAX_TEXT]) & (_ASKING | _ABSENT) and units.kinds[guarded] is (
        UnitKind.SEQUENCE
    ):
        steps += [
            context.numbers[units.elements[unit]]
            for unit in units.children[guarded]
            if units.kinds[unit] is UnitKind.RUNNER
        ]
    for number in steps:
        binding = context.bindings[number]
        effects = None if binding is None else binding.provider.effects
        if effects is None or not effects.answers or not _can_fail(context, number):
            continue  # what cannot fail alone is GP308's
        if _is_condition(context, guard, context.runner(number), effects.question):
            return number
    return -1


def _is_condition(context: Context, guard: int, runner: Element, question: str) -> bool:
    """True if a question wants yes or no, or the recovery's name asks; not if trouble is meant.

    "Is the door open?" before "The door is shut." means the answer. Before "It is too dark.", or
    before another look, it may well mean the camera, as recoveries do.
    """
    units = context.units
    recovery = context.plan.elements[units.elements[guard]]
    label = (recovery.text("name") or "")[:_MAX_TEXT]
    asks = bool("?" in label or _words(label) & _ASKING)
    question_text = (runner.text(question) or "")[:_MAX_TEXT] if question else ""
    if not asks and not _YES_OR_NO.search(question_text):
        return False
    named = _words(label)
    if named & _TRIES or _TROUBLE.search(" ".join(_WORD.findall(label))):
        return False
    first = True
    for unit in units.children[guard][1:]:
        for number in context.runners_in(unit):
            step = context.runner(number)
            if first and not asks and step.interface == runner.interface:
                return False  # another look
            first = False
            if any(_TROUBLE.search(text[:_MAX_TEXT]) for text in _written(step)):
                return False
    return True


def _written(runner: Element) -> Iterator[str]:
    """The texts that a plan writes at a runner, without the names of what runs."""
    for attribute in runner.attributes:
        if attribute.name == "name" or attribute.name not in NOT_PARAMETERS:
            yield attribute.text


def _condition_hint(context: Context) -> str:
    """The runner that checks a condition, where the robot has one; else the hint of the rule."""
    checks = sorted(
        provider.implements
        for provider in context.capabilities.library.providers
        if provider.effects.checks and not provider.deprecated
    )
    if not checks:
        return CONDITION_AS_RECOVERY.fix
    name = checks[0].rpartition("/")[2]
    return f"ask with a {name}, which fails if the answer is no, and put the recovery after it"


def _last_step(context: Context, unit: int, *, alone: bool = False) -> int:
    """The number of the runner with which a sequence ends, or -1 if it ends otherwise.

    ``alone``: a runner that is no sequence counts as well.
    """
    units = context.units
    inside = alone
    while units.kinds[unit] is UnitKind.SEQUENCE and units.children[unit]:
        unit = units.children[unit][-1]
        inside = True
    if not inside or units.kinds[unit] is not UnitKind.RUNNER:
        return -1
    return context.numbers[units.elements[unit]]


def _answers_only(context: Context, number: int) -> bool:
    """True if the runner prompts a model and never fails."""
    binding = context.bindings[number]
    prompts = binding is not None and binding.provider.effects.prompt_buffer is not None
    return prompts and not _can_fail(context, number)


def _asks(context: Context, number: int, guard: int) -> bool:
    """True if the texts of a prompt or the name of the recovery read like a condition."""
    binding = context.bindings[number]
    assert binding is not None
    buffer = binding.provider.effects.prompt_buffer
    assert buffer is not None
    silent = {*(NOT_PARAMETERS - {"name"}), buffer.uuid, buffer.flush}
    for attribute in context.runner(number).attributes:
        text = attribute.text[:_MAX_TEXT]
        if attribute.name not in silent and ("?" in text or _words(text) & _ASKING):
            return True
    label = context.plan.elements[context.units.elements[guard]].text("name") or ""
    words = _words(label[:_MAX_TEXT])
    # "if the goal fails" is what recoveries are for
    return bool("?" in label or words & _ASKING) and not any(
        word.startswith(_FAILING) for word in words
    )


def _words(text: str) -> set[str]:
    """The words of a text or of a name such as ``if_no_person`` or ``ifNoPerson``."""
    return {word.lower() for word in _WORD.findall(text)}


def _sends(context: Context, sent: Mapping[int, str], uuid: str, guard: int) -> bool:
    """True if a step of the recovery may flush this buffer."""
    return bool(uuid) and any(
        sent.get(number) == uuid
        for unit in context.units.children[guard][1:]
        for number in context.runners_in(unit)
    )


def _can_fail(context: Context, number: int) -> bool:
    allowed = context.deciders.constraints.allowed[number]
    return bool(allowed & {Outcome.FAILED, Outcome.NO_START})


CONDITION_AS_RECOVERY = Rule(
    code="GP312",
    name="condition-as-recovery",
    severity=Severity.WARNING,
    summary="A recovery is used as if it tested a runner's answer.",
    why=(
        "A recovery runs only after a failure. A buffered prompt never fails, and an "
        "ImageAnalysisRunner that checks whether somebody is there succeeds even if nobody is. "
        "So the steps of the recovery do not run in the case that they were written for. A "
        "condition needs a runner that fails if the answer is no, such as CheckRunner. The rule "
        "reports nothing if the recovery seems to handle camera problems: if it looks again, or "
        "says that nothing can be seen."
    ),
    fix=(
        "let the model decide (flush the prompt with a runner that asks for a plan, and set that "
        "plan), or guard the step whose failure you mean"
    ),
    bad=plan(
        go(1.0, 2.0),
        look("Is there a person?"),
        control("recovery", go(3.0, 4.0), name="if_nobody_is_there"),
    ),
    good=plan(
        go(1.0, 2.0),
        ask("Is there a person?"),
        control("recovery", go(3.0, 4.0), name="if_nobody_is_there"),
    ),
    confidence=Confidence.HEURISTIC,
    find=_find_condition_as_recovery,
)


RULES = (
    RECOVERY_WITHOUT_PREDECESSOR,
    NEEDLESS_RECOVERY,
    RECOVERY_REPEATS_ACTION,
    RECOVERY_HOLDS_GOAL,
    CONDITION_AS_RECOVERY,
)
