"""Continuation of plans: which go on where others gave up, and what is owed to one that has.

A plan that gave up is followed by rows ASKED and ATTEMPT, by one GENERATED, and if that is accepted
by SUBMITTED or REFUSED. What a queue does next is a function of the rows before, so a queue that
was killed between any two of them goes on as if it had not been.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, Protocol

from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.execution.queue_rows import QueueKind, QueueRow
from gpsfsm.execution.records import Status

if TYPE_CHECKING:
    import asyncio
    from collections.abc import Callable, Iterable

_FOR_EVER = float("inf")


@dataclass(frozen=True, slots=True)
class Policy:
    """The bounds of a chain of plans. Raises UsageError for what makes no sense.

    ``continuations`` is how many plans may come behind the first one, ``total_s`` what models may
    take to answer for all of them together (None: any time).
    """

    continuations: int = 3
    total_s: float | None = None

    def __post_init__(self) -> None:
        if self.continuations < 1:
            raise UsageError("at least one continuation must be allowed")
        if self.total_s is not None and not self.total_s > 0:
            raise UsageError("the time for continuations must be positive")


class Due(NamedTuple):
    """The continuation that is owed to a plan that gave up.

    ``chain`` are the plans of its chain, it being the last; ``texts`` are theirs. ``kept`` are the
    rows about it so far: a model has been asked, has answered. ``before`` counts the answers that
    led to the earlier plans of the chain, ``spent_s`` is how long those took. ``plan`` is a plan
    that was accepted and is to be submitted now, "" if one is still to be asked for.
    """

    gave_up: int
    chain: tuple[int, ...]
    texts: tuple[str, ...]
    kept: tuple[QueueRow, ...]
    before: int
    spent_s: float
    plan: str = ""


class Regenerator(Protocol):
    """Asks for a plan that goes on where another one gave up."""

    async def __call__(self, due: Due, write: Callable[[QueueRow], None], /) -> None:
        """Write rows ASKED and ATTEMPT, those in ``due.kept`` left out, and one GENERATED.

        May be cancelled while it waits. What it raises ends the chain.
        """


@dataclass(slots=True)
class _Chain:
    """A chain: the part that its plans have in common."""

    plans: list[int]
    answers: int = 0
    spent_s: float = 0.0


@dataclass(slots=True)
class Chains:
    """Reads the rows of one queue, in order."""

    _texts: dict[int, str] = field(default_factory=dict)
    _chains: dict[int, _Chain] = field(default_factory=dict)  # by plan
    _cancelled: set[int] = field(default_factory=set)
    _kept: list[QueueRow] = field(default_factory=list)
    _owed: int = 0
    _plan: str = ""

    def take(self, row: QueueRow) -> None:
        """Take in the next row."""
        data = row.data or {}
        if row.kind in (QueueKind.SUBMITTED, QueueKind.REFUSED):
            self._take_plan(row, data)
        elif row.kind is QueueKind.CANCEL:
            self._cancelled.add(row.plan)
        elif row.kind is QueueKind.ENDED:
            gave_up = data.get("status") == Status.GAVE_UP and row.plan in self._chains
            if gave_up and row.plan not in self._cancelled:
                self._owed, self._plan = row.plan, ""
                self._kept.clear()
        elif row.plan and row.plan == self._owed:
            self._take_answer(row, data)

    def due(self) -> Due | None:
        """The continuation that is owed, if one is."""
        if not self._owed:
            return None
        chain = self._chains[self._owed]
        return Due(
            self._owed,
            tuple(chain.plans),
            tuple(self._texts[plan] for plan in chain.plans),
            tuple(self._kept),
            chain.answers,
            chain.spent_s,
            self._plan,
        )

    def _take_plan(self, row: QueueRow, data: Mapping[str, object]) -> None:
        continued = data.get("continues")
        chain = self._chains.get(continued) if isinstance(continued, int) else None
        self._texts[row.plan] = str(data.get("text", ""))
        if chain is None or row.kind is QueueKind.REFUSED:
            self._chains[row.plan] = _Chain([row.plan])
        else:
            answers = [each.data or {} for each in self._kept if each.kind is QueueKind.ATTEMPT]
            self._chains[row.plan] = _Chain(
                [*chain.plans, row.plan],
                chain.answers + len(answers),
                chain.spent_s + sum(_seconds(each) for each in answers),
            )
        if continued == self._owed:
            self._owed = 0

    def _take_answer(self, row: QueueRow, data: Mapping[str, object]) -> None:
        if row.kind in (QueueKind.ASKED, QueueKind.ATTEMPT):
            self._kept.append(row)
        elif row.kind is QueueKind.GENERATED:
            self._plan = self._accepted(data)
            if not self._plan:
                self._owed = 0

    def _accepted(self, data: Mapping[str, object]) -> str:
        """The plan that a row GENERATED means; "" if it is not accepted or not there."""
        if data.get("accepted") is not True:
            return ""
        wanted = (data.get("round"), data.get("candidate"))
        for row in reversed(self._kept):
            written = row.data or {}
            place = written.get("round"), written.get("candidate")
            if row.kind is QueueKind.ATTEMPT and place == wanted:
                return str(written.get("plan", ""))
        return ""


def _seconds(attempt: Mapping[str, object]) -> float:
    latency = attempt.get("latency_s")
    return float(latency) if isinstance(latency, int | float) and 0 <= latency < _FOR_EVER else 0.0


def chain_of(rows: Iterable[QueueRow], plan: int) -> tuple[int, ...]:
    """The plans of the chain to which a plan belongs, also those that continue it, in order."""
    before: dict[int, int] = {}
    for row in rows:
        continued = (row.data or {}).get("continues")
        if row.kind is QueueKind.SUBMITTED and isinstance(continued, int) and continued < row.plan:
            before[row.plan] = continued
    after = {continued: plan for plan, continued in before.items()}
    first = plan
    while first in before:
        first = before[first]
    numbers = [first]
    while numbers[-1] in after:
        numbers.append(after[numbers[-1]])
    return tuple(numbers)


def broken_link(rows: Iterable[QueueRow]) -> str:
    """A plan that continues another one without having been accepted for that; "" if none does."""
    accepted: dict[int, object] = {}
    answers: dict[tuple[int, object, object], object] = {}
    for row in rows:
        data = row.data or {}
        if row.kind is QueueKind.ATTEMPT and data.get("accepted") is True:
            answers[row.plan, data.get("round"), data.get("candidate")] = data.get("plan")
        elif row.kind is QueueKind.GENERATED and data.get("accepted") is True:
            accepted[row.plan] = answers.get((row.plan, data.get("round"), data.get("candidate")))
        elif row.kind is QueueKind.SUBMITTED and type(continued := data.get("continues")) is int:
            if accepted.get(continued) == data.get("text"):
                continue
            return f"plan {row.plan} is not the one that was accepted to go on for plan {continued}"
    return ""


class _Queue(Protocol):
    """The part of a queue that is needed here."""

    def write(self, row: QueueRow) -> None:
        """Keep a row."""

    def full(self) -> str:
        """The reason why no further plan may be submitted; "" if one may."""

    async def continued(self, gave_up: int, text: str) -> int:
        """Check a plan that goes on where another one gave up, and queue it."""


class Continuing:
    """Continuations that are owed to plans that gave up. Without a policy nothing is."""

    def __init__(self) -> None:
        self._chains = Chains()
        self._policy: Policy | None = None
        self._regenerator: Regenerator | None = None
        self._task: asyncio.Task[None] | None = None
        self._reason = ""
        self._used = False

    def by(self, regenerator: Regenerator, policy: Policy) -> None:
        """Continue plans that give up. Raises UsageError if the queue has been used already."""
        if self._used:
            raise UsageError("set who continues plans before the first plan")
        self._regenerator, self._policy = regenerator, policy

    def take(self, row: QueueRow) -> None:
        """Take in what the queue has written, or has written before it was restored."""
        self._used = True
        if self._regenerator is not None:
            self._chains.take(row)

    def due(self) -> Due | None:
        """The continuation that is owed to a plan."""
        return None if self._regenerator is None else self._chains.due()

    def stop(self, reason: str = "") -> None:
        """End a request that goes on. Without a reason it stays owed, else that is why not."""
        self._reason = reason
        if self._task is not None:
            self._task.cancel()

    async def go_on(self, queue: _Queue, due: Due) -> None:
        """Ask for the plan that is owed, and queue it if there is one."""
        if not due.plan:
            why = self._hindrance(due) or queue.full()
            if why:
                _none(queue, due, why)
            else:
                await self._ask(queue, due)
            first = self._chains.due()
            if first is None or not first.plan:
                return
            due = first
        await queue.continued(due.gave_up, due.plan)

    def _hindrance(self, due: Due) -> str:
        assert self._policy is not None
        most, total_s = self._policy.continuations, self._policy.total_s
        if len(due.chain) > most:
            return f"no more than {most} continuation{'s' * (most > 1)} may be asked for"
        if total_s is not None and due.spent_s >= total_s:
            return f"the time of {total_s:g} s for continuations is over"
        return ""

    async def _ask(self, queue: _Queue, due: Due) -> None:
        import asyncio

        assert self._regenerator is not None
        self._reason, log = "", _Writing(queue)
        asking = asyncio.ensure_future(_asking(self._regenerator, due, log))
        self._task = asking
        try:
            await asyncio.wait({asking})
        finally:
            self._task = None
            if not asking.done():  # whoever waits here is cancelled
                asking.cancel()
                await asyncio.wait({asking})
        if log.failure is not None:  # what is not written did not happen, and nothing follows
            raise log.failure
        why = self._reason if asking.cancelled() else _ended(asking.exception())
        left = self._chains.due()
        if why and left is not None and not left.plan:
            _none(queue, due, why)


class _Writing:
    """Writes the rows of a regenerator, and knows whether that has failed."""

    def __init__(self, queue: _Queue) -> None:
        self._queue = queue
        self.failure: BaseException | None = None

    def __call__(self, row: QueueRow) -> None:
        try:
            self._queue.write(row)
        except BaseException as error:
            self.failure = error
            raise


async def _asking(regenerator: Regenerator, due: Due, log: _Writing) -> None:
    await regenerator(due, log)


def _ended(error: BaseException | None) -> str:
    """The reason why a regenerator has ended by itself without a result."""
    if error is None:
        return "it came to no end"
    if not isinstance(error, Exception):
        raise error
    kind = "" if isinstance(error, GpsfsmError) else f"{type(error).__name__}: "
    return f"{kind}{error}"[:1000]


def _none(queue: _Queue, due: Due, why: str) -> None:
    """There is no plan that goes on; the chain ends."""
    queue.write(QueueRow(QueueKind.GENERATED, due.gave_up, data={"accepted": False}, message=why))
