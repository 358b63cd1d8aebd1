"""The language model as the runners of a plan have it: asked for words, and for plans.

Every request, rejected answer and accepted plan leaves a note in the journal of the run. In virtual
time (``Answers``) an answer comes once, and then from the journal: the request holds everything up
while it is under way, and then the time that it took passes in the run as well. When the run is
simulated again, nothing that has an outcome is asked for again.
"""

from __future__ import annotations

import asyncio
import re
import threading
from collections import Counter
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import UsageError
from gpsfsm.execution.journal_rows import Ending, LogLine
from gpsfsm.execution.lane import OnLoop
from gpsfsm.execution.records import Kind
from gpsfsm.execution.runner import RunnerError
from gpsfsm.generation.attempt_log import (
    AcceptedNote,
    NoteKind,
    RequestNote,
    answered,
    kind_of,
    rejected,
    write,
)
from gpsfsm.generation.language_model import (
    MAX_ANSWER,
    Answer,
    Finish,
    Message,
    ModelError,
    ModelWrapper,
    Request,
    Role,
    estimated_tokens,
)
from gpsfsm.generation.loop import LoopOptions, generate
from gpsfsm.generation.prompt_builder import PromptOptions, build_prompt
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.capabilities.library import Library
    from gpsfsm.execution.runner import LoadContext, Logger
    from gpsfsm.generation.language_model import Constraint, LanguageModel
    from gpsfsm.generation.loop import Attempt, Judge

MAX_PROMPT = 400_000
"""Characters of a prompt, all fragments together."""
_CONTROLS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff]")


def task_key(task: str) -> str:
    """The key of a task: the words, whatever the white space."""
    return " ".join(task.split())


def model_of(context: LoadContext) -> ModelService:
    """The model that the runners of a run ask. Raises RunnerError without one."""
    service = context.services.get("model")
    if not isinstance(service, ModelService):
        raise RunnerError("there is no language model to ask: name one with --model")
    return service


@dataclass(slots=True)
class ModelService:
    """A model with what it takes to ask it; runners get theirs with ``model_of``.

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

    async def words(self, prompt: str, *, task: str, log: Logger) -> str:
        """The answer of the model to a prompt. Raises RunnerError if it does not."""
        self._check_length(prompt)
        request = Request(
            (Message(Role.USER, prompt),),
            task,
            max_tokens=self.max_tokens,
            temperature=self.temperature,
        )
        try:
            answer = await self._noting(task, log).answer(request)
        except ModelError as error:
            raise RunnerError(str(error)) from None
        if answer.finish is Finish.LENGTH:
            raise RunnerError(
                f"the answer was cut off after {self.max_tokens:,} tokens; allow more with "
                "--max-tokens"
            )
        return _writable(answer.text)

    async def plan(self, task: str, *, question: str, log: Logger, context: str = "") -> str:
        """A plan for a task that the judge accepts. Raises RunnerError if there is none.

        ``context`` stands before the question.
        """
        question = f"{context}\n\n{question}" if context else question
        self._check_length(question)
        options = PromptOptions(
            context_tokens=self.model.context_tokens, answer_tokens=self.max_tokens
        )
        try:
            prompt = build_prompt(task, self.library, options, said=question)
        except UsageError as error:
            raise RunnerError(str(error)) from None
        for remark in prompt.notes:
            log(clip(remark, 1_000), {})
        search = await generate(
            self._noting(task, log),
            Request(prompt.messages, prompt.task),
            self.judge,
            LoopOptions(
                rounds=self.attempts,
                max_tokens=self.max_tokens,
                temperature=self.temperature,
                grammars=self.grammars(prompt.offered),
            ),
            keep=lambda attempt: _note_rejected(attempt, log),
        )
        if not search.accepted:
            raise RunnerError(_why(search.reason, search.best))
        assert search.best is not None
        write(AcceptedNote(search.best.round), log)
        return search.plan

    def _check_length(self, prompt: str) -> None:
        if len(prompt) > MAX_PROMPT:
            raise RunnerError(f"the prompt has more than {MAX_PROMPT:,} characters")
        context = self.model.context_tokens
        if context is not None and (tokens := estimated_tokens(prompt)) + self.max_tokens > context:
            raise RunnerError(
                f"the prompt has about {tokens:,} tokens, and {self.max_tokens:,} are for the "
                f"answer: that is more than the {context:,} that {self.model.name} can read"
            )

    def _noting(self, task: str, log: Logger) -> _Noting:
        return _Noting(self.model, lambda: self.number(task_key(task)), log)


class _Noting(ModelWrapper):
    """A model that notes each request, and numbers the requests of a task."""

    def __init__(self, model: LanguageModel, number: Callable[[], int], log: Logger) -> None:
        super().__init__(model)
        self._number = number
        self._log = log

    async def answer(self, request: Request) -> Answer:
        """Ask. Raises ModelError."""
        try:
            answer = await super().answer(replace(request, number=self._number()))
        except ModelError as error:
            write(RequestNote(self.name, error=clip(str(error), 1_000)), self._log)
            raise
        write(answered(self.name, answer), self._log)
        if len(answer.text) > MAX_ANSWER:
            raise ModelError(
                f"{self.name}: the answer has more than {MAX_ANSWER:,} characters", again=True
            )
        return answer


def _note_rejected(attempt: Attempt, log: Logger) -> None:
    if not attempt.accepted and attempt.answer is not None:  # a request that failed has its note
        write(rejected(attempt), log)


def _why(reason: str, best: Attempt | None) -> str:
    if best is None or best.judgement is None:
        return reason
    return clip(f"{reason}; the best one: {rejected(best).reason}", 900)


def _writable(text: str) -> str:
    """The text without what no journal or terminal should hold: controls, half characters."""
    return _CONTROLS.sub("", text.replace("\r\n", "\n")).strip()


if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine, Mapping

    from gpsfsm.execution.runner import Logger, RunContext
    from gpsfsm.generation.language_model import Answer

    Ask = Callable[[ModelService, Logger], Coroutine[Any, Any, str]]

_LONGEST_S = 86_400.0
_FOR_EVER_S = float("inf")


class AskingInterruptedError(Exception):
    """The user wants no answer any more."""


@dataclass(frozen=True, slots=True)
class Answered:
    """The answer of a model: now (``text``), or as the journal tells (``ending``)."""

    text: str = ""
    ending: Ending | None = None

    @property
    def accepted(self) -> bool:
        """True if the journal tells that a plan was accepted, whatever came of it then."""
        return self.ending is not None and _accepted(self.ending)


@dataclass(frozen=True, slots=True)
class Answers:
    """The service ``answers`` of a simulated run.

    ``past`` is what the journal tells of the instances, by number, ``last_us`` the time of its last
    event. ``wait`` runs a coroutine to its end and raises AskingInterruptedError if it is
    interrupted. Without a ``service`` nobody is asked.
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
                context.log(line.text, line.data)
            if ending.kind == Kind.FAILED and not _accepted(ending):
                error = RunnerError(ending.message)
                error.outputs = ending.outputs
                raise error
            return Answered(ending=ending)
        if ending.kind or self.service is None:  # it was stopped, or its time was over
            await context.sleep(_FOR_EVER_S)
        return await self._ask_model(ask, context, ending, usual_s)

    async def _ask_model(
        self, ask: Ask, context: RunContext, ending: Ending, usual_s: float
    ) -> Answered:
        assert self.service is not None
        timed, lines = _Timed(self.service.model), list[LogLine]()
        text, failure = "", None
        try:
            service = replace(self.service, model=timed)
            text = self.wait(ask(service, lambda *line: lines.append(LogLine(-1, *line))))
        except RunnerError as error:
            failure = error
        except AskingInterruptedError:
            await context.sleep(_FOR_EVER_S)
        journaled = _own(ending)  # of an instance whose lines were journaled, but not the answer
        if journaled:
            await _until(journaled[0].at_us, context)
        else:
            seconds = min(timed.spent_s or usual_s, _LONGEST_S)
            await context.sleep(max(seconds, (self.last_us + 1) / 1e6 - context.now_s, 1e-6))
        for line in (*journaled, *lines[len(journaled) :]):
            context.log(line.text, line.data)
        if failure is not None:
            raise failure
        return Answered(text)


def _own(ending: Ending) -> list[LogLine]:
    """The lines about requests: what follows an accepted plan is about what is done with it."""
    for place, line in enumerate(ending.lines):
        if _is_acceptance(line):
            return ending.lines[: place + 1]
    return ending.lines


def _accepted(ending: Ending) -> bool:
    return any(_is_acceptance(line) for line in ending.lines)


def _is_acceptance(line: LogLine) -> bool:
    return kind_of(line.text, line.data, first_edition=True) is NoteKind.ACCEPTED


async def _until(at_us: int, context: RunContext) -> None:
    await context.sleep(max(at_us / 1e6 - context.now_s, 1e-6))


class _Timed(ModelWrapper):
    """A model that sums up how long its answers took."""

    spent_s = 0.0

    async def answer(self, request: Request) -> Answer:
        """Ask. Raises ModelError."""
        answer = await super().answer(request)
        self.spent_s += max(answer.latency_s, 0.0)
        return answer
