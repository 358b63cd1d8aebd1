"""Attempts in a journal: how they are written and read again, and in words.

A session is a row ASKED, a row ATTEMPT for each answer, and a row GENERATED with what came of it; a
session without the last one was interrupted, and can go on. The data of the rows are flat. In words
there is a line for each attempt (``attempt_line``) and one for the end (``result_line``).
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

from gpsfsm.errors import InputError, UsageError
from gpsfsm.execution.queue_rows import QueueKind, QueueRow
from gpsfsm.generation.language_model import Answer, Constraint, Finish, Usage
from gpsfsm.generation.loop import Attempt, Judgement
from gpsfsm.model.printable import clip, printable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from gpsfsm.execution.journal_rows import LogLine
    from gpsfsm.execution.queue_rows import QueueLog
    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import Logger
    from gpsfsm.generation.loop import Generated


_MAX_TASK = 200


@dataclass(frozen=True, slots=True)
class Session:
    """A request for plans: the task, the model, the prompt.

    ``template`` and ``template_sha256`` say with which text, ``prompt_sha256`` is the hash of all
    messages, ``library_sha256`` that of the capabilities. ``why`` is empty for a task of a person,
    else the reason for which a running plan needs another one.
    """

    task: str
    model: str
    template: str
    template_sha256: str
    prompt_sha256: str
    library_sha256: str = ""
    seed: int = 0
    rounds: int = 1
    candidates: int = 1
    why: str = ""


@dataclass(slots=True)
class KeptSession:
    """A session in a journal.

    ``result`` is the data of GENERATED, None if the session was interrupted; ``reason`` tells why
    no plan was accepted.
    """

    plan: int
    session: Session
    attempts: list[Attempt] = field(default_factory=list)
    result: Mapping[str, RunValue] | None = None
    reason: str = ""

    @property
    def accepted(self) -> bool:
        """True if it has led to a plan."""
        return self.result is not None and self.result.get("accepted") is True


@dataclass(frozen=True, slots=True)
class Keeper:
    """Writes one session. ``plan`` is the plan that gave up, 0 if a person asked."""

    log: QueueLog
    plan: int = 0
    now_us: Callable[[], int] = lambda: 0

    def session(self, session: Session) -> None:
        """A session begins."""
        self._write(QueueKind.ASKED, session_data(session))

    def attempt(self, attempt: Attempt) -> None:
        """An answer has come, or none could be had."""
        self._write(QueueKind.ATTEMPT, attempt_data(attempt))

    def generated(self, generated: Generated) -> None:
        """The session is over."""
        data: dict[str, RunValue] = {"accepted": generated.accepted}
        if generated.best is not None:
            data |= {"round": generated.best.round, "candidate": generated.best.candidate}
        if generated.plan:
            text = generated.plan.encode("utf-8", "surrogatepass")
            data["sha256"] = hashlib.sha256(text).hexdigest()
        self._write(QueueKind.GENERATED, data, generated.reason)

    def _write(self, kind: QueueKind, data: Mapping[str, RunValue], message: str = "") -> None:
        row = QueueRow(kind, self.plan, data=data, message=message)
        self.log.write_queue(self.now_us(), row)


def sessions(rows: Iterable[QueueRow]) -> list[KeptSession]:
    """The sessions among the rows of a journal, in order.

    Raises InputError for rows that no gpsfsm has written.
    """
    kept: list[KeptSession] = []
    for row in rows:
        data = row.data or {}
        if row.kind is QueueKind.ASKED:
            kept.append(KeptSession(row.plan, session_of(data)))
        elif row.kind in (QueueKind.ATTEMPT, QueueKind.GENERATED):
            if not kept or kept[-1].result is not None or kept[-1].plan != row.plan:
                if row.kind is QueueKind.GENERATED and data.get("accepted") is False and row.plan:
                    continue  # nobody was asked: the bounds of a queue did not allow it
                raise InputError(f"a row {row.kind} belongs to no session")
            if row.kind is QueueKind.ATTEMPT:
                kept[-1].attempts.append(attempt_of(data))
            else:
                kept[-1].result, kept[-1].reason = data, row.message
    return kept


def session_data(session: Session) -> dict[str, RunValue]:
    """As a journal keeps it."""
    return {name: getattr(session, name) for name in Session.__slots__}


def session_of(data: Mapping[str, RunValue]) -> Session:
    """As it was kept; raises InputError for data that is none."""
    return Session(
        task=_typed(data, "task"),
        model=_typed(data, "model"),
        template=_typed(data, "template"),
        template_sha256=_typed(data, "template_sha256"),
        prompt_sha256=_typed(data, "prompt_sha256"),
        library_sha256=_typed(data, "library_sha256"),
        seed=_whole(data, "seed"),
        rounds=_whole(data, "rounds"),
        candidates=_whole(data, "candidates"),
        why=_typed(data, "why"),
    )


def attempt_data(attempt: Attempt) -> dict[str, RunValue]:
    """As a journal keeps it; what is not there is left out."""
    data: dict[str, RunValue | None] = {
        "round": attempt.round,
        "candidate": attempt.candidate,
        "asked": attempt.message,
        "problem": attempt.problem or None,
        "note": attempt.note or None,
    }
    if (answer := attempt.answer) is not None:
        data |= {
            "answer": answer.text,
            "model": answer.model,
            "finish": answer.finish.value,
            "prompt_tokens": answer.usage.prompt_tokens,
            "answer_tokens": answer.usage.answer_tokens,
            "estimated": answer.usage.estimated or None,
            "latency_s": answer.latency_s,
            "constrained": answer.constrained and answer.constrained.value,
            "raw": answer.raw if answer.raw != answer.text and answer.raw else None,
            "requests": answer.requests,
            "cost": answer.cost,
        }
    if (judged := attempt.judgement) is not None:
        data |= {
            "accepted": judged.accepted,
            "plan": judged.plan,
            "told": judged.feedback,
            "errors": judged.errors,
            "warnings": judged.warnings,
            "decided": judged.decided,
            "repairs": list(judged.repairs),
            "findings": [[code, message] for code, message in judged.findings],
        }
    return {name: value for name, value in data.items() if value is not None}


def attempt_of(data: Mapping[str, RunValue]) -> Attempt:
    """As it was kept; raises InputError for data that is none."""
    return Attempt(
        _whole(data, "round"),
        _whole(data, "candidate"),
        _typed(data, "asked"),
        answer=_answer(data) if "answer" in data else None,
        judgement=_judgement(data) if "accepted" in data else None,
        problem=_typed(data, "problem", ""),
        note=_typed(data, "note", ""),
    )


def _answer(data: Mapping[str, RunValue]) -> Answer:
    constrained, cost = _typed(data, "constrained", ""), data.get("cost")
    latency_s = data.get("latency_s", 0.0)
    if not isinstance(latency_s, int | float) or not isinstance(cost, int | float | None):
        raise _damaged("latency_s or cost")
    if not 0 <= latency_s < float("inf"):  # NaN is not, either
        raise _damaged("latency_s")
    try:
        return Answer(
            _typed(data, "answer"),
            _typed(data, "model"),
            Finish(_typed(data, "finish")),
            Usage(
                _whole(data, "prompt_tokens") if "prompt_tokens" in data else None,
                _whole(data, "answer_tokens") if "answer_tokens" in data else None,
                estimated=data.get("estimated") is True,
            ),
            float(latency_s),
            Constraint(constrained) if constrained else None,
            _typed(data, "raw", ""),
            _whole(data, "requests"),
            None if cost is None else float(cost),
        )
    except ValueError as error:
        raise _damaged(str(error)) from error


def _judgement(data: Mapping[str, RunValue]) -> Judgement:
    return Judgement(
        accepted=data["accepted"] is True,
        plan=_typed(data, "plan"),
        feedback=_typed(data, "told"),
        errors=_whole(data, "errors"),
        warnings=_whole(data, "warnings"),
        decided=data.get("decided") is True,
        repairs=tuple(map(str, _list(data, "repairs"))),
        findings=tuple(_pair(each) for each in _list(data, "findings")),
    )


def _typed(data: Mapping[str, RunValue], name: str, default: str | None = None) -> str:
    value = data.get(name, default)
    if not isinstance(value, str):
        raise _damaged(name)
    return value


def _whole(data: Mapping[str, RunValue], name: str) -> int:
    value = data.get(name)
    if isinstance(value, bool) or not isinstance(value, int):
        raise _damaged(name)
    return value


def _list(data: Mapping[str, RunValue], name: str) -> list[RunValue]:
    value = data.get(name, [])
    if not isinstance(value, list):
        raise _damaged(name)
    return value


def _pair(value: RunValue) -> tuple[str, str]:
    if not isinstance(value, list) or len(value) != 2:
        raise _damaged("findings")
    return str(value[0]), str(value[1])


def _damaged(what: str) -> InputError:
    return InputError(f"this is not an attempt that gpsfsm recorded: '{what}' does not fit")


def attempt_line(attempt: Attempt, *, candidates: int = 1) -> str:
    """The outcome of an attempt, in one line."""
    number = f"attempt {attempt.round}"
    if candidates > 1:
        number += f", candidate {attempt.candidate}"
    parts = [f"{number}: {_verdict(attempt)}"]
    if (judged := attempt.judgement) is not None and judged.repairs:
        parts.append(f"mended: {', '.join(judged.repairs)}")
    if attempt.note:
        parts.append(attempt.note)
    if (answer := attempt.answer) is not None:
        parts.append(f"{answer.latency_s:.1f} s")
        if answer.usage.answer_tokens is not None:
            about = "about " if answer.usage.estimated else ""
            parts.append(f"{about}{answer.usage.answer_tokens:,} tokens")
        if answer.cost is not None:
            parts.append(f"cost {answer.cost:.4f}")
        if answer.constrained is not None:
            parts.append(f"constrained by {answer.constrained.value}")
    return clip("; ".join(parts), 2000)


def _verdict(attempt: Attempt) -> str:
    if attempt.problem or attempt.judgement is None:
        return attempt.problem or "no answer"
    judged = attempt.judgement
    if judged.accepted:
        return "accepted" + (f" with {_count(judged.warnings, 'warning')}" * (judged.warnings > 0))
    if not judged.plan:
        return "rejected, there is no plan in the answer"
    if not judged.decided:
        return "rejected, it could not be checked"
    number, kind = (judged.errors, "error") if judged.errors else (judged.warnings, "warning")
    codes = ", ".join(dict.fromkeys(code for code, _ in judged.findings[:number]))
    return f"rejected, {_count(number, kind)} ({codes})"


def result_line(result: Generated) -> str:
    """The end of a session, in one line."""
    answers = [each.answer for each in result.attempts if each.answer is not None]
    read = sum(each.usage.prompt_tokens or 0 for each in answers)
    written = sum(each.usage.answer_tokens or 0 for each in answers)
    costs = [each.cost for each in answers if each.cost is not None]
    parts = [_count(len(answers), "answer")]
    if read or written:
        parts.append(f"{read:,} tokens read and {written:,} written")
    if costs:
        parts.append(f"cost {sum(costs):.4f}")
    ending = "accepted" if result.accepted else f"no plan: {clip(result.reason, 2000)}"
    return f"{ending} ({', '.join(parts)})"


def sessions_text(chosen: Iterable[tuple[int, KeptSession]]) -> Iterator[str]:
    """The lines of sessions and their attempts; each session with its number."""
    for place, (number, kept) in enumerate(chosen):
        if place:
            yield "\n"
        task = clip(" ".join(kept.session.task.split()), _MAX_TASK)
        yield f"session {number}: {clip(kept.session.model, _MAX_TASK)}: {task}\n"
        if kept.plan:
            yield f"  because of plan {kept.plan}: {clip(kept.session.why, _MAX_TASK)}\n"
        for attempt in kept.attempts:
            yield f"  {attempt_line(attempt, candidates=kept.session.candidates)}\n"
        yield f"  {_ended(kept)}\n"


def _ended(kept: KeptSession) -> str:
    if kept.result is None:
        return "interrupted"
    return "a plan was accepted" if kept.accepted else f"no plan: {clip(kept.reason, 2000)}"


def attempt_text(kept: KeptSession, number: int) -> Iterator[str]:
    """One attempt: what was asked, what came, what was said about it.

    Raises UsageError if the session has no attempt with this number.
    """
    if number > len(kept.attempts):
        many = "1 attempt" if len(kept.attempts) == 1 else f"{len(kept.attempts)} attempts"
        raise UsageError(f"there is no attempt {number}; the session has {many}")
    attempt = kept.attempts[number - 1]
    yield f"{attempt_line(attempt, candidates=kept.session.candidates)}\n"
    for title, text in _parts(attempt):
        yield f"\n== {title}\n"
        yield from (f"{printable(line.expandtabs(4))}\n" for line in text.strip().splitlines())


def _parts(attempt: Attempt) -> Iterator[tuple[str, str]]:
    yield "the last message to the model", attempt.message
    if attempt.answer is not None:
        yield "the answer", attempt.answer.text
    if attempt.judgement is not None:
        if attempt.judgement.repairs:
            yield "the repaired plan", attempt.judgement.plan
        yield "the result", attempt.judgement.feedback


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"


# ---- Notes about a language model in the journal of a run: a request, a rejected answer, a plan --
# A note is the data of a LOG row; the text beside it is made from the data once and is for people
# alone. The first edition of gpsfsm wrote the text only: ``kind_of`` reads that too.


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
