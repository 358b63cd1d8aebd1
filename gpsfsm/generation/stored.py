"""Attempts and what they were for, as a journal keeps them: flat, of plain values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.errors import InputError
from gpsfsm.generation.language_model import Answer, Constraint, Finish, Usage
from gpsfsm.generation.loop import Attempt, Judgement

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue

__all__ = ["Session", "attempt_data", "attempt_of", "session_data", "session_of"]


@dataclass(frozen=True, slots=True)
class Session:
    """What plans were asked for, and how.

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
    found: dict[str, RunValue | None] = {
        "round": attempt.round,
        "candidate": attempt.candidate,
        "asked": attempt.asked,
        "problem": attempt.problem or None,
        "note": attempt.note or None,
    }
    if (answer := attempt.answer) is not None:
        found |= {
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
        found |= {
            "accepted": judged.accepted,
            "plan": judged.plan,
            "told": judged.told,
            "errors": judged.errors,
            "warnings": judged.warnings,
            "decided": judged.decided,
            "repairs": list(judged.repairs),
            "findings": [[code, message] for code, message in judged.findings],
        }
    return {name: value for name, value in found.items() if value is not None}


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
        told=_typed(data, "told"),
        errors=_whole(data, "errors"),
        warnings=_whole(data, "warnings"),
        decided=data.get("decided") is True,
        repairs=tuple(map(str, _list(data, "repairs"))),
        findings=tuple(_pair(each) for each in _list(data, "findings")),
    )


def _typed(data: Mapping[str, RunValue], name: str, default: str | None = None) -> str:
    found = data.get(name, default)
    if not isinstance(found, str):
        raise _damaged(name)
    return found


def _whole(data: Mapping[str, RunValue], name: str) -> int:
    found = data.get(name)
    if isinstance(found, bool) or not isinstance(found, int):
        raise _damaged(name)
    return found


def _list(data: Mapping[str, RunValue], name: str) -> list[RunValue]:
    found = data.get(name, [])
    if not isinstance(found, list):
        raise _damaged(name)
    return found


def _pair(value: RunValue) -> tuple[str, str]:
    if not isinstance(value, list) or len(value) != 2:
        raise _damaged("findings")
    return str(value[0]), str(value[1])


def _damaged(what: str) -> InputError:
    return InputError(f"this is no attempt that gpsfsm has kept: '{what}' does not fit")
