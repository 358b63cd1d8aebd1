"""Worker processes: each does the same work with the items that it is sent.

Each is a child of its own, instead of one of a pool of the standard library: when a worker is
killed (out of memory, for instance) we know what it had in hand. Work and items go there as Python
objects. Results come back as data (``codec``), by the type that the work says it returns: a worker
has read texts that may be hostile, and what it sends is taken for nothing else.
"""

from __future__ import annotations

import os
import pickle
import time
from contextlib import suppress
from functools import partial
from types import GenericAlias
from typing import TYPE_CHECKING, Any, Generic

from gpsfsm.errors import AssumptionError, ConfigError, UsageError
from gpsfsm.workers import limit_memory
from gpsfsm.workers.child_process import ChildProcess, child_command
from gpsfsm.workers.codec import decode, encode, result_type
from gpsfsm.workers.engines import Chunk, Item, Lost, Result
from gpsfsm.workers.parent_link import serve

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.workers.engines import Work
    from gpsfsm.workers.frames import Message

START_S = 120.0
"""A worker that has not begun after so many seconds never will."""
_TARGET = f"{__name__}:main"
_MISUSE = "misuse"


def available_cores() -> int:
    """The cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Worker(Generic[Item, Result]):
    """A process with at most one chunk in hand; ``timeout_s`` is what each item of it may take.

    ``inbox``, which workers may share, gets what they say, for ``take``. ``alive`` is false once
    its last message was taken, and when it was ended.
    """

    def __init__(
        self,
        work: Work[Item, Result],
        *,
        timeout_s: float | None = None,
        memory_mb: int | None = None,
        inbox: ChildProcess.Inbox | None = None,
    ) -> None:
        self.chunk: Chunk[Item] | None = None
        self.alive = True
        self._results = GenericAlias(tuple, (result_type(work), ...))
        packed = pickle.dumps(work)
        self._timeout_s = timeout_s
        self._ready = False
        self._until = time.monotonic() + START_S
        command = child_command(_TARGET, own_modules=False)  # the work may be anybody's
        self.child = ChildProcess(command, inbox=inbox)
        head = {} if memory_mb is None else {"memory_mb": memory_mb}
        self.child.send(head, packed)

    def give(self, chunk: Chunk[Item]) -> None:
        """Hand over a chunk. If the worker has died, the next that it says is that."""
        self.chunk = chunk
        self._limit()
        self.child.send({}, pickle.dumps(chunk.items))

    def take(self, message: Message | None) -> Sequence[Result] | Lost | None:
        """The results of the chunk in hand, or what became of the worker; None: it is ready now.

        ``message`` is what came from it. Raises UsageError if the work did.
        """
        if message is None:
            return self._lost()
        head, body = message
        if not self._ready:
            if head == {"ready": True}:
                self._ready = True
                self._limit()
                return None
            raise UsageError(str(head.get("failed")))
        if _MISUSE in head:
            raise _misuse(head)
        try:
            results: Sequence[Result] = decode(self._results, body)
        except ValueError:
            return self._nonsense()
        if self.chunk is None or len(results) != len(self.chunk.items):
            return self._nonsense()
        return results

    def do(self, item: Item, within_s: float) -> Result | Lost:
        """The result for one item; the start of the worker counts as well. Raises UsageError."""
        self.give(Chunk((0,), (item,)))
        until = time.monotonic() + within_s
        answer: Sequence[Result] | Lost | None = None
        while answer is None:  # the first that it says is that it is ready
            try:
                message = self.child.next_answer(until - time.monotonic())
            except TimeoutError:
                self.end()
                return Lost(f"was ended: it took more than {within_s:g} s", late=True)
            answer = self.take(message)
        return answer if isinstance(answer, Lost) else answer[0]

    @property
    def left_s(self) -> float | None:
        """The seconds that it has left; None: any time."""
        if self._ready and self._timeout_s is None:
            return None
        return max(0.0, self._until - time.monotonic())

    def give_up(self) -> Lost:
        """End it because it takes too long."""
        how = f"took more than {self._timeout_s:g} s" if self._ready else "did not begin"
        self.end()
        return Lost(f"was ended: it {how}", late=self._ready)

    def end(self) -> None:
        """End the process; it holds nothing that needs saving."""
        self.alive = False
        self.child.end()

    def _limit(self) -> None:
        if self._ready and self._timeout_s is not None and self.chunk is not None:
            self._until = time.monotonic() + self._timeout_s * len(self.chunk.items)

    def _lost(self) -> Lost:
        if self.child.garbled:
            return self._nonsense()
        code = self.child.exit_code()
        self.end()
        how = f"by signal {-code}" if code is not None and code < 0 else f"with code {code}"
        return Lost(f"was ended {how}; the memory may have run out")

    def _nonsense(self) -> Lost:
        self.end()
        return Lost("was ended: its answer was not a result")


class KeptWorker(Generic[Item, Result]):
    """A worker for one item after the other, each within ``timeout_s`` seconds.

    It begins with the first item. One that has ended is replaced with the next item. ``kill`` and
    ``end`` may be called from any thread, all else from one at a time.
    """

    def __init__(
        self, work: Work[Item, Result], timeout_s: float, *, memory_mb: int | None = None
    ) -> None:
        self.timeout_s = timeout_s
        self._work, self._memory_mb = work, memory_mb
        self._worker: Worker[Item, Result] | None = None

    def current(self) -> Worker[Item, Result]:
        """The worker that will do the next item."""
        worker = self._worker
        if worker is None or not worker.child.alive:
            self.end()
            worker = self._worker = Worker(self._work, memory_mb=self._memory_mb)
        return worker

    def do(self, item: Item) -> Result | Lost:
        """The result. Raises UsageError if the work does."""
        worker = self.current()
        try:
            return worker.do(item, self.timeout_s)
        except UsageError:
            raise
        except BaseException:  # Ctrl-C: its answer must not meet the next item
            worker.end()
            raise

    def kill(self) -> None:
        """End the worker, whatever it does: who waits for a result gets Lost."""
        worker = self._worker
        if worker is not None:
            worker.child.kill()

    def end(self) -> None:
        """End the worker, and give back all that it took."""
        worker, self._worker = self._worker, None
        if worker is not None:
            worker.end()


def main() -> None:
    """The life of a worker."""
    serve(_prepare)


def _prepare(head: dict[str, Any], body: bytes) -> Any:
    if "memory_mb" in head:
        with suppress(OSError, ValueError):  # a bound that the system refuses
            limit_memory(head["memory_mb"])
    try:
        work = pickle.loads(body)  # noqa: S301  (from the process that has started this one)
    except (AttributeError, ImportError) as error:
        raise UsageError(f"workers cannot import what they are to do: {error}") from None
    return partial(_answer, work)


def _answer(work: Work[Any, Any], _head: dict[str, Any], body: bytes) -> Message:
    items = pickle.loads(body)  # noqa: S301  (from the process that has started this one)
    try:
        return {}, encode(tuple(work(item) for item in items))
    except UsageError as error:
        return {_MISUSE: type(error).__name__, "text": str(error), **vars(error)}, b""


def _misuse(head: dict[str, Any]) -> UsageError:
    """The error of the work; of the errors that gpsfsm has, and of no other class."""
    kind, text = head[_MISUSE], str(head.get("text", ""))
    if kind == AssumptionError.__name__:
        summary, hint = str(head.get("summary", "")), str(head.get("hint", ""))
        return AssumptionError(text, summary=summary, hint=hint)
    return ConfigError(text) if kind == ConfigError.__name__ else UsageError(text)
