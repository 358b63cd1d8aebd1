"""The search for a plan by a language model, from a task in words to what came of it."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.capabilities.library import Capabilities
from gpsfsm.checking import CheckOptions
from gpsfsm.checking.inputs import STDIN, Input, read_bytes
from gpsfsm.errors import InputError, UsageError
from gpsfsm.generation.language_model import Request
from gpsfsm.generation.loop import LoopOptions, generate, plan_key
from gpsfsm.generation.offer import closed
from gpsfsm.generation.prompt_builder import MAX_TASK, PromptOptions, world_facts
from gpsfsm.model.finding import Severity
from gpsfsm.running.answer_judge import JudgeApart, PlanJudge
from gpsfsm.running.model_access import grammars_of, session_for
from gpsfsm.syntax import parse

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from contextlib import ExitStack

    from gpsfsm.generation.attempt_log import Keeper, Session
    from gpsfsm.generation.language_model import LanguageModel
    from gpsfsm.generation.loop import Attempt, Generated
    from gpsfsm.generation.prompt_builder import Prompt
    from gpsfsm.generation.providers import ModelSettings

_MAX_BYTES = 1 << 20
_FOLLOW_UP_PART = 4
"""The part of a context that is for showing an answer again, with its findings."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchOptions:
    """The time of a search, and what is good enough (``gpsfsm generate``)."""

    attempts: int = 3
    candidates: int = 1
    total_s: float | None = None
    seed: int | None = None
    fail_on: str = Severity.ERROR.value
    mend: bool = True
    only: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Search:
    """All that the loop is made of."""

    model: LanguageModel
    prompt: Prompt
    capabilities: Capabilities
    settings: ModelSettings
    options: SearchOptions

    @property
    def session(self) -> Session:
        """The data that are written down before the model is asked."""
        return session_for(
            self.prompt,
            self.model,
            seed=self.options.seed,
            rounds=self.options.attempts,
            candidates=self.options.candidates,
            capabilities=self.capabilities,
        )

    async def run(
        self,
        tell: Callable[[Attempt], object],
        keeper: Keeper | None = None,
        *,
        aside: bool = False,
    ) -> Generated:
        """Ask until a plan is accepted, and close the model.

        ``tell`` is told of every attempt, after ``keeper`` has kept it. ``aside``: another process
        judges, for an event loop that has more to do.
        """
        plan_judge = self._judge()
        request = Request(self.prompt.messages, self.prompt.task)

        def keep(attempt: Attempt) -> None:
            if keeper is not None:
                keeper.attempt(attempt)
            tell(attempt)

        try:
            with JudgeApart(plan_judge) if aside else nullcontext(plan_judge) as judge:
                if keeper is not None:
                    keeper.session(self.session)
                generated = await generate(
                    *(self.model, request, judge, self._loop_options()), keep=keep, aside=aside
                )
        finally:
            await self.model.close()
        if keeper is not None:
            keeper.generated(generated)
        return generated

    def _loop_options(self) -> LoopOptions:
        chosen, prompt = self.options, self.prompt
        return LoopOptions(
            rounds=chosen.attempts,
            candidates=chosen.candidates,
            max_tokens=self.settings.max_tokens,
            temperature=self.settings.temperature,
            seed=chosen.seed,
            total_s=chosen.total_s,
            context_tokens=self.settings.context_tokens,
            grammars=grammars_of(self.capabilities, prompt.offered, self.settings),
            seen=tuple((plan_key(text), "this is an example") for text in prompt.examples),
        )

    def _judge(self) -> PlanJudge:
        offered = closed(self.capabilities.library, self.options.only)
        return PlanJudge(
            CheckOptions(capabilities=Capabilities(offered)),
            fail_on=Severity(self.options.fail_on),
            mend=self.options.mend,
        )


def keeper_of(journal: str | None, stack: ExitStack) -> Keeper | None:
    """The keeper of the attempts in the journal with this path. Raises JournalError."""
    if journal is None:
        return None
    from gpsfsm.execution.journal import Journal
    from gpsfsm.generation.attempt_log import Keeper

    return Keeper(stack.enter_context(Journal(journal)))


# -- what is asked -----------------------------------------------------------------------------


def valid_task(task: str | None) -> str:
    """The task without blanks around it. Raises UsageError for none, and for a long one."""
    if task is None or not task.strip():
        raise UsageError("there is no task: describe in quotes what the robot should do")
    if len(task.strip()) > MAX_TASK:  # a run would find out when its plan has given up
        raise UsageError(f"the task is longer than {MAX_TASK:,} characters")
    return task.strip()


def prompt_options(
    model: ModelSettings,
    *,
    only: Sequence[str] = (),
    world: str | None = None,
    fact_files: Sequence[str] = (),
    example_files: Sequence[str] = (),
) -> PromptOptions:
    """The options of a prompt for a model with these settings. Raises InputError for a file."""
    facts = [text_in(file) for file in fact_files]
    if world is not None:
        from gpsfsm.simulation.load import load_world

        facts.insert(0, "\n".join(world_facts(load_world(world))))
    return PromptOptions(
        only=tuple(only),
        context=tuple(facts),
        examples=tuple(_example(file) for file in example_files),
        context_tokens=model.context_tokens,
        answer_tokens=model.max_tokens,
        follow_up_tokens=(model.context_tokens or 0) // _FOLLOW_UP_PART,
    )


def text_in(file: str) -> str:
    """The content of a text file, not empty; ``-`` is standard input. Raises InputError."""
    source = Input(STDIN, stdin=True) if file == "-" else Input(str(Path(file)))
    try:
        content = read_bytes(source, _MAX_BYTES)
        if len(content) > _MAX_BYTES:
            raise InputError(f"is larger than {_MAX_BYTES} bytes")
        text = content.decode("utf-8-sig")
    except InputError as error:
        raise InputError(f"{source.path}: {error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{source.path}: is not UTF-8 text (byte {error.start + 1})") from error
    if not text.strip():
        raise InputError(f"{source.path}: is empty")
    return text


def _example(file: str) -> str:
    """A plan to show; one that cannot be read teaches nothing good."""
    text = text_in(file)
    parsed = parse(text, file=file)
    if parsed.plan is None or parsed.problems:
        first = parsed.problems[0]
        where = f"{file}:{first.location.line}:{first.location.column}"
        raise InputError(f"{where}: this example is not a correct plan: {first.message}")
    return text.strip()
