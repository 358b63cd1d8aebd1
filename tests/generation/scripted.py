"""A model that says what it is told to say, and a judge that knows a few words."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from gpsfsm.generation.language_model import Answer, Finish, ModelError, Request
from gpsfsm.generation.loop import Judgement

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["Scripted", "judge"]


@dataclass
class Scripted:
    """Answers one after the other; an exception is raised, the last one is repeated."""

    answers: Sequence[str | Answer | ModelError]
    name: str = "scripted:test"
    context_tokens: int | None = None
    delays_s: Sequence[float] = ()
    requests: list[Request] = field(default_factory=list)

    async def answer(self, request: Request) -> Answer:
        number = len(self.requests)
        self.requests.append(request)
        if self.delays_s:
            await asyncio.sleep(self.delays_s[min(number, len(self.delays_s) - 1)])
        result = self.answers[min(number, len(self.answers) - 1)]
        if isinstance(result, ModelError):
            raise result
        return result if isinstance(result, Answer) else Answer(result, self.name, Finish.STOP)

    async def close(self) -> None:
        """Nothing to let go of."""


def judge(answer: str) -> Judgement:
    """``good`` is accepted, ``bad N`` has N errors, anything else is no plan."""
    word, _, number = answer.strip().replace("go od", "good").partition(" ")
    if word == "good":
        return Judgement(True, answer.strip(), "fine", warnings=int(number or 0))
    if word == "bad":
        return Judgement(False, answer.strip(), f"{number} wrong", errors=int(number or 1))
    return Judgement(False, "", "there is no plan")
