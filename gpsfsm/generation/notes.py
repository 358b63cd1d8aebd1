"""Notes about a language model in the journal of a run: a request, a rejected answer, a plan.

A note is the data of a LOG row; the text beside it is made from the data once and is for people
alone. The first edition of gpsfsm wrote the text only: ``kind_of`` reads that too.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from gpsfsm.execution.journal_rows import LogLine
    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import Logger
    from gpsfsm.generation.language_model import Answer
    from gpsfsm.generation.loop import Attempt

_MOST_MISTAKES = 5
_MAX_TEXT = 2_000
_MAX_NUMBER = 2**53  # what no reader of JSON rounds


class NoteKind(StrEnum):
    """The subject of a note: the field ``note`` of its data."""

    REQUEST = "request"
    REJECTED = "rejected"
    ACCEPTED = "accepted"


@dataclass(frozen=True, slots=True)
class RequestNote:
    """A request to a model and what came of it: an answer, or an error.

    ``estimated``: the tokens are not those that the provider counted. Neither the question nor a
    key is in it.
    """

    model: str
    error: str = ""
    prompt_tokens: int | None = None
    answer_tokens: int | None = None
    estimated: bool = False
    cost: float | None = None
    latency_s: float | None = None

    @property
    def text(self) -> str:
        """The note for people."""
        if self.error:
            return f"asked {self.model}: {self.error}"
        parts, about = [], "about " if self.estimated else ""
        if self.prompt_tokens is not None:
            parts.append(f"{about}{self.prompt_tokens:,} tokens asked")
        if self.answer_tokens is not None:
            parts.append(f"{about}{self.answer_tokens:,} tokens answered")
        if self.cost is not None:
            parts.append(f"cost {self.cost:.4f}")
        if self.latency_s is not None:
            parts.append(f"{self.latency_s:.1f} s")
        return f"asked {self.model}: {', '.join(parts)}"

    @property
    def data(self) -> Mapping[str, RunValue]:
        """The note for programs; without the numbers that are not known."""
        data: dict[str, RunValue] = {"note": NoteKind.REQUEST.value, "model": self.model}
        if self.error:
            data["error"] = self.error
        if self.estimated:
            data["estimated"] = True
        for name in ("prompt_tokens", "answer_tokens", "cost", "latency_s"):
            value = getattr(self, name)
            if value is not None and abs(value) < _MAX_NUMBER:  # which nan is not either
                data[name] = value
        return data


@dataclass(frozen=True, slots=True)
class RejectedNote:
    """An answer that is no plan that could be accepted: ``mistakes`` are rules and messages."""

    attempt: int
    mistakes: tuple[tuple[str, str], ...] = ()
    problem: str = ""

    @property
    def text(self) -> str:
        """The note for people."""
        return clip(f"attempt {self.attempt} was rejected: {self.reason}", _MAX_TEXT)

    @property
    def reason(self) -> str:
        """The mistakes for people."""
        if self.problem:
            return self.problem
        mistakes = [f"{rule}: {message}" for rule, message in self.mistakes]
        return "; ".join(mistakes) or "there is no plan in the answer"

    @property
    def data(self) -> Mapping[str, RunValue]:
        """The note for programs."""
        data: dict[str, RunValue] = {"note": NoteKind.REJECTED.value, "attempt": self.attempt}
        if self.mistakes:
            data["mistakes"] = [[clip(part, _MAX_TEXT) for part in each] for each in self.mistakes]
        if self.problem:
            data["problem"] = clip(self.problem, _MAX_TEXT)
        return data


@dataclass(frozen=True, slots=True)
class AcceptedNote:
    """The answer to an attempt is a plan that was accepted."""

    attempt: int

    @property
    def text(self) -> str:
        """The note for people."""
        return f"accepted the plan of attempt {self.attempt}"

    @property
    def data(self) -> Mapping[str, RunValue]:
        """The note for programs."""
        return {"note": NoteKind.ACCEPTED.value, "attempt": self.attempt}


def answered(model: str, answer: Answer) -> RequestNote:
    """The note about a request that was answered."""
    usage = answer.usage
    return RequestNote(
        model,
        prompt_tokens=usage.prompt_tokens,
        answer_tokens=usage.answer_tokens,
        estimated=usage.estimated,
        cost=answer.cost,
        latency_s=answer.latency_s,
    )


def rejected(attempt: Attempt) -> RejectedNote:
    """The note about an answer that was rejected, with the worst mistakes."""
    judgement = attempt.judgement
    if attempt.problem or judgement is None:
        return RejectedNote(attempt.round, problem=attempt.problem)
    most = min(judgement.errors or _MOST_MISTAKES, _MOST_MISTAKES)  # errors come first
    return RejectedNote(attempt.round, judgement.findings[:most])


def write(note: RequestNote | RejectedNote | AcceptedNote, log: Logger) -> None:
    """Put a note into the journal of the run."""
    log(note.text, note.data)


_FIRST_EDITION = (
    (NoteKind.REQUEST, re.compile(r"asked .")),
    (NoteKind.ACCEPTED, re.compile(r"accepted the plan of attempt \d{1,9}\Z", re.ASCII)),
)


def kind_of(
    text: str, data: Mapping[str, RunValue], *, first_edition: bool = False
) -> NoteKind | None:
    """The kind of the note that a LOG row is; None for a line of any other sort.

    ``first_edition``: the row comes from a runner of gpsfsm itself, so that a row without data may
    be a note of the first edition. Lines of other runners are never read.

    >>> kind_of("asked m: 2.0 s", {"note": "request", "model": "m"})
    <NoteKind.REQUEST: 'request'>
    >>> kind_of("asked the user", {})
    """
    for kind in NoteKind:
        if data.get("note") == kind:
            return kind
    if data or not first_edition:
        return None
    return next((kind for kind, sentence in _FIRST_EDITION if sentence.match(text)), None)


def requests_in(lines: Iterable[LogLine], *, first_edition: bool) -> int:
    """The number of requests that the lines of an instance note."""
    kinds = [kind_of(line.text, line.data, first_edition=first_edition) for line in lines]
    return kinds.count(NoteKind.REQUEST)
