"""The answers of language models in Python: ``grade`` judges them, ``generate`` asks for them."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.options import DEFAULT_RLIMIT, SolverChoice
from gpsfsm.api import CheckSettings, paths_of
from gpsfsm.capabilities.library import choose_capabilities
from gpsfsm.checking.inputs import find_inputs, is_text
from gpsfsm.errors import (
    ConfigError,
    UsageError,
    misused,
    require_amount,
    require_flag,
    require_list,
    require_whole,
)
from gpsfsm.grading.grade_tables import GradeTable, columns_of
from gpsfsm.grading.grader import Grader, grade_inputs
from gpsfsm.grading.rewards import task_of
from gpsfsm.progress import counted, refuse_progress, ticking

if TYPE_CHECKING:
    from gpsfsm.generation.language_model import LanguageModel
    from gpsfsm.generation.loop import Attempt, Generated
    from gpsfsm.generation.providers import ModelSettings
    from gpsfsm.grading.rewards import TaskLike
    from gpsfsm.progress import Progress
    from gpsfsm.running.search import Search
    from gpsfsm.syntax import Limits


def grade(
    answer: str | bytes | Path | Sequence[str | Path],
    task: TaskLike,
    *,
    labels: str | Path | None = None,
    by: str | None = None,
    jobs: int | str = 1,
    assume: Sequence[str] = (),
    consistent: bool = False,
    faults: Sequence[str] = (),
    solver: SolverChoice = "auto",
    rlimit: int = DEFAULT_RLIMIT,
    limits: Limits | None = None,
    capabilities: Sequence[str | Path] = (),
    builtin_capabilities: bool = True,
    progress: Progress | None = None,
) -> GradeTable:
    r"""Grade answers of language models against a task.

    - ``answer``: a text, the path of a file or folder, or several paths. A ``str`` is a path only
      if such a file exists.
    - ``task``: a ``Task``, the path of a task file, or its content as a text or a mapping.
    - ``labels``: a CSV file with people's grades; ``by``: columns to group by, separated by commas.
    - ``jobs``: the number of worker processes, or a backend, as for ``--jobs``.

    The other options are those of ``check``. Raises UsageError for invalid arguments, and its
    subclass ConfigError for an invalid task. An answer that cannot be read or decided is
    ``undecided``.

    >>> task = "interface: GoRunner\nplaces: {A: {x: 1}}\nsteps: [{do: A}]\n"
    >>> plan = '<Plan><Runner interface="demo/GoRunner" provider="demo/GoRunner" x="1"/></Plan>'
    >>> grade(plan, task).grades[0].grade.value
    'success'
    """
    refuse_progress(progress)
    graded_task, options = task_of(task), CheckSettings.of(locals()).options()
    people = None
    if labels is not None:
        from gpsfsm.grading.labels import load_labels

        people = load_labels(str(labels))
    columns = columns_of(by, people)
    if isinstance(answer, bytes) or (
        isinstance(answer, str) and is_text(answer, from_response=True)
    ):
        one = [Grader(graded_task, options).grade(answer, "<text>")]
        return GradeTable(list(counted(one, 1, progress, "grading")), people, columns)
    inputs = list(find_inputs(paths_of(answer, "grade", "the answer of a model")))
    grades = grade_inputs(inputs, graded_task, options, jobs=jobs)
    return GradeTable(list(counted(grades, len(inputs), progress, "grading")), people, columns)


@dataclass(frozen=True, kw_only=True)
class _Wanted:
    """The arguments of ``generate``."""

    task: str
    model: str | LanguageModel
    attempts: int
    candidates: int
    total_s: float | None
    seed: int | None
    fail_on: str
    mend: bool
    only: Sequence[str]
    world: str | Path | None
    facts: Sequence[str | Path]
    examples: Sequence[str | Path]
    journal: str | Path | None
    base_url: str | None
    temperature: float | None
    max_tokens: int | None
    timeout_s: float | None
    capabilities: Sequence[str | Path]
    builtin_capabilities: bool
    progress: Progress | None

    def __post_init__(self) -> None:
        refuse_progress(self.progress)
        if not isinstance(self.task, str):
            raise misused("generate", "a task in words", self.task)
        if self.fail_on not in ("error", "warning"):
            raise UsageError(f"fail_on must be error or warning, not {str(self.fail_on)[:40]}")
        for name in ("only", "facts", "examples", "capabilities"):
            require_list("generate", name, getattr(self, name))
        for name in ("total_s", "temperature", "timeout_s"):
            if getattr(self, name) is not None:
                require_amount("generate", name, getattr(self, name))
        for name in ("attempts", "candidates", "max_tokens"):
            if getattr(self, name) is not None or name != "max_tokens":
                require_whole("generate", name, getattr(self, name), least=1)
        if self.seed is not None:
            require_whole("generate", "seed", self.seed)
        for name in ("mend", "builtin_capabilities"):
            require_flag("generate", name, getattr(self, name))
        named = isinstance(self.model, str)
        if not named and not (hasattr(self.model, "answer") and hasattr(self.model, "name")):
            raise misused(
                *("generate", "a model", self.model),
                'model="ollama:qwen3:8b" names one, a gpsfsm.LanguageModel is one',
            )

    async def search(self, *, aside: bool = False) -> Generated:
        """Ask until a plan is accepted; ``aside``: answers are checked by another process."""
        from gpsfsm.running.search import keeper_of

        search, done, most = self._search(), 0, self.attempts * self.candidates
        journal = None if self.journal is None else str(self.journal)
        with ExitStack() as stack:
            tick = stack.enter_context(ticking(self.progress, "attempts", most))

            def count(_: Attempt) -> None:
                nonlocal done
                done += 1
                tick(done, most)

            return await search.run(count, keeper_of(journal, stack), aside=aside)

    def _search(self) -> Search:
        from gpsfsm.generation.prompt_builder import build_prompt
        from gpsfsm.running.model_access import budgeted, model_of
        from gpsfsm.running.search import (
            Search,
            SearchOptions,
            prompt_options,
            valid_task,
        )

        task, (settings, _) = valid_task(self.task), budgeted(self._settings())
        chosen = choose_capabilities(self.capabilities, builtin=self.builtin_capabilities)
        if chosen.defects:
            raise ConfigError("\n".join(map(str, chosen.defects)))
        asking = prompt_options(
            settings,
            only=self.only,
            world=None if self.world is None else str(self.world),
            fact_files=[str(each) for each in self.facts],
            example_files=[str(each) for each in self.examples],
        )
        options = SearchOptions(
            attempts=self.attempts,
            candidates=self.candidates,
            total_s=self.total_s,
            seed=self.seed,
            fail_on=self.fail_on,
            mend=self.mend,
            only=tuple(self.only),
        )
        model = model_of(settings) if isinstance(self.model, str) else self.model
        return Search(model, build_prompt(task, chosen.library, asking), chosen, settings, options)

    def _settings(self) -> ModelSettings:
        from gpsfsm.generation.providers import Configured, ModelSettings, settings_of

        flags: dict[str, Any] = {
            "base_url": self.base_url,
            "temperature": self.temperature,
            "max_tokens": self.max_tokens,
            "timeout": self.timeout_s,
        }
        if isinstance(self.model, str):
            return settings_of({"name": self.model, **flags}, configured=Configured())
        chosen = {
            name: value
            for name, value in flags.items()
            if value is not None and name in ("temperature", "max_tokens")
        }
        return ModelSettings(context_tokens=self.model.context_tokens, **chosen)


def generate(
    task: str,
    *,
    model: str | LanguageModel,
    attempts: int = 3,
    candidates: int = 1,
    total_s: float | None = None,
    seed: int | None = None,
    fail_on: str = "error",
    mend: bool = True,
    only: Sequence[str] = (),
    world: str | Path | None = None,
    facts: Sequence[str | Path] = (),
    examples: Sequence[str | Path] = (),
    journal: str | Path | None = None,
    base_url: str | None = None,
    temperature: float | None = None,
    max_tokens: int | None = None,
    timeout_s: float | None = None,
    capabilities: Sequence[str | Path] = (),
    builtin_capabilities: bool = True,
    progress: Progress | None = None,
) -> Generated:
    """Ask a language model for a plan, check the plan, and ask again with the findings.

    - ``task``: what the plan has to do, in words.
    - ``model``: a name such as ``ollama:qwen3:8b``, or a ``LanguageModel``, which is closed
      afterwards.
    - ``attempts``, ``candidates``: the number of rounds at most, and of answers in each round.
    - ``total_s``, ``timeout_s``: time limits in seconds, for everything and for one request.
    - ``fail_on``: the lowest severity that rejects a plan; ``mend``: apply safe fixes to answers.
    - ``only``: patterns of interfaces; no others are offered to the model.
    - ``world``, ``facts``, ``examples``: files that are added to the prompt.
    - ``journal``: the file that stores the attempts; ``progress``: as for ``check``, counting
      attempts.

    Raises UsageError for invalid arguments, InputError for files that cannot be read. If the model
    fails or writes no acceptable plan, nothing is raised: ``reason`` of the result says so.

    >>> generate("go", model="nobody:x")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    gpsfsm.errors.UsageError: there is no provider 'nobody'; write provider:model, such as ...
    """
    wanted = _Wanted(**locals())
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return asyncio.run(wanted.search())
    raise UsageError("an event loop is already running: await gpsfsm.generate_async(...)")


async def generate_async(
    task: str,
    *,
    model: str | LanguageModel,
    attempts: int = 3,
    candidates: int = 1,
    total_s: float | None = None,
    seed: int | None = None,
    fail_on: str = "error",
    mend: bool = True,
    only: Sequence[str] = (),
    world: str | Path | None = None,
    facts: Sequence[str | Path] = (),
    examples: Sequence[str | Path] = (),
    journal: str | Path | None = None,
    base_url: str | None = None,
    temperature: float | None = None,
    max_tokens: int | None = None,
    timeout_s: float | None = None,
    capabilities: Sequence[str | Path] = (),
    builtin_capabilities: bool = True,
    progress: Progress | None = None,
) -> Generated:
    """``generate`` without blocking the event loop; a child process checks the answers."""
    return await _Wanted(**locals()).search(aside=True)
