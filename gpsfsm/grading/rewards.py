r"""Rewards for reinforcement learning: how good a model's answer is, decided and not estimated.

An answer is graded against a task (docs/tasks.md) in a process of its own, so that one that takes
too long can be ended. ``docs/rewards.md`` describes the scale and how trainers load the functions.

>>> task = "interface: GoRunner\nplaces: {A: {x: 1}}\nsteps: [{do: A}]\n"
>>> go = '<Plan><Runner interface="demo/GoRunner" provider="demo/GoRunner" x="{}"/></Plan>'
>>> rewards([go.format(1), go.format(2), "I cannot do that."], task)
[1.0, 0.2, 0.0]
"""

from __future__ import annotations

import atexit
import json
import os
import re
import threading
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from gpsfsm.errors import (
    ConfigError,
    UsageError,
    misused,
    require_amount,
    require_flag,
    require_list,
    require_texts,
    require_whole,
    system_reason,
)
from gpsfsm.progress import counted, refuse_progress
from gpsfsm.tasks.task import Task
from gpsfsm.workers import map_items
from gpsfsm.workers.builtin.processes import Processes
from gpsfsm.workers.pool_worker import available_cores

if TYPE_CHECKING:
    from gpsfsm.checking import CheckOptions
    from gpsfsm.progress import Progress

TaskLike: TypeAlias = "Task | str | os.PathLike[str] | Mapping[str, Any]"
"""A task; the path of a task file; its content, as a text with a line break or a mapping."""

DEFAULT_TIMEOUT_S = 10.0
"""An answer that takes longer gets what an unreadable one gets."""
_MAX_BYTES = 1 << 20
_MAX_ELEMENTS = 5_000
_UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """The scale of rewards.

    - ``success``: the answer is a plan that fulfils the task in every scenario.
    - ``mended``: it would be if its syntax errors were fixed.
    - ``readable``: it is a plan, but does not fulfil the task.
    - ``nothing``: everything else: no plan, an unreadable plan that does not fulfil the task
      either, a plan that does nothing, the example of the prompt, and an answer that could not be
      decided in time.
    - ``shaped``: with shaping, a readable plan gets this much in addition, divided by one more than
      the number of its errors and warnings.
    """

    success: float = 1.0
    mended: float = 0.6
    readable: float = 0.2
    nothing: float = 0.0
    shaped: float = 0.3


@dataclass(frozen=True, slots=True)
class Reward:
    """The reward of an answer, with its grade (docs/tasks.md) and a reason in one line."""

    value: float
    grade: str
    reason: str

    def to_dict(self) -> dict[str, Any]:
        """The reward as data."""
        return {"value": self.value, "grade": self.grade, "reason": self.reason}


@dataclass(frozen=True, slots=True)
class _Work:
    """The work on an answer; never raises for anything that is in it."""

    options: CheckOptions
    scale: Scale
    shaping: bool

    def __call__(self, item: tuple[Task, str]) -> Reward:
        task, text = item
        try:
            return self._graded(task, text)
        except UsageError:
            raise
        except Exception as error:  # a defect of gpsfsm must not end a training
            reason = f"could not be graded: {type(error).__name__}"
            return Reward(self.scale.nothing, _UNDECIDED, reason)

    def _graded(self, task: Task, text: str) -> Reward:
        from gpsfsm.grading.grader import Grade, Grader, graded_options

        graded = Grader(task, graded_options(self.options)).grade(text, "<answer>")
        scale = self.scale
        value = scale.nothing
        if graded.grade is Grade.SUCCESS:
            value = scale.success
        elif graded.grade is Grade.PARTIAL and graded.theory:
            value = scale.mended
        elif graded.grade is Grade.PARTIAL:
            more = scale.shaped / (1 + self._faults(task, text)) if self.shaping else 0.0
            value = scale.readable + more
        return Reward(value, graded.grade.value, graded.reason)

    def _faults(self, task: Task, text: str) -> int:
        """The errors and warnings; comments in the answer excuse none of them."""
        from dataclasses import replace

        from gpsfsm.checking import check_text
        from gpsfsm.model.finding import Severity

        options = replace(self.options, task=task, from_response=True)
        report = check_text(text, "<answer>", options)
        excused = (one for one in report.suppressed if one.suppressed_by == "comment")
        findings = (*report.findings, *excused)
        return sum(one.severity in (Severity.ERROR, Severity.WARNING) for one in findings)


class _Kept(Processes):
    """Worker processes that outlive a batch, unless it went wrong."""

    def __exit__(self, *error: object) -> None:
        if error and error[0] is not None:
            self.end()

    def end(self) -> None:
        """End all of them."""
        super().__exit__()


@dataclass(slots=True)
class Rewards:
    """Computes rewards with its own settings; it can be used by several threads and after a fork.

    ``options`` sets how plans are checked (default: as usual, for answers of up to 1 MiB and 5,000
    elements), ``jobs`` the number of processes (0: one per core), ``timeout_s`` the seconds for
    each answer. Use it in a ``with`` statement or call ``close``: the processes stay until then.

    Raises UsageError for invalid settings.
    """

    options: CheckOptions | None = None
    scale: Scale = field(default_factory=Scale)
    shaping: bool = False
    jobs: int = 1
    timeout_s: float = DEFAULT_TIMEOUT_S
    _engine: _Kept | None = field(default=None, init=False, repr=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False, repr=False)
    _pid: int = field(default=-1, init=False, repr=False)

    def __post_init__(self) -> None:
        """Refuse senseless values, and options on which nothing would depend without shaping."""
        scale: object = self.scale
        if not isinstance(scale, Scale):
            raise misused("Rewards", "a gpsfsm.Scale as scale", scale)
        require_flag("Rewards", "shaping", self.shaping)
        require_whole("Rewards", "jobs", self.jobs, least=0)
        require_amount("Rewards", "timeout_s", self.timeout_s)
        if self.options is not None and not self.shaping:
            from gpsfsm.grading.grader import refuse_idle_options

            refuse_idle_options(self.options)

    def __enter__(self) -> Rewards:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def batch(
        self,
        answers: Sequence[object],
        tasks: TaskLike | Sequence[TaskLike],
        *,
        progress: Progress | None = None,
    ) -> list[Reward]:
        """The reward of each answer for its task, or for the one task that all have.

        ``progress``: as for ``gpsfsm.check``.

        Never raises for anything that is in an answer. Raises UsageError, or ConfigError, a kind of
        it, for tasks that make no sense and if there are not as many as answers.
        """
        value: object = answers  # of a trainer, who may hand over an array
        one = isinstance(value, str | bytes | Mapping)
        if one or not (isinstance(value, Iterable) and hasattr(value, "__len__")):
            hint = "reward(answer, task) takes one" if one else ""
            raise misused("rewards", "a list of answers", value, hint)
        refuse_progress(progress)
        wanted = _tasks_of(tasks, len(answers))
        texts = [answer if isinstance(answer, str) else "" for answer in answers]
        self._renew()
        with self._lock:
            if self._engine is None:
                size = self.jobs or available_cores()
                self._engine = _Kept(size, timeout_s=self.timeout_s)
            work = _Work(self._checks(), self.scale, self.shaping)
            items = zip(wanted, texts, strict=True)
            grades = map_items(self._engine, work, items, lost=self._lost)
            return list(counted(grades, len(texts), progress, "grading"))

    def close(self) -> None:
        """End the processes. The next batch starts new ones."""
        if self._engine is not None and self._pid == os.getpid():
            self._engine.end()
        self._engine = None

    def _renew(self) -> None:
        """After a fork the processes belong to the parent."""
        if self._pid != os.getpid():
            self._engine, self._lock, self._pid = None, threading.Lock(), os.getpid()

    def _checks(self) -> CheckOptions:
        if self.options is not None:
            return self.options
        from gpsfsm.checking import CheckOptions
        from gpsfsm.syntax import Limits

        return CheckOptions(limits=Limits(max_bytes=_MAX_BYTES, max_elements=_MAX_ELEMENTS))

    def _lost(self, _item: tuple[Task, str], how: str) -> Reward:
        return Reward(self.scale.nothing, _UNDECIDED, f"the process that graded it {how}")


def reward(answer: object, task: TaskLike, *, shaping: bool = False) -> float:
    """Return the reward of one answer, from 0 (no plan) to 1 (success); see ``Scale``.

    Raises UsageError for an invalid task. No answer raises.
    """
    require_flag("reward", "shaping", shaping)
    return _default(shaping).batch([answer], task)[0].value


def rewards(
    answers: Sequence[object],
    tasks: TaskLike | Sequence[TaskLike],
    *,
    shaping: bool = False,
    progress: Progress | None = None,
) -> list[float]:
    """Return the rewards of many answers, each from 0 (no plan) to 1 (success).

    ``tasks`` is one task for all answers or a list with one task for each. ``progress``: as for
    ``check``.

    Raises UsageError, or its subclass ConfigError, for invalid tasks. No answer raises.
    """
    require_flag("rewards", "shaping", shaping)
    graded = _default(shaping).batch(answers, tasks, progress=progress)
    return [each.value for each in graded]


def verl_compute_score(
    data_source: str,
    solution_str: str,
    ground_truth: TaskLike,
    extra_info: object = None,
    *,
    shaping: bool = False,
    **_: object,
) -> float:
    """Compute a reward for verl; ``ground_truth`` of a row is the task.

    ``shaping`` comes from ``reward_kwargs``; other arguments from verl are ignored. The result is a
    number, not a mapping, because verl's manager ``prime`` and its ``main_eval`` accept only
    numbers. Raises UsageError for an invalid task.
    """
    del data_source, extra_info  # verl passes them by name
    return reward(solution_str, ground_truth, shaping=shaping)


def verl_compute_scores(
    data_sources: Sequence[str],
    solution_strs: Sequence[str],
    ground_truths: Sequence[TaskLike],
    extra_infos: object = None,
    *,
    shaping: bool = False,
    **_: object,
) -> list[float]:
    """``verl_compute_score`` for all rows at once, as verl's manager ``batch`` requires."""
    del data_sources, extra_infos  # verl passes them by name
    require_list("verl_compute_scores", "ground_truths", _listed(ground_truths))
    return rewards(solution_strs, list(ground_truths), shaping=shaping)


def openrlhf_reward_func(
    queries: Sequence[str],
    prompts: Sequence[str],
    labels: Sequence[TaskLike],
    **_: object,
) -> dict[str, Any]:
    """Compute rewards for OpenRLHF; the label of a prompt is its task.

    The rewards are tensors if torch is installed, otherwise lists. ``extra_logs`` says which
    answers are a success.

    Prompts that were tokenized and decoded again are still recognised if their spaces or Unicode
    forms differ, or if their beginning is missing. Raises UsageError if a query does not contain
    its prompt, because text that is not part of the answer could then be graded.
    """
    for name, value in (("queries", queries), ("prompts", prompts), ("labels", labels)):
        require_list("openrlhf_reward_func", name, _listed(value))
    for name, texts in (("queries", queries), ("prompts", prompts)):
        require_texts("openrlhf_reward_func", name, _listed(texts))
    if not len(queries) == len(prompts) == len(labels):
        numbers = f"{len(queries)} queries, {len(prompts)} prompts and {len(labels)} labels"
        raise UsageError(f"each query needs a prompt and a label, but there are {numbers}")
    answers = []
    for place, (query, prompt) in enumerate(zip(queries, prompts, strict=True)):
        answer = answer_in(query, prompt)
        if answer is None:
            raise UsageError(f"query {place} does not hold its prompt, so its answer is not known")
        answers.append(answer)
    graded = _default(False).batch(answers, list(labels))
    values = _tensor([each.value for each in graded])
    successes = _tensor([float(each.grade == "success") for each in graded])
    return {"rewards": values, "scores": values, "extra_logs": {"success": successes}}


def _listed(values: Any) -> Any:
    """An array of a trainer as a list, anything else as it is."""
    return values.tolist() if callable(getattr(values, "tolist", None)) else values


def _tensor(values: list[float]) -> Any:
    try:
        import torch
    except ImportError:
        return values
    return torch.tensor(values, dtype=torch.float)


@cache
def _default(shaping: bool) -> Rewards:
    made = Rewards(shaping=shaping)
    atexit.register(made.close)
    return made


def _tasks_of(tasks: TaskLike | Sequence[TaskLike], answers: int) -> list[Task]:
    if isinstance(tasks, Mapping) or not isinstance(tasks, Sequence) or isinstance(tasks, str):
        return [task_of(tasks)] * answers
    if len(tasks) != answers:
        raise UsageError(f"there are {answers} answers, but {len(tasks)} tasks")
    return [task_of(task) for task in tasks]


def task_of(task: object) -> Task:
    """The task that is meant. Raises UsageError."""
    if isinstance(task, Task):
        return task
    if isinstance(task, Mapping):
        try:
            return _read(json.dumps(_plain(task)))
        except (TypeError, ValueError, RecursionError) as error:
            raise UsageError(f"the task is a mapping, but not a valid task: {error}") from error
    if not isinstance(task, str | os.PathLike):
        forms = "the path of a task file, its content, or a Task"
        raise UsageError(f"a task is {forms}, not {type(task).__name__}")
    text = os.fspath(task)
    if not text:
        raise UsageError("a task is empty: does the data have a column of tasks, and is it named?")
    if "\n" in text or text.lstrip().startswith("{"):
        return _read(text)
    try:
        changed = Path(text).stat().st_mtime_ns
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"the task file {text[:200]!r} cannot be read: {system_reason(error)}"
        ) from error
    return _load(text, changed)


def _plain(value: Any) -> Any:
    """A value as JSON has it: rows of Parquet files have arrays, and None for absent fields."""
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items() if each is not None}
    if callable(getattr(value, "tolist", None)):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value


@lru_cache(maxsize=4_096)
def _read(content: str) -> Task:
    from gpsfsm.tasks.load import read_task

    return read_task(content.encode("utf-8", "surrogatepass"))


@lru_cache(maxsize=4_096)
def _load(file: str, _changed: int) -> Task:
    from gpsfsm.tasks.load import load_task

    return load_task(file)


# The answer in a query. Some trainers hand over a prompt and what a model answered in one text, put
# together from tokens, so the prompt in a query may differ from the prompt: tokenizers change
# spaces and Unicode forms, trainers cut off the front of what is too long. What must not happen is
# that a piece of the prompt passes for the answer: it may hold an example.

_SPECIAL = re.compile(
    r"(?:<[|\uff5c][^<>|\uff5c]{1,40}[|\uff5c]>|</s>|<eos>|<pad>|<end_of_turn>)\Z"
)
"""What tokenizers put behind an answer."""
_LONGEST_SPECIAL = 44
_LEAST_TAIL = 32
"""What is shorter could stand at the front of a query by chance."""


def answer_in(query: str, prompt: str) -> str | None:
    """The text after the prompt, without the tokens that end an answer; None: it is not there."""
    begin = query.find(prompt)
    end = begin + len(prompt) if begin >= 0 else _end_of_letters(query, prompt)
    if end is None:
        return None
    answer = query[end:].rstrip()
    while special := _SPECIAL.search(answer, max(0, len(answer) - _LONGEST_SPECIAL)):
        answer = answer[: special.start()].rstrip()
    return answer


def _end_of_letters(query: str, prompt: str) -> int | None:
    """The end of the prompt in the query if only its letters are compared, or its last letters."""
    letters = _letters(query)
    there, wanted = "".join(letters), "".join(_letters(prompt))
    begin = there.find(wanted)
    end = begin + len(wanted) if begin >= 0 else _tail(wanted, there)
    if end is None:
        return None
    lengths = accumulate(map(len, letters), initial=0)
    return next(place for place, length in enumerate(lengths) if length >= end)


def _letters(text: str) -> list[str]:
    """For each character what is left of it without spaces and ligatures, accents by themselves."""
    return ["".join(unicodedata.normalize("NFKD", char).split()) for char in text]


def _tail(wanted: str, there: str) -> int | None:
    """The length of the end of ``wanted`` that is the front of ``there``: the most possible.

    Less would leave a piece of the prompt in front of the answer.
    """
    last = re.compile(f"(?={re.escape(wanted[-_LEAST_TAIL:])})")
    ends = (match.start() + _LEAST_TAIL for match in last.finditer(there[: len(wanted)]))
    return max((end for end in ends if wanted.endswith(there[:end])), default=None)
