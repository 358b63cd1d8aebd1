"""Files of recorded answers: JSON lines, one answer each.

Fields are ``answer`` (or ``response``), ``task`` (a text or number), ``prompt_text`` or
``messages`` (what was asked), ``model``, ``finish``, ``latency_s``, ``prompt_tokens``,
``answer_tokens``, ``constrained``; and ``error`` with ``again`` instead of an answer. All but the
answer may be absent, others are there to choose by.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import InputError, UsageError
from gpsfsm.files import read
from gpsfsm.generation.language_model import Constraint, Finish, Usage
from gpsfsm.generation.providers.dialect import at, count
from gpsfsm.model.printable import clip
from gpsfsm.strict_json import DuplicateKeyError, strict_loads

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.generation.language_model import Answer, Request

__all__ = ["Recorded", "load", "normal", "recorded"]

_MAX_BYTES = 256 << 20
_MAX_LINES = 1_000_000
_MAX_SECONDS = 1e9


@dataclass(frozen=True, slots=True)
class Recorded:
    """One recorded answer, or the error that came instead. ``prompt`` is normal(ised) text."""

    answer: str = ""
    tasks: tuple[str, ...] = ()
    prompt: str = ""
    model: str = ""
    finish: Finish = Finish.STOP
    usage: Usage = field(default_factory=Usage)
    latency_s: float = 0.0
    constrained: Constraint | None = None
    error: str = ""
    again: bool = False


def normal(text: str) -> str:
    """A text in which every run of white space is one blank, to compare by."""
    return " ".join(text.split())


def load(source: str) -> tuple[Recorded, ...]:
    """The answers of ``file`` or ``file#field=value,field=value``. Raises UsageError."""
    name, _, chosen = source.partition("#")
    wanted = _wanted(chosen, source)
    content = _content(name)
    found = []
    for number, line in enumerate(content.splitlines(), start=1):
        if not line.strip():
            continue
        if number > _MAX_LINES:
            raise UsageError(f"{name}: has more than {_MAX_LINES} lines")
        where = f"{clip(name, 200)}:{number}"
        record = _parsed(line, where)
        if all(_text(record.get(key)) == value for key, value in wanted.items()):
            found.append(_recorded(record, where))
    if not found:
        raise UsageError(f"{clip(source, 200)}: there is no recorded answer in it")
    return tuple(found)


def recorded(request: Request, answer: Answer) -> str:
    """A line, without its end, from which the answer can be replayed."""
    line = {
        "task": request.task,
        "messages": [{"role": str(each.role), "content": each.text} for each in request.messages],
        "answer": answer.text,
        "model": answer.model,
        "finish": str(answer.finish),
        "latency_s": round(answer.latency_s, 3),
        "prompt_tokens": answer.usage.prompt_tokens,
        "answer_tokens": answer.usage.answer_tokens,
        "estimated": answer.usage.estimated,
        "constrained": None if answer.constrained is None else str(answer.constrained),
    }
    return json.dumps(line, ensure_ascii=True)


def _wanted(chosen: str, source: str) -> Mapping[str, str]:
    found = {}
    for each in chosen.split(",") if chosen else ():
        key, equals, value = each.partition("=")
        if not key or not equals:
            raise UsageError(
                f"'{clip(source, 200)}': after # stand choices such as model=gpt,prompt=zeroshot"
            )
        found[key.strip()] = value.strip()
    return found


def _content(name: str) -> bytes:
    try:
        if not Path(name).is_file():
            raise UsageError(f"{clip(name, 200)}: is no file with recorded answers")
        content = read(name, _MAX_BYTES, pipes=False)
    except (InputError, OSError, ValueError) as error:
        told = str(error) if isinstance(error, InputError) else f"cannot be read: {error}"
        raise UsageError(f"{clip(name, 200)}: {told}") from error
    if len(content) > _MAX_BYTES:
        raise UsageError(f"{clip(name, 200)}: is larger than {_MAX_BYTES} bytes")
    return content


def _parsed(line: bytes, where: str) -> dict[str, Any]:
    try:
        record = strict_loads(line)
    except DuplicateKeyError as error:
        raise UsageError(f"{where}: {error}") from None
    except (ValueError, RecursionError):
        raise UsageError(f"{where}: is not JSON") from None
    if not isinstance(record, dict):
        raise UsageError(f"{where}: is not an object with an answer")
    return record


def _recorded(record: Mapping[str, Any], where: str) -> Recorded:
    error = record.get("error")
    answer = record.get("answer", record.get("response"))
    if not isinstance(error, str) and not isinstance(answer, str):
        raise UsageError(f"{where}: has neither an 'answer' nor an 'error', which are texts")
    return Recorded(
        answer=_writable(answer) if isinstance(answer, str) else "",
        tasks=_tasks(record.get("task")),
        prompt=_prompt(record),
        model=_text(record.get("api_model")) or _text(record.get("model")),
        finish=_one_of(Finish, record.get("finish"), where) or Finish.STOP,
        usage=Usage(
            count(record.get("prompt_tokens")),
            count(record.get("answer_tokens")),
            record.get("estimated") is True,
        ),
        latency_s=_seconds(record.get("latency_s")),
        constrained=_one_of(Constraint, record.get("constrained"), where),
        error=clip(error, 400) if isinstance(error, str) else "",
        again=record.get("again") is True,
    )


def _tasks(task: Any) -> tuple[str, ...]:
    """What a task is called; a number N also ``taskN``."""
    if isinstance(task, int) and not isinstance(task, bool):
        return (str(task), f"task{task}")
    return (normal(task),) if isinstance(task, str) and task.strip() else ()


def _prompt(record: Mapping[str, Any]) -> str:
    """What was asked."""
    turns = record.get("messages")
    if isinstance(turns, list):
        contents = [at(turn, "content") for turn in turns]
        return normal("\n".join(each for each in contents if isinstance(each, str)))
    text = record.get("prompt_text", record.get("prompt"))
    return normal(text) if isinstance(text, str) else ""


def _seconds(value: Any) -> float:
    if not isinstance(value, int | float) or not 0 <= value < _MAX_SECONDS:
        return 0.0
    return float(value)


def _text(value: Any) -> str:
    if isinstance(value, str):
        return _writable(value)
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else ""


def _one_of(kind: Any, value: Any, where: str) -> Any:
    if value is None:
        return None
    try:
        return kind(value)
    except ValueError:
        names = ", ".join(kind)
        raise UsageError(f"{where}: {clip(str(value), 60)!r} is none of {names}") from None


def _writable(text: str) -> str:
    return text.encode("utf-8", "replace").decode("utf-8")
