"""A model that is asked in virtual time: its answers come once, and then from the journal.

The request holds everything up while it is under way; then the time that it took passes in the run
as well. When the run is simulated again, nothing that has an outcome is asked for again.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.endings import Ending
from gpsfsm.execution.records import Kind
from gpsfsm.execution.runner import RunnerError
from gpsfsm.generation.passing import PassingOn
from gpsfsm.generation.service import ACCEPTED, ModelService

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine, Mapping

    from gpsfsm.execution.runner import RunContext
    from gpsfsm.generation.language_model import Answer, Request

    Ask = Callable[[ModelService, Callable[[str], None]], Coroutine[Any, Any, str]]

__all__ = ["Answered", "Answers", "AskingInterrupted"]

_LONGEST_S = 86_400.0
_FOR_EVER_S = float("inf")


class AskingInterrupted(Exception):  # noqa: N818  (nothing is wrong)
    """The user wants no answer any more."""


@dataclass(frozen=True, slots=True)
class Answered:
    """What a model has answered: now (``text``), or as the journal tells (``ending``)."""

    text: str = ""
    ending: Ending | None = None

    @property
    def accepted(self) -> bool:
        """Whether the journal tells that a plan was accepted, whatever came of it then."""
        return self.ending is not None and _accepted(self.ending)


@dataclass(frozen=True, slots=True)
class Answers:
    """The service ``answers`` of a simulated run.

    ``past`` is what the journal tells of the instances, by number, ``last_us`` the time of its last
    event. ``wait`` runs a coroutine to its end and raises AskingInterrupted if it is interrupted.
    Without a ``service`` nobody is asked.
    """

    service: ModelService | None
    past: Mapping[int, Ending] = field(default_factory=dict)
    last_us: int = -1
    wait: Callable[[Coroutine[Any, Any, str]], str] = asyncio.run

    async def answer(self, ask: Ask, context: RunContext, *, usual_s: float) -> Answered:
        """The answer, after the time that it takes: ``usual_s`` if that is not known.

        Raises RunnerError if there is none.
        """
        ending = self.past.get(context.number, Ending())
        if ending.kind in (Kind.SUCCEEDED, Kind.FAILED):
            await _until(ending.at_us, context)
            for line in _own(ending):
                context.log(line)
            if ending.kind == Kind.FAILED and not _accepted(ending):
                error = RunnerError(ending.message)
                error.outputs = ending.outputs
                raise error
            return Answered(ending=ending)
        if ending.kind or self.service is None:  # it was stopped, or its time was over
            await context.sleep(_FOR_EVER_S)
        return await self._asked(ask, context, ending, usual_s)

    async def _asked(
        self, ask: Ask, context: RunContext, ending: Ending, usual_s: float
    ) -> Answered:
        assert self.service is not None
        timed, lines = _Timed(self.service.model), list[str]()
        text, failure = "", None
        try:
            text = self.wait(ask(replace(self.service, model=timed), lines.append))
        except RunnerError as error:
            failure = error
        except AskingInterrupted:
            await context.sleep(_FOR_EVER_S)
        known = _own(ending)  # of lines that were journaled, but not the answer
        if known:
            await _until(ending.lines[0][0], context)
        else:
            seconds = min(timed.spent_s or usual_s, _LONGEST_S)
            await context.sleep(max(seconds, (self.last_us + 1) / 1e6 - context.now_s, 1e-6))
        for line in (*known, *lines[len(known) :]):
            context.log(line)
        if failure is not None:
            raise failure
        return Answered(text)


def _own(ending: Ending) -> list[str]:
    """The lines about requests: what follows an accepted plan is about what is done with it."""
    lines = [line for _, line in ending.lines]
    for place, line in enumerate(lines):
        if line.startswith(ACCEPTED):
            return lines[: place + 1]
    return lines


def _accepted(ending: Ending) -> bool:
    return any(line.startswith(ACCEPTED) for _, line in ending.lines)


async def _until(at_us: int, context: RunContext) -> None:
    await context.sleep(max(at_us / 1e6 - context.now_s, 1e-6))


class _Timed(PassingOn):
    """A model that sums up how long its answers took."""

    spent_s = 0.0

    async def answer(self, request: Request) -> Answer:
        """Ask. Raises ModelError."""
        answer = await super().answer(request)
        self.spent_s += max(answer.latency_s, 0.0)
        return answer
