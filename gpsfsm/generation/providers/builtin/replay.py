"""Recorded answers, a file of JSON lines: no model, no network, always the same.

Fields of a line are ``answer`` (or ``response``), ``task`` (a text or number), ``prompt_text`` or
``messages`` (what was asked), ``model``, ``finish``, ``latency_s``, ``prompt_tokens``,
``answer_tokens``, ``constrained``; and ``error`` with ``again`` instead of an answer. All but the
answer may be absent, others are there to choose by.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import InputError, UsageError, system_reason
from gpsfsm.files import read
from gpsfsm.generation.language_model import Answer, Constraint, Finish, ModelError, Usage, cost_of
from gpsfsm.generation.providers import Provider
from gpsfsm.generation.providers.dialect import at, count, without_thoughts
from gpsfsm.model.printable import clip
from gpsfsm.strict_json import DuplicateKeyError, strict_loads

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.generation.language_model import LanguageModel, Request
    from gpsfsm.generation.providers import ModelSettings, Rendered

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
    records = []
    for number, line in enumerate(content.splitlines(), start=1):
        if not line.strip():
            continue
        if number > _MAX_LINES:
            raise UsageError(f"{name}: has more than {_MAX_LINES} lines")
        where = f"{clip(name, 200)}:{number}"
        record = _parsed(line, where)
        if all(_text(record.get(key)) == value for key, value in wanted.items()):
            records.append(_recorded(record, where))
    if not records:
        raise UsageError(f"{clip(source, 200)}: there is no recorded answer in it")
    return tuple(records)


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
    chosen_by = {}
    for each in chosen.split(",") if chosen else ():
        key, equals, value = each.partition("=")
        if not key or not equals:
            raise UsageError(f"'{clip(source, 200)}': after the #, write choices such as model=gpt")
        chosen_by[key.strip()] = value.strip()
    return chosen_by


def _content(name: str) -> bytes:
    try:
        if not Path(name).is_file():
            raise UsageError(f"{clip(name, 200)}: is not a file with recorded answers")
        content = read(name, _MAX_BYTES, pipes=False)
    except InputError as error:
        raise UsageError(f"{clip(name, 200)}: {error}") from error
    except (OSError, ValueError) as error:
        problem = f"cannot be read: {system_reason(error)}"
        raise UsageError(f"{clip(name, 200)}: {problem}") from error
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
    """The names of a task; a number N also is ``taskN``."""
    if isinstance(task, int) and not isinstance(task, bool):
        return (str(task), f"task{task}")
    return (normal(task),) if isinstance(task, str) and task.strip() else ()


def _prompt(record: Mapping[str, Any]) -> str:
    """The text of the request."""
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


class Replay:
    """Answers from a file, ``answers.jsonl`` or ``answers.jsonl#model=gpt,prompt=zeroshot``.

    Taken is the next of those that were recorded for the same task and prompt; if there are none,
    of those for the same task; if there are none, of those without a task; each in the order of
    the file. Without a task, all count as of the same one. "Next" is the one that
    ``Request.number`` says, if it says. Recorded errors are raised. Raises UsageError for a file
    that cannot be read.
    """

    def __init__(self, source: str, settings: ModelSettings) -> None:
        self._source = source
        self._settings = settings
        self._records = load(source)
        self._served: dict[tuple[int, ...], int] = {}

    @property
    def name(self) -> str:
        """The provider and the file."""
        return f"replay:{clip(self._source, 200)}"

    @property
    def context_tokens(self) -> int | None:
        """As much as the settings say."""
        return self._settings.context_tokens

    async def close(self) -> None:
        """Nothing is open."""

    async def answer(self, request: Request) -> Answer:
        """The recorded answer. Raises ModelError if there is none, or if an error was recorded."""
        fitting = self._fitting(request)
        if not fitting:
            raise ModelError(f"{self.name}: no answer is recorded for this task")
        record = self._records[self._next(fitting, request)]
        if record.error:
            raise ModelError(f"{self.name}: {record.error}", again=record.again)
        text = without_thoughts(record.answer)
        if not text.strip():
            raise ModelError(f"{self.name}: the answer is empty", again=True, empty=True)
        return Answer(
            text=text,
            model=record.model or "replay",
            finish=record.finish,
            usage=record.usage,
            latency_s=record.latency_s,
            constrained=record.constrained,
            raw=record.answer,
            cost=cost_of(record.usage, self._settings),
        )

    def _next(self, fitting: tuple[int, ...], request: Request) -> int:
        """The number of the record to take."""
        number = request.number
        if number is None:
            number = self._served.get(fitting, 0)
            self._served[fitting] = number + 1
        elif self._exact(request, fitting):  # recorded under other numbers, perhaps
            number = min(number, len(fitting) - 1)
        if not 0 <= number < len(fitting):
            raise ModelError(
                f"{self.name}: the recorded answers to this task are used up, all {len(fitting)}"
            )
        return fitting[number]

    def _fitting(self, request: Request) -> tuple[int, ...]:
        """The places of the records to take from."""
        everywhere = tuple(range(len(self._records)))
        task = normal(request.task)
        same = _places(self._records, task) if task else everywhere
        if exact := self._exact(request, same or everywhere) or same:
            return exact
        return tuple(place for place in everywhere if not self._records[place].tasks)

    def _exact(self, request: Request, places: tuple[int, ...]) -> tuple[int, ...]:
        """Those of the records that answer the same prompt."""
        last = normal(request.messages[-1].text) if request.messages else ""
        whole = normal("\n".join(turn.text for turn in request.messages))
        prompts = {last, whole} - {""}
        return tuple(place for place in places if self._records[place].prompt in prompts)


def _places(records: tuple[Recorded, ...], task: str) -> tuple[int, ...]:
    """The records of a task: under its name, or between quotes in the prompt."""
    named = tuple(place for place, each in enumerate(records) if task in each.tasks)
    if named:
        return named
    quoted = f'"{task}"'
    return tuple(place for place, each in enumerate(records) if quoted in each.prompt)


def _make(model: str, settings: ModelSettings, _: Rendered | None) -> LanguageModel:
    return Replay(model, settings)


PROVIDER = Provider("replay", _make)
