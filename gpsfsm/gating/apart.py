"""The gate with a time budget: a process decides, and is killed when the time is up.

A thread could not be ended, and a clock inside of the process that decides stands still while z3
does not look at it.
"""

from __future__ import annotations

import threading
from contextlib import suppress
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError
from gpsfsm.gating.deciding import refusal
from gpsfsm.gating.process import NoAnswer, Worker
from gpsfsm.gating.told import written
from gpsfsm.gating.verdicts import GateOptions, Verdict
from gpsfsm.gating.wire import decode
from gpsfsm.gating.worker import MISUSE, READY, VERDICT

if TYPE_CHECKING:
    from types import TracebackType

__all__ = ["DEFAULT_BUDGET_MS", "DEFAULT_MEMORY_MB", "LEAST_MEMORY_MB", "MAX_BUDGET_MS", "Gate"]

DEFAULT_BUDGET_MS = 10_000
MAX_BUDGET_MS = 86_400_000
DEFAULT_MEMORY_MB = 1_024
LEAST_MEMORY_MB = 256

_START_S = 60.0


class Gate:
    """Decides whether plans may run, one after the other, each within ``budget_ms`` milliseconds.

    The budget counts from when a plan is handed to the worker until the answer is there. The start
    of the worker is not counted (it has 60 s of its own): entering a ``with`` block does it, else
    the first plan. A worker that was killed is replaced with the next plan. It gets ``memory_mb``
    megabytes of memory, where the system can bound that. ``started`` is a process to begin with.
    May be called from several threads, which then wait for each other.

    Raises UsageError for options that make no sense; all else is a refusal.

    >>> with Gate(budget_ms=5_000) as gate:
    ...     print(gate(b"<Plan><Runner/></Plan>", "plan.xml"))
    refused: findings
    """

    def __init__(
        self,
        options: GateOptions | None = None,
        *,
        budget_ms: int = DEFAULT_BUDGET_MS,
        memory_mb: int = DEFAULT_MEMORY_MB,
        started: Worker | None = None,
    ) -> None:
        _check("budget_ms", budget_ms, 1, MAX_BUDGET_MS)
        _check("memory_mb", memory_mb, LEAST_MEMORY_MB, 1 << 40)
        self.options = options or GateOptions()
        self.budget_ms = budget_ms
        self._memory_mb = memory_mb
        self._started = started
        self._worker: Worker | None = None
        self._lock = threading.Lock()

    def __enter__(self) -> Gate:
        with self._lock, suppress(Exception):  # what is wrong is said of each plan
            self._ready()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the worker; with the next plan there is another one."""
        for worker in (self._worker, self._started):
            if worker is not None:
                worker.end()
        self._worker = self._started = None

    def __call__(self, text: str | bytes, name: str = "<text>") -> Verdict:
        """Decide about a plan."""
        content = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
        with self._lock:
            try:
                return self._decided(content, name)
            except NoAnswer as why:
                self.close()
                return refusal(content, self.options, str(why), name)
            except UsageError:
                raise
            except Exception as error:
                self.close()
                return refusal(content, self.options, f"it failed: {type(error).__name__}", name)
            except BaseException:  # Ctrl-C: its answer must not meet the next plan
                self.close()
                raise

    def _decided(self, text: bytes, name: str) -> Verdict:
        too_late = f"it was not decided within {self.budget_ms:,} ms (--budget-ms)"
        worker = self._ready()
        head, answer = worker.ask({"name": name}, text, self.budget_ms / 1000, too_late)
        if head.get("is") == MISUSE:
            raise UsageError(str(head.get("wrong")))
        if head.get("is") != VERDICT:
            raise NoAnswer("the worker said something that is no verdict")
        verdict = decode(answer)
        wanted = refusal(text, self.options, "", name).digests
        if verdict.digests != wanted:
            raise NoAnswer("the worker decided about something else")
        return verdict

    def _ready(self) -> Worker:
        """A worker that has loaded all it needs."""
        if self._worker is None:
            worker, self._started = self._started or Worker(), None
            too_late = f"no worker was ready within {_START_S:g} s"
            try:
                head, wanted = {"memory_mb": self._memory_mb}, written(self.options)
                answer, _ = worker.ask(head, wanted, _START_S, too_late)
                if answer.get("is") != READY:
                    raise NoAnswer("no worker could be started")
            except BaseException:
                worker.end()
                raise
            self._worker = worker
        return self._worker


def _check(name: str, value: object, least: int, most: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise UsageError(f"{name} must be from {least} to {most}, not {str(value)[:40]}")
