"""The language model as the runners of a plan have it: asked for words, and for plans.

Every request leaves one line that begins with ``asked``, so a journal tells how often a model was
asked; neither the question nor a key is in it.
"""

from __future__ import annotations

import re
import threading
from collections import Counter
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError
from gpsfsm.execution.onloop import OnLoop
from gpsfsm.execution.runner import RunnerError
from gpsfsm.generation.language_model import (
    MAX_ANSWER,
    Answer,
    Finish,
    Message,
    ModelError,
    Request,
    Role,
)
from gpsfsm.generation.loop import LoopOptions, generate
from gpsfsm.generation.passing import PassingOn
from gpsfsm.generation.prompts.builder import PromptOptions, build_prompt
from gpsfsm.generation.prompts.tokens import estimated_tokens
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    import asyncio
    from collections.abc import Callable, Sequence

    from gpsfsm.capabilities.library import Library
    from gpsfsm.generation.language_model import Constraint, LanguageModel
    from gpsfsm.generation.loop import Attempt, Judge

__all__ = ["ACCEPTED", "ASKED", "ModelService", "task_key"]

ASKED = "asked "
"""How the line about a request begins."""
ACCEPTED = "accepted the plan of attempt "
"""And the one about a plan that is good."""

MAX_PROMPT = 400_000
"""Characters of a prompt, all fragments together."""
_MOST_TOLD = 5

_CONTROLS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff]")


def task_key(task: str) -> str:
    """What counts as the same task: the words, whatever the white space."""
    return " ".join(task.split())


@dataclass(slots=True)
class ModelService:
    """A model with what it takes to ask it.

    ``judge`` decides about plans; it may block. ``grammars`` makes those of a prompt from the
    interfaces that it offers. ``attempts`` is how often a plan is asked for at most. ``numbers``
    counts the requests by task (``task_key``) over restarts of the process.
    """

    model: LanguageModel
    library: Library
    judge: Judge
    max_tokens: int = 4096
    temperature: float = 0.0
    attempts: int = 3
    grammars: Callable[[Sequence[str]], tuple[tuple[Constraint, str], ...]] = lambda _offered: ()
    numbers: Counter[str] = field(default_factory=Counter)
    _counting: threading.Lock = field(default_factory=threading.Lock)

    def number(self, task: str) -> int:
        """The number of the next request about a task, which is being sent."""
        with self._counting:
            self.numbers[task] += 1
            return self.numbers[task] - 1

    def on_loop(self, loop: asyncio.AbstractEventLoop) -> ModelService:
        """The same for threads: the model itself is asked on that event loop."""
        return replace(self, model=OnLoop(self.model, loop))

    async def words(self, prompt: str, *, task: str, tell: Callable[[str], None]) -> str:
        """What the model answers to a prompt. Raises RunnerError if it does not."""
        self._check_length(prompt)
        request = Request(
            (Message(Role.USER, prompt),),
            task,
            max_tokens=self.max_tokens,
            temperature=self.temperature,
        )
        try:
            answer = await self._telling(task, tell).answer(request)
        except ModelError as error:
            raise RunnerError(str(error)) from None
        if answer.finish is Finish.LENGTH:
            raise RunnerError(
                f"the answer was cut off after {self.max_tokens:,} tokens; allow more with "
                "--max-tokens"
            )
        return _writable(answer.text)

    async def plan(
        self, task: str, *, said: str, tell: Callable[[str], None], told: str = ""
    ) -> str:
        """A plan for a task that the judge accepts. Raises RunnerError if there is none.

        ``said`` is how the model is asked, ``told`` what it is told before.
        """
        said = f"{told}\n\n{said}" if told else said
        self._check_length(said)
        options = PromptOptions(
            context_tokens=self.model.context_tokens, answer_tokens=self.max_tokens
        )
        try:
            prompt = build_prompt(task, self.library, options, said=said)
        except UsageError as error:
            raise RunnerError(str(error)) from None
        for note in prompt.notes:
            tell(clip(note, 1_000))
        found = await generate(
            self._telling(task, tell),
            Request(prompt.messages, prompt.task),
            self.judge,
            LoopOptions(
                rounds=self.attempts,
                max_tokens=self.max_tokens,
                temperature=self.temperature,
                grammars=self.grammars(prompt.offered),
            ),
            keep=lambda attempt: _tell_rejected(attempt, tell),
        )
        if not found.accepted:
            raise RunnerError(_why(found.reason, found.best))
        assert found.best is not None
        tell(f"{ACCEPTED}{found.best.round}")
        return found.plan

    def _check_length(self, prompt: str) -> None:
        if len(prompt) > MAX_PROMPT:
            raise RunnerError(f"the prompt has more than {MAX_PROMPT:,} characters")
        context = self.model.context_tokens
        if context is not None and (tokens := estimated_tokens(prompt)) + self.max_tokens > context:
            raise RunnerError(
                f"the prompt has about {tokens:,} tokens, and {self.max_tokens:,} are for the "
                f"answer: that is more than the {context:,} that {self.model.name} can read"
            )

    def _telling(self, task: str, tell: Callable[[str], None]) -> _Telling:
        return _Telling(self.model, lambda: self.number(task_key(task)), tell)


class _Telling(PassingOn):
    """A model that tells of each request, and numbers the requests of a task."""

    def __init__(
        self, model: LanguageModel, number: Callable[[], int], tell: Callable[[str], None]
    ) -> None:
        super().__init__(model)
        self._number = number
        self._tell = tell

    async def answer(self, request: Request) -> Answer:
        """Ask. Raises ModelError."""
        try:
            answer = await super().answer(replace(request, number=self._number()))
        except ModelError as error:
            self._tell(f"{ASKED}{self.name}: {clip(str(error), 1_000)}")
            raise
        self._tell(f"{ASKED}{self.name}: {_counted(answer)}")
        if len(answer.text) > MAX_ANSWER:
            raise ModelError(
                f"{self.name}: the answer has more than {MAX_ANSWER:,} characters", again=True
            )
        return answer


def _counted(answer: Answer) -> str:
    usage, parts = answer.usage, []
    about = "about " if usage.estimated else ""
    if usage.prompt_tokens is not None:
        parts.append(f"{about}{usage.prompt_tokens:,} tokens asked")
    if usage.answer_tokens is not None:
        parts.append(f"{about}{usage.answer_tokens:,} tokens answered")
    if answer.cost is not None:
        parts.append(f"cost {answer.cost:.4f}")
    return ", ".join([*parts, f"{answer.latency_s:.1f} s"])


def _tell_rejected(attempt: Attempt, tell: Callable[[str], None]) -> None:
    if attempt.accepted or attempt.answer is None:
        return  # a request that failed has been told of
    tell(clip(f"attempt {attempt.round} was rejected: {_mistakes(attempt)}", 2_000))


def _mistakes(attempt: Attempt) -> str:
    if attempt.problem or attempt.judgement is None:
        return attempt.problem
    judged = attempt.judgement
    worst = judged.findings[: min(judged.errors or _MOST_TOLD, _MOST_TOLD)]  # they come first
    found = [f"{code}: {message}" for code, message in worst]
    return "; ".join(found) or "there is no plan in the answer"


def _why(reason: str, best: Attempt | None) -> str:
    if best is None or best.judgement is None:
        return reason
    return clip(f"{reason}; the best one: {_mistakes(best)}", 900)


def _writable(text: str) -> str:
    """The text without what no journal or terminal should hold: controls, half characters."""
    return _CONTROLS.sub("", text.replace("\r\n", "\n")).strip()
