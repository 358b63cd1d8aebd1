"""Check many plans, in this process, in several, or on a Ray cluster.

Inputs are read here, because standard input and ``/dev/fd/3`` mean nothing in another process, and
files may not be there on another machine.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from gpsfsm.checking import CheckOptions, check_text, failed, unreadable
from gpsfsm.checking.check import TIME_LIMIT_S, too_late
from gpsfsm.checking.includes import includes_of
from gpsfsm.checking.inputs import Input, read_bytes
from gpsfsm.errors import InputError
from gpsfsm.workers import Lost, Settled, engine_of, map_items
from gpsfsm.workers.pool_worker import KeptWorker

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from gpsfsm.model.report import PlanReport
    from gpsfsm.syntax import Limits
    from gpsfsm.syntax.trees import Includes

Text: TypeAlias = tuple[str, bytes]
"""The path of an input and its text."""
CheckItem: TypeAlias = "tuple[str, bytes, Includes | None]"
"""The path of an input, its text, and the files that this includes."""
_Result = TypeVar("_Result")
_HINT = "check it with more memory, or with --jobs 1"


@dataclass(frozen=True, slots=True)
class CheckWork:
    """The work on one plan: its check."""

    options: CheckOptions

    def __call__(self, item: CheckItem) -> PlanReport:
        """Check it."""
        path, text, includes = item
        return check_text(text, path, self.options, includes)


def check_inputs(
    inputs: Sequence[Input],
    options: CheckOptions,
    *,
    jobs: int | str = 1,
    time_limit_s: float | None = None,
) -> Iterator[PlanReport]:
    """Check every input, in order, where ``jobs`` says (docs/scale.md).

    The reports do not depend on ``jobs``. A defect of gpsfsm that one plan brings to light is
    reported for that plan. What is not read or not decided after ``time_limit_s`` is undecided;
    then another process checks, also with one job, since that can be ended. Raises UsageError for
    options that make no sense, and for an engine that is not to be had.
    """
    engine = engine_of(jobs, len(inputs), timeout_s=time_limit_s)
    texts = items_of(inputs, options.limits, within_s=time_limit_s)

    def late(item: CheckItem) -> PlanReport:
        assert time_limit_s is not None
        return too_late(item[0], time_limit_s)

    return map_items(engine, CheckWork(options), texts, lost=_not_checked, late=late)


def limit_of(jobs: int | str, time_limit_s: float | None) -> float | None:
    """The time limit of each plan for ``--jobs``, by default the usual; a cluster can end none."""
    usual_s = None if str(jobs).strip().startswith("ray") else TIME_LIMIT_S
    return usual_s if time_limit_s is None else time_limit_s


def texts_of(
    inputs: Iterable[Input], max_bytes: int, refuse: Callable[[str, str], _Result]
) -> Iterator[Text | Settled[_Result]]:
    """Read one input at a time, as workers ask for them.

    ``refuse`` makes the result for one that cannot be read, from its path and the reason.
    """
    for item in inputs:
        try:
            yield item.path, read_bytes(item, max_bytes)
        except InputError as error:
            yield Settled(refuse(item.path, str(error)))


def items_of(
    inputs: Iterable[Input], limits: Limits, *, within_s: float | None = None
) -> Iterator[CheckItem | Settled[PlanReport]]:
    """The texts of inputs, and the files that they include. ``within_s``: as for ``files.read``."""
    for item in inputs:
        try:
            text = read_bytes(item, limits.max_bytes, within_s=within_s)
        except InputError as error:
            yield Settled(unreadable(item.path, str(error)))
        else:
            yield item.path, text, includes_of(item, text, limits)


def _not_checked(item: CheckItem, how: str) -> PlanReport:
    return failed(item[0], f"the process that checked this plan {how}", hint=_HINT)


class CheckApart:
    """Checks plans in a process of its own, one at a time; use it in a ``with`` statement.

    Unlike a thread, a process can be ended when a check takes too long, and shares no z3 with the
    threads of this one. It begins with the first plan.
    """

    def __init__(self, timeout_s: float = 100.0) -> None:
        self._timeout_s = timeout_s
        self._kept: KeptWorker[CheckItem, PlanReport] | None = None

    def __enter__(self) -> CheckApart:
        return self

    def __exit__(self, *_: object) -> None:
        if self._kept is not None:  # whoever waits for it in another thread is told that it is lost
            self._kept.end()

    def check(self, text: bytes, path: str, options: CheckOptions) -> PlanReport:
        """Check a plan, always with the same options. Raises UsageError for senseless ones."""
        if self._kept is None:
            self._kept = KeptWorker(CheckWork(options), self._timeout_s)
        item = (path, text, None)
        answer = self._kept.do(item)
        if not isinstance(answer, Lost):
            return answer
        return too_late(path, self._timeout_s) if answer.late else _not_checked(item, answer.how)
