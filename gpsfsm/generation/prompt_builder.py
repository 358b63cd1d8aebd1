"""Prompts: for a task, and for a plan that goes on where others gave up.

Their templates are versioned, and a version is never changed once it was released, so that a
journal which names it can be understood. ``offer`` says which runners a plan may use.
"""

from __future__ import annotations

import hashlib
import math
import re
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from string import Template
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError
from gpsfsm.generation.language_model import Message, Role, conversation_tokens
from gpsfsm.generation.offer import offers, ranked
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from gpsfsm.capabilities.library import Library
    from gpsfsm.generation.offer import Offer
    from gpsfsm.simulation.world import World

# ---- Templates -----------------------------------------------------------------------------------


_TEXTS = resources.files(__package__) / "prompts"
_FILE = re.compile(r"([a-z_]+)\.(\d+)\.txt")


@dataclass(frozen=True, slots=True)
class PromptTemplate:
    """A versioned text; ``id`` is ``plan.1``, ``sha256`` that of its text."""

    id: str
    text: str

    @property
    def sha256(self) -> str:
        """The hash of the text, for journals."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def filled(self, values: Mapping[str, str]) -> str:
        """The text with its values, in one pass: a ``$`` in a value means nothing."""
        return Template(self.text).substitute(values).strip() + "\n"


@cache
def template_names() -> tuple[str, ...]:
    """The ids of all templates, sorted by name and version."""
    versions = [
        (match[1], int(match[2]))
        for entry in _TEXTS.iterdir()
        if (match := _FILE.fullmatch(entry.name))
    ]
    return tuple(f"{name}.{version}" for name, version in sorted(versions))


@cache
def find_template(name: str) -> PromptTemplate:
    """The template of this id, or the newest of this name; raises UsageError if there is none."""
    names = template_names()
    fitting = [each for each in names if name in (each, each.rpartition(".")[0])]
    if not fitting:
        raise UsageError(
            f"there is no prompt template '{name}'; the templates are {', '.join(names)}"
        )
    file = _TEXTS.joinpath(f"{fitting[-1]}.txt")
    return PromptTemplate(fitting[-1], file.read_text(encoding="utf-8"))


# ---- Prompts made of them ------------------------------------------------------------------------


MAX_TASK = 100_000
"""Characters of a task."""

_NO_FOLLOW_UP = "there may be no room to tell the model what is wrong with its answer"
_MAX_STEPS = 60
_MAX_EARLIER = 5
_MAX_PLAN = 8_000
_MAX_TEXT = 300
_MAX_PLACES = 200
_MAX_NAME = 100


@dataclass(frozen=True, slots=True)
class PromptOptions:
    """Options of a prompt.

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
    """The messages for a model, and facts about them.

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
    question = said.strip() or f"Task: {task.strip()}"
    likely = ranked(f"{task}\n{about}", offered)
    return _fitting(_Wanted(task.strip(), question, likely), options)


@dataclass(frozen=True, slots=True)
class _Wanted:
    """The task, the question to the model, and what a plan may use, the best first."""

    task: str
    said: str
    offered: tuple[Offer, ...]


@dataclass(frozen=True, slots=True)
class _Draft:
    """The extent of a prompt: the first ``kept`` offers, of which ``detailed`` with details."""

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
            "conditions": _section("Conditions", _conditions(offer for _, offer in kept)),
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


def _conditions(offered: Iterable[Offer]) -> tuple[str, ...]:
    """The form of a condition, for robots that can check one."""
    checks = [offer for offer in offered if offer.provider.effects.checks]
    if not checks:
        return ()
    check = checks[0]
    parameter = check.provider.effects.checks
    return (
        f"{check.name} succeeds if the answer to its {parameter} is yes and fails if it is no. So "
        "what to do if not stands in a recovery right behind it. If something is to be done only "
        "if the answer is yes, put it behind the check in one sequential:",
        '<Control type="sequential">\n'
        f'  <Runner interface="{check.name}" provider="{check.provider.name}" '
        f'{parameter}="Is …?"/>\n'
        "  <Runner …if yes…/>\n"
        "</Control>\n"
        '<Control type="recovery">\n'
        "  <Runner …if no…/>\n"
        "</Control>",
        "Other runners that answer questions succeed whatever the answer is.",
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


@dataclass(frozen=True, slots=True)
class Step:
    """An action of a plan that has been run: what it is, and what came of it, both in words."""

    action: str
    outcome: str
    failed: bool = False


@dataclass(frozen=True, slots=True)
class Try:
    """A plan that was run and gave up; ``steps`` in the order in which they came to an end."""

    plan: str
    steps: tuple[Step, ...]


def build_continuation(
    task: str,
    library: Library,
    tries: Sequence[Try],
    *,
    facts: Sequence[str] = (),
    options: PromptOptions | None = None,
) -> Prompt:
    """The prompt for a plan that goes on after ``tries``, the last of which has just given up.

    ``facts`` say how things stand now. Raises UsageError like ``build_prompt``, also if there is no
    room for what has happened.
    """
    now = "".join(f"{clip(fact, 2 * _MAX_TEXT)}\n" for fact in facts)
    said = find_template("continuation").filled(
        {
            "task": task.strip(),
            "tries": "\n".join(_happened(tries)),
            "facts": f"This is how things stand now:\n{now}" if now else "",
        }
    )
    done = sorted({step.action for each in tries for step in each.steps})
    return build_prompt(task, library, options, said=said, about="\n".join(done))


def _happened(tries: Sequence[Try]) -> Iterator[str]:
    """Earlier tries in short, the last one whole."""
    earlier = tries[:-1][-_MAX_EARLIER:]
    left = len(tries) - 1 - len(earlier)
    if left > 0:
        yield f"{left} plans before these are left out.\n"
    for number, done in enumerate(earlier, start=left + 1):
        yield f"What came of plan {number}:"
        yield from _steps(done)
        yield ""
    if tries:
        last = tries[-1]
        if len(last.plan) <= _MAX_PLAN:
            yield f"This is plan {len(tries)}, the last one:\n\n{last.plan.strip()}\n"
        yield f"What came of plan {len(tries)}:"
        yield from _steps(last)
        yield ""


def _steps(done: Try) -> Iterator[str]:
    """The failures and the last steps, if there are too many."""
    kept = done.steps
    if len(kept) > _MAX_STEPS:
        recent = set(range(len(kept) - _MAX_STEPS // 2, len(kept)))
        failed = [place for place, step in enumerate(kept) if step.failed and place not in recent]
        recent.update(failed[-(_MAX_STEPS - len(recent)) :])
        yield f"- ({len(kept) - len(recent)} actions are left out)"
        kept = tuple(step for place, step in enumerate(kept) if place in recent)
    for step in kept:
        yield f"- {clip(step.action, _MAX_TEXT)}: {clip(step.outcome, _MAX_TEXT)}"
    if not done.steps:
        yield "- nothing was done"


def world_facts(world: World) -> tuple[str, ...]:
    """Facts about a world, one line each."""
    return tuple(_lines(world))


def _lines(world: World) -> Iterator[str]:
    robot = world.robot
    yield (
        f"- The robot is at x={robot.x:g}, y={robot.y:g} and looks in the direction of "
        f"{math.degrees(robot.yaw):g} degrees. Lengths are in metres."
    )
    for place in world.places[:_MAX_PLACES]:
        yield f"- {clip(place.name, _MAX_NAME)} is at x={place.x:g}, y={place.y:g}."
    if len(world.places) > _MAX_PLACES:
        yield f"- There are {len(world.places) - _MAX_PLACES} more places with a name."
