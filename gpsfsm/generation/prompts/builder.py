"""The prompt for a task: what plans look like, what the robot can do, and the task.

If it does not fit into what the model can read, it is shortened step by step, and it is said what
was left out: first the details of the capabilities that fit the task least, then examples, then
whole capabilities.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError
from gpsfsm.generation.language_model import Message, Role
from gpsfsm.generation.prompts.offer import offers
from gpsfsm.generation.prompts.ranking import ranked
from gpsfsm.generation.prompts.templates import find_template
from gpsfsm.generation.prompts.tokens import conversation_tokens

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from gpsfsm.capabilities.library import Library
    from gpsfsm.generation.prompts.offer import Offer
    from gpsfsm.generation.prompts.templates import PromptTemplate

__all__ = ["Prompt", "PromptOptions", "build_prompt"]

MAX_TASK = 100_000
"""Characters of a task."""

_NO_FOLLOW_UP = "there may be no room to tell the model what is wrong with its answer"


@dataclass(frozen=True, slots=True)
class PromptOptions:
    """How to ask.

    ``only`` are patterns of interfaces to offer (empty: all). ``context`` are facts about the
    world, ``examples`` plans to show. ``context_tokens`` is what the model can read and write
    together (None: enough), of which ``answer_tokens`` are left for the answer, and
    ``follow_up_tokens``, if that is possible at all, for showing an answer with what is wrong.
    """

    template: str = "plan"
    only: tuple[str, ...] = ()
    context: tuple[str, ...] = ()
    examples: tuple[str, ...] = ()
    context_tokens: int | None = None
    answer_tokens: int = 2048
    follow_up_tokens: int = 0


@dataclass(frozen=True, slots=True)
class Prompt:
    """What to ask a model, and what is known about it.

    ``tokens`` is an estimate. ``offered`` are the names of the interfaces in it, ``notes`` say what
    was left out for want of room.
    """

    messages: tuple[Message, ...]
    task: str
    template: PromptTemplate
    tokens: int
    offered: tuple[str, ...]
    examples: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def build_prompt(
    task: str,
    library: Library,
    options: PromptOptions | None = None,
    *,
    said: str = "",
    about: str = "",
) -> Prompt:
    """The prompt for a task; ``said`` is how the model is told of it, if more is to be said.

    ``about`` are words that tell, beside the task, which capabilities are likely to be needed.
    Raises UsageError if there is no task, nothing to offer, or no room for a single capability.
    """
    options = options or PromptOptions()
    if not task.strip():
        raise UsageError("the task is empty: say what the robot is to do")
    if len(task) > MAX_TASK:
        raise UsageError(f"the task is longer than {MAX_TASK:,} characters")
    offered = offers(library, options.only)
    if not offered:
        raise UsageError("there is no capability to offer: add files with --capabilities")
    asked = said.strip() or f"Task: {task.strip()}"
    likely = ranked(f"{task}\n{about}", offered)
    return _fitting(_Wanted(task.strip(), asked, likely), options)


@dataclass(frozen=True, slots=True)
class _Wanted:
    """What is to be done, how the model is told, and what it may use, the best first."""

    task: str
    said: str
    offered: tuple[Offer, ...]


@dataclass(frozen=True, slots=True)
class _Draft:
    """What goes in: the first ``kept`` offers, of which ``detailed`` with details."""

    kept: int
    detailed: int
    examples: bool = True


def _fitting(wanted: _Wanted, options: PromptOptions) -> Prompt:
    """The longest prompt that fits."""
    room = None
    if options.context_tokens is not None:
        room = options.context_tokens - options.answer_tokens
    for draft in _drafts(len(wanted.offered), bool(options.examples)):
        prompt = _built(wanted, options, draft)
        if room is None or prompt.tokens <= room - options.follow_up_tokens:
            return prompt
    if room is not None and prompt.tokens <= room:
        return replace(prompt, notes=(*prompt.notes, _NO_FOLLOW_UP))
    raise UsageError(
        f"the model can read {options.context_tokens:,} tokens, of which {options.answer_tokens:,} "
        f"are for its answer; the shortest prompt takes about {prompt.tokens:,}: use a model with "
        "a longer context, a shorter task, or fewer tokens for the answer"
    )


def _drafts(number: int, examples: bool) -> Iterable[_Draft]:
    """From all there is to one capability without details."""
    yield _Draft(number, number)
    for detailed in range(number - 1, 0, -1):
        yield _Draft(number, detailed)
    if examples:
        yield _Draft(number, 1, examples=False)
    yield _Draft(number, 0, examples=False)
    for kept in range(number - 1, 0, -1):
        yield _Draft(kept, 0, examples=False)


def _built(wanted: _Wanted, options: PromptOptions, draft: _Draft) -> Prompt:
    offered = wanted.offered
    kept = sorted(
        enumerate(offered[: draft.kept]), key=lambda each: (each[1].name, each[1].provider.name)
    )
    blocks = [offer.block(details=place < draft.detailed) for place, offer in kept]
    examples = options.examples if draft.examples else ()
    template = find_template(options.template)
    system = template.filled(
        {
            "capabilities": "\n\n".join(blocks) + "\n",
            "context": _section("What is known", options.context),
            "examples": _section("Examples of plans for other tasks", examples),
        }
    )
    messages = (
        Message(Role.SYSTEM, system),
        Message(Role.USER, wanted.said),
    )
    return Prompt(
        messages=messages,
        task=wanted.task,
        template=template,
        tokens=conversation_tokens(each.text for each in messages),
        offered=tuple(dict.fromkeys(offer.name for _, offer in kept)),
        examples=examples,
        notes=tuple(_notes(offered, options, draft)),
    )


def _section(title: str, parts: Sequence[str]) -> str:
    if not parts:
        return ""
    body = "\n\n".join(part.strip() for part in parts)
    return f"\n# {title}\n\n{body}\n"


def _notes(offered: Sequence[Offer], options: PromptOptions, draft: _Draft) -> Iterable[str]:
    dropped = list(dict.fromkeys(offer.name for offer in offered[draft.kept :]))
    if dropped:
        yield (
            f"left out {len(dropped)} of {len(offered)} capabilities, which fit the task least: "
            f"{', '.join(sorted(dropped))}"
        )
    short = draft.kept - draft.detailed
    if short > 0:
        yield f"left out the details of {short} of {draft.kept} capabilities"
    if options.examples and not draft.examples:
        yield "left out the examples"
