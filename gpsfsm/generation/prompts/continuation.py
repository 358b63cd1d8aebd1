"""What a model is asked when a running plan has given up: what was done, what failed, what remains.

Paper, section III: where the machine is not specified, the model generates what comes next.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.generation.prompts.builder import build_prompt
from gpsfsm.generation.prompts.templates import find_template
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.capabilities.library import Library
    from gpsfsm.generation.prompts.builder import Prompt, PromptOptions

__all__ = ["Step", "Try", "build_continuation"]

_MAX_STEPS = 60
_MAX_EARLIER = 5
_MAX_PLAN = 8_000
_MAX_TEXT = 300


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
            "tries": "\n".join(_told(tries)),
            "facts": f"This is how things stand now:\n{now}" if now else "",
        }
    )
    done = sorted({step.action for each in tries for step in each.steps})
    return build_prompt(task, library, options, said=said, about="\n".join(done))


def _told(tries: Sequence[Try]) -> Iterator[str]:
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
