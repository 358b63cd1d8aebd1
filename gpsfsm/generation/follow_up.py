"""What a model is asked after its answer was not accepted: as much as it has room to read."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.generation.language_model import Finish, Message, Role
from gpsfsm.generation.prompts.templates import find_template
from gpsfsm.generation.prompts.tokens import conversation_tokens

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.generation.loop import Attempt

__all__ = ["FollowUp", "follow_up"]

_FINDING = re.compile(r"\d+\. ")
_REST = "There is more, which is left out here."
_WANT = ", for want of room"


@dataclass(frozen=True, slots=True)
class FollowUp:
    """A conversation, and what was left out of it for want of room ("" if nothing was)."""

    messages: tuple[Message, ...]
    note: str = ""


def follow_up(prompt: Sequence[Message], attempt: Attempt, room: int | None = None) -> FollowUp:
    """The prompt, the answer and what is wrong with it, in at most ``room`` tokens (None: any).

    Earlier answers are left out: they cost room and mislead. If there is too little room, some of
    the findings go first, the worst stay, then the answer goes; the prompt always stays. Users and
    models take turns, since many servers refuse anything else.
    """
    for found in _variants(prompt, attempt):
        if room is None or conversation_tokens(each.text for each in found.messages) <= room:
            return found
    return FollowUp(tuple(prompt), "asked as if for the first time" + _WANT)


def _variants(prompt: Sequence[Message], attempt: Attempt) -> Iterator[FollowUp]:
    """The longest first."""
    shown = _shown(attempt)
    answers = [(Message(Role.ASSISTANT, shown),), ()] if shown else [()]
    for answer in answers:
        missing = "asked without its earlier answer" if shown and not answer else ""
        for correction, shortened in _corrections(attempt, alone=not answer):
            lost = "" if not shortened else "asked without some of what was wrong"
            note = " and ".join(each for each in (missing, lost) if each)
            yield FollowUp(_joined(prompt, answer, correction), note + _WANT if note else "")


def _joined(
    prompt: Sequence[Message], answer: Sequence[Message], correction: str
) -> tuple[Message, ...]:
    """Without an answer in between, what is said to the model is one message."""
    if answer:
        return (*prompt, *answer, Message(Role.USER, correction))
    *before, last = prompt
    return (*before, Message(last.role, f"{last.text.rstrip()}\n\n{correction}"))


def _shown(attempt: Attempt) -> str:
    """What the model has answered; after repairs its plan, for the findings are about that.

    Of what was cut off nothing is shown: it is long, and to be written anew.
    """
    judged = attempt.judgement
    if attempt.answer is None or attempt.answer.finish is Finish.LENGTH:
        return ""
    return judged.plan if judged is not None and judged.repairs else attempt.answer.text.strip()


def _corrections(attempt: Attempt, *, alone: bool) -> Iterator[tuple[str, bool]]:
    """What to say about the answer, and whether that is less than there is to say.

    Beside the answer, unless it is ``alone``, there is at least one finding.
    """
    assert attempt.answer is not None
    if not attempt.answer.text.strip():
        yield find_template("empty").filled({}), False
    elif attempt.answer.finish is Finish.LENGTH:
        yield find_template("cut").filled({}), False
    else:
        told = ""
        if attempt.judgement is not None and not attempt.judgement.accepted:
            told = attempt.judgement.told.strip()
        if attempt.problem:
            refused = find_template("refused").filled({"why": attempt.problem})
            if not told:
                yield refused, False
                return
            told = f"{refused}\n{told}"
        template = find_template("correction")
        yield template.filled({"findings": told}), False
        parts = told.split("\n\n")
        first = next((place for place, part in enumerate(parts) if _FINDING.match(part)), 0)
        for kept in range(len(parts) - 1, 0 if alone else first, -1):
            yield template.filled({"findings": "\n\n".join([*parts[:kept], _REST])}), True
