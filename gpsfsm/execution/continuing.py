"""How a queue goes on behind a plan that gave up: it asks for another one, within bounds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.execution.chain import Chains, Due, Policy
from gpsfsm.execution.queue_rows import QueueKind, QueueRow

if TYPE_CHECKING:
    import asyncio

    from gpsfsm.execution.chain import Regenerator

__all__ = ["Continuing"]


class _Queue(Protocol):
    """What this needs of a queue."""

    def write(self, row: QueueRow) -> None:
        """Keep a row."""

    def full(self) -> str:
        """Why no further plan may be submitted; "" if one may."""

    async def continued(self, gave_up: int, text: str) -> int:
        """Check a plan that goes on where another one gave up, and queue it."""


class Continuing:
    """What is owed to plans that gave up. Without a policy nothing is."""

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
            raise UsageError("who continues plans is to be known before the first one")
        self._regenerator, self._policy = regenerator, policy

    def take(self, row: QueueRow) -> None:
        """Take in what the queue has written, or has written before it was restored."""
        self._used = True
        if self._regenerator is not None:
            self._chains.take(row)

    def due(self) -> Due | None:
        """What is owed to a plan."""
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
            found = self._chains.due()
            if found is None or not found.plan:
                return
            due = found
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
        import asyncio  # noqa: PLC0415  (slow to import, and few plans give up)

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
    """Why a regenerator that has ended by itself has not said what came of it."""
    if error is None:
        return "it came to no end"
    if not isinstance(error, Exception):
        raise error
    kind = "" if isinstance(error, GpsfsmError) else f"{type(error).__name__}: "
    return f"{kind}{error}"[:1000]


def _none(queue: _Queue, due: Due, why: str) -> None:
    """There is no plan that goes on; the chain ends."""
    queue.write(QueueRow(QueueKind.GENERATED, due.gave_up, data={"accepted": False}, message=why))
