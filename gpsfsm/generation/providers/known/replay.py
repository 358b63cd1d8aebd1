"""Answers that were recorded: no model, no network, always the same."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.generation.language_model import Answer, ModelError
from gpsfsm.generation.providers.recording import Recorded, load, normal
from gpsfsm.generation.providers.registry import Provider
from gpsfsm.generation.providers.thoughts import without_thoughts
from gpsfsm.generation.providers.tokens import cost_of
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from gpsfsm.generation.language_model import LanguageModel, Request
    from gpsfsm.generation.providers.registry import Rendered
    from gpsfsm.generation.providers.settings import ModelSettings

__all__ = ["PROVIDER", "Replay"]


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
        self._given: dict[tuple[int, ...], int] = {}

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
        found = self._records[self._next(fitting, request)]
        if found.error:
            raise ModelError(f"{self.name}: {found.error}", again=found.again)
        text = without_thoughts(found.answer)
        if not text.strip():
            raise ModelError(f"{self.name}: the answer is empty", again=True, empty=True)
        return Answer(
            text=text,
            model=found.model or "replay",
            finish=found.finish,
            usage=found.usage,
            latency_s=found.latency_s,
            constrained=found.constrained,
            raw=found.answer,
            cost=cost_of(found.usage, self._settings),
        )

    def _next(self, fitting: tuple[int, ...], request: Request) -> int:
        """Which of several records to take."""
        number = request.number
        if number is None:
            number = self._given.get(fitting, 0)
            self._given[fitting] = number + 1
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
        if found := self._exact(request, same or everywhere) or same:
            return found
        return tuple(place for place in everywhere if not self._records[place].tasks)

    def _exact(self, request: Request, places: tuple[int, ...]) -> tuple[int, ...]:
        """Those of the records that answer the same prompt."""
        last = normal(request.messages[-1].text) if request.messages else ""
        whole = normal("\n".join(turn.text for turn in request.messages))
        asked = {last, whole} - {""}
        return tuple(place for place in places if self._records[place].prompt in asked)


def _places(records: tuple[Recorded, ...], task: str) -> tuple[int, ...]:
    """Where a task was recorded: under its name, or between quotes in the prompt."""
    named = tuple(place for place, each in enumerate(records) if task in each.tasks)
    if named:
        return named
    quoted = f'"{task}"'
    return tuple(place for place, each in enumerate(records) if quoted in each.prompt)


def _make(model: str, settings: ModelSettings, _: Rendered | None) -> LanguageModel:
    return Replay(model, settings)


PROVIDER = Provider("replay", _make)
