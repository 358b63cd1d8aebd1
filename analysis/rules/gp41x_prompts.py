"""Rules on prompts and their buffers: never sent, sent empty, mixed, used unanswered."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.causes import buffer_name
from gpsfsm.analysis.decisions.prompts import PromptFlow, empty_flush_claim, unflushed_claim
from gpsfsm.analysis.rules.base import Rule, ask_plan, go, look, note, phrase, plan, say, set_plan
from gpsfsm.analysis.words import listed
from gpsfsm.model.finding import Confidence, Finding, Severity
from gpsfsm.model.story import Sentence, Statement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.causes import Concerned
    from gpsfsm.analysis.context import Context


def _find_unflushed_prompt(context: Context) -> Iterator[Finding]:
    """One finding per buffer; another one of what GP413 or GP414 tells, if nobody sees that."""
    for concerned in context.buffers.unflushed:
        if concerned.uuid:
            yield _unflushed_prompt_finding(context, concerned)
        else:
            yield _nameless(context, concerned)


def _nameless(context: Context, concerned: Concerned) -> Finding:
    prompt = context.runner(concerned.runners[0])
    return UNFLUSHED_PROMPT.finding(
        f"the model never receives the prompt of {context.place(prompt)}: without a uuid and "
        "without flush, it stays in a buffer that nothing can flush",
        context.plan.location(prompt),
        hint='set flush="true" to send it, or give it the uuid of a prompt that is flushed later',
        unless=concerned.unless,
    )


def _unflushed_prompt_finding(context: Context, concerned: Concerned) -> Finding:
    assert context.prompts is not None
    uuid, numbers = concerned.uuid, concerned.runners
    flushes = context.prompts.flushing(uuid) or ()
    first, *others = (context.runner(number) for number in numbers)
    names = listed([context.place(context.runner(number)) for number in numbers])
    name = buffer_name(uuid)
    if flushes:
        message = f"the plan can complete without sending the prompt of {names}"
        reason = f"not every run flushes the buffer '{name}' after it"
        claim = unflushed_claim(context.automaton, numbers[0], flushes)
        closing = Sentence(Statement.UNFLUSHED, arguments=(name,))
        scenario = context.scenario(UNFLUSHED_PROMPT.code, claim, closing)
        hint = (
            f'put a prompt with flush="true" uuid="{name}" where every run reaches it after this '
            "one"
        )
    else:
        message = f"the model never receives the prompt of {names}"
        reason = f"nothing flushes the buffer '{name}'"
        scenario = None
        hint = f'set flush="true" uuid="{name}" on the last prompt that belongs to it'
    return UNFLUSHED_PROMPT.finding(
        f"{message}: {reason}",
        context.plan.location(first),
        hint=hint,
        related=tuple(context.related(other, f"also waits in '{name}'") for other in others),
        scenario=scenario,
        unless=concerned.unless,
    )


UNFLUSHED_PROMPT = Rule(
    code="GP411",
    name="unflushed-prompt",
    severity=Severity.WARNING,
    summary="A prompt is buffered but, in some completing run, never sent.",
    why=(
        "A prompt runner keeps its text in a buffer until a prompt with the same uuid and "
        "flush set to true sends the whole buffer. It always reports success, so nothing shows "
        "that the model never received the prompt."
    ),
    fix='set flush="true" on the last of the prompts that belong together',
    bad=plan(go(1.0, 2.0), look("Who is there?"), note(uuid="scene"), say("Thank you.")),
    good=plan(
        go(1.0, 2.0),
        look("Who is there?"),
        note(uuid="scene"),
        phrase("Say who is there.", uuid="scene", flush="true"),
        say("$text"),
    ),
    find=_find_unflushed_prompt,
)


def _find_empty_flush(context: Context) -> Iterator[Finding]:
    """One finding per flush; where the fills went to another buffer, GP413 tells."""
    for concerned in context.buffers.empty:
        yield _empty_flush_finding(context, concerned)


def _empty_flush_finding(context: Context, concerned: Concerned) -> Finding:
    assert context.prompts is not None
    number = concerned.runners[0]
    fills = context.prompts.filling(concerned.uuid) or ()
    name, place = buffer_name(concerned.uuid), context.place(context.runner(number))
    scenario = None
    if fills:
        message = (
            f"{place} can send the buffer '{name}' while it is empty: "
            "the model then receives only this prompt"
        )
        claim = empty_flush_claim(context.automaton, number, fills)
        closing = Sentence(Statement.EMPTY_FLUSH, arguments=(name,))
        scenario = context.scenario(EMPTY_FLUSH.code, claim, closing)
    else:
        message = (
            f"{place} sends the buffer '{name}', which this plan never fills: "
            "the model receives only this prompt"
        )
    return EMPTY_FLUSH.finding(
        message,
        context.plan.location(context.runner(number)),
        scenario=scenario,
        unless=concerned.unless,
    )


EMPTY_FLUSH = Rule(
    code="GP412",
    name="empty-flush",
    severity=Severity.WARNING,
    summary="A prompt buffer is sent while it is empty.",
    why=(
        "The model receives only the last prompt, without what the robot has seen and heard, "
        "and answers anyway."
    ),
    fix=(
        "give the prompts that belong together the same uuid and put this one last; "
        "remove the uuid if no other prompt belongs to it"
    ),
    bad=plan(
        go(1.0, 2.0),
        phrase("Say what you see.", uuid="scene", flush="true"),
        say("$text"),
    ),
    good=plan(
        go(1.0, 2.0),
        look("Who is there?"),
        note(uuid="scene"),
        phrase("Say what you see.", uuid="scene", flush="true"),
        say("$text"),
    ),
    find=_find_empty_flush,
)


def _find_mixed_buffers(context: Context) -> Iterator[Finding]:
    """One finding per flush that comes after prompts in buffers that nothing sends."""
    for mixed in context.buffers.mixed:
        flush = context.runner(mixed.flush)
        fills = [context.runner(number) for number in mixed.fills]
        buffers = listed([f"'{buffer_name(uuid)}'" for uuid in mixed.uuids])
        sent, wanted = buffer_name(mixed.uuid), buffer_name(mixed.uuids[0])
        which = f"sends only the buffer '{sent}'" if sent else "has no uuid and sends no buffer"
        yield MIXED_BUFFERS.finding(
            f"{context.place(flush)} {which}, but the prompts before it wait in {buffers}, "
            "which nothing sends",
            context.plan.location(flush),
            hint=f'write uuid="{wanted}" here if these prompts belong together',
            related=tuple(context.related(fill, "waits in another buffer") for fill in fills),
        )


MIXED_BUFFERS = Rule(
    code="GP413",
    name="mixed-buffers",
    severity=Severity.WARNING,
    summary="A prompt is sent while a related one seems to wait in another buffer.",
    why=(
        "Only prompts with the same uuid are sent together. The model answers without the "
        "rest, and nothing shows it."
    ),
    fix="give the prompts that belong together the same uuid",
    bad=plan(
        look("Who is there?"),
        note(uuid="scene"),
        phrase("Say who is there.", uuid="speech", flush="true"),
        say("$text"),
    ),
    good=plan(
        look("Who is there?"),
        note(uuid="scene"),
        phrase("Say who is there.", uuid="scene", flush="true"),
        say("$text"),
    ),
    confidence=Confidence.HEURISTIC,
    find=_find_mixed_buffers,
)


def _find_empty_answer(context: Context) -> Iterator[Finding]:
    """One finding per answer, at the prompt."""
    flow: PromptFlow = context.answers["prompts"] or PromptFlow()
    for answer in flow.empty_answers:
        binding = context.bindings[answer.runner]
        assert binding is not None
        prompt, taker = context.runner(answer.source), context.runner(answer.runner)
        if binding.provider.effects.sets_plan == answer.name:
            effect = f"so {context.place(taker)} sets an empty plan and nothing follows"
        else:
            effect = f"so {context.place(taker)} receives an empty '{answer.name}'"
        yield EMPTY_ANSWER.finding(
            f"{context.place(prompt)} only buffers its prompt and does not ask the model, {effect}",
            context.plan.location(prompt),
            related=(context.related(taker, "uses the empty answer"),),
            scenario=context.triggering(EMPTY_ANSWER.code, answer.runner),
        )


EMPTY_ANSWER = Rule(
    code="GP414",
    name="empty-answer",
    severity=Severity.ERROR,
    summary="A runner uses the answer to a prompt that was only buffered.",
    why=(
        "A prompt is sent only if flush is true. Until then its answer is the empty text, and "
        "the runner reports success. A plan that leaves its next step to the model ends "
        "there: the empty plan is rejected, and the robot does nothing more."
    ),
    fix='set flush="true" on the prompt, with the uuid of the prompts that belong to it',
    bad=plan(go(1.0, 2.0), ask_plan("Continue the tour."), set_plan()),
    good=plan(go(1.0, 2.0), ask_plan("Continue the tour.", flush="true"), set_plan()),
    find=_find_empty_answer,
)


RULES = (
    UNFLUSHED_PROMPT,
    EMPTY_FLUSH,
    MIXED_BUFFERS,
    EMPTY_ANSWER,
)
