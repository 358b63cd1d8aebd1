"""The gate with a time budget: a process decides, and is killed when the time is up.

A thread could not be ended, and a clock inside of the process that decides stands still while z3
does not look at it. The process is told the options once, and then gets plans; what it prints goes
nowhere. It has read a hostile text, so that nothing it says is taken for more than data: what does
not fit the types of a verdict exactly is none, and a verdict must be about the very digests that
were asked about. Analyses are loaded when they are needed: the process starts while they load here.
"""

from __future__ import annotations

import json
import os
import threading
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import DEBUG_VARIABLE, InputError, UsageError, misused
from gpsfsm.workers import limit_memory
from gpsfsm.workers.child_process import ChildProcess, child_command
from gpsfsm.workers.codec import decode, encode
from gpsfsm.workers.frames import GoneError
from gpsfsm.workers.parent_link import WARM_PLAN, serve

if TYPE_CHECKING:
    from pathlib import Path
    from types import TracebackType

    import networkx as nx

    from gpsfsm.gating.deciding import GateOptions, Verdict
    from gpsfsm.model.finding import Finding
    from gpsfsm.tasks.task import Task
    from gpsfsm.workers.frames import Message

DEFAULT_BUDGET_MS = 10_000
MAX_BUDGET_MS = 86_400_000
DEFAULT_MEMORY_MB = 1_024
LEAST_MEMORY_MB = 256
MOST_FINDINGS = 1_000
"""Findings of each kind that are handed over; a verdict is no less refused for more of them."""

_START_S = 60.0
_VERDICT, _MISUSE = "verdict", "misuse"
"""The kinds of answers; the first has a verdict as its bytes, the second says what is ``wrong``."""
_TARGET = f"{__name__}:main"


class NoAnswerError(Exception):
    """There is no verdict, and why."""


def start_worker() -> ChildProcess:
    """The process that decides. Raises NoAnswerError if it cannot be started."""
    try:
        return ChildProcess(child_command(_TARGET), silent=not os.environ.get(DEBUG_VARIABLE))
    except (OSError, ValueError) as error:
        raise NoAnswerError(f"no worker could be started: {error}") from None


class Gate:
    """A gate for many plans, which it decides one after the other.

    Each decision may take ``budget_ms`` milliseconds. The time is counted from the moment a plan is
    passed to the worker process until its answer arrives. The start of the worker is not counted
    and has 60 s of its own; it happens on entering a ``with`` block, or else with the first plan.
    If the worker is killed, the next plan starts a new one. The worker gets ``memory_mb`` megabytes
    of memory, where the system can limit that. ``started`` is a process to begin with. Several
    threads may call a gate; they wait for each other.

    ``task``, ``robot`` (a file each) and ``allow_trees`` are added to the options.

    Raises UsageError for invalid options. Anything else that goes wrong is a refusal.

    >>> with Gate(budget_ms=5_000) as gate:
    ...     print(gate(b"<Plan><Runner/></Plan>", "plan.xml"))
    rejected: findings
    """

    def __init__(
        self,
        options: GateOptions | None = None,
        *,
        budget_ms: int = DEFAULT_BUDGET_MS,
        memory_mb: int = DEFAULT_MEMORY_MB,
        task: str | Path | Task | None = None,
        robot: str | Path | None = None,
        allow_trees: bool = False,
        started: ChildProcess | None = None,
    ) -> None:
        from gpsfsm.gating.deciding import GateOptions
        from gpsfsm.gating.gate_call import options_with

        chosen: object = options
        if not isinstance(chosen, GateOptions | None):
            raise misused("Gate", "gpsfsm.GateOptions as options", chosen)
        _check("budget_ms", budget_ms, 1, MAX_BUDGET_MS)
        _check("memory_mb", memory_mb, LEAST_MEMORY_MB, 1 << 40)
        self.options = options_with(options, task=task, robot=robot, allow_trees=allow_trees)
        self.budget_ms = budget_ms
        self._memory_mb = memory_mb
        self._started = started
        self._worker: ChildProcess | None = None
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
        """End the worker; the next plan starts a new one."""
        for worker in (self._worker, self._started):
            if worker is not None:
                worker.end()
        self._worker = self._started = None

    def __call__(self, plan: str | bytes | Path | nx.Graph[Any], name: str = "") -> Verdict:
        """Decide about a plan: a text, a ``pathlib.Path``, or a machine as a graph."""
        from gpsfsm.gating.deciding import unread
        from gpsfsm.gating.gate_call import text_of

        try:
            text, name = text_of(plan, name, self.options)
        except InputError as error:
            return self._with_bounds(unread(self.options, str(error), name or str(plan)))
        content = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
        return self._with_bounds(self._settled(content, name))

    def _settled(self, content: bytes, name: str) -> Verdict:
        """The verdict, whatever happens to the worker."""
        from gpsfsm.gating.deciding import refusal

        with self._lock:
            try:
                return self._decided(content, name)
            except NoAnswerError as why:
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
        from gpsfsm.gating.deciding import refusal

        too_late = f"the plan is undecided after {self.budget_ms:,} ms (--budget-ms)"
        head, answer = _ask(self._ready(), {"name": name}, text, self.budget_ms / 1000, too_late)
        if head.get("is") == _MISUSE:
            raise UsageError(str(head.get("wrong")))
        if head.get("is") != _VERDICT:
            raise NoAnswerError("the worker's answer is not a verdict")
        verdict = verdict_of(answer)
        expected = refusal(text, self.options, "", name)
        theirs = (verdict.digests, verdict.basis.task, verdict.options)
        if theirs != (expected.digests, expected.basis.task, expected.options):
            raise NoAnswerError("the worker decided about something else")
        return verdict

    def _with_bounds(self, verdict: Verdict) -> Verdict:
        """The verdict with the bounds of this gate among its options."""
        bounds = {"budget_ms": self.budget_ms, "memory_mb": self._memory_mb}
        listed = json.loads(verdict.options) | bounds
        return replace(verdict, options=json.dumps(listed, sort_keys=True))

    def _ready(self) -> ChildProcess:
        """A worker that has loaded all it needs."""
        if self._worker is None:
            worker, self._started = self._started or start_worker(), None
            too_late = f"no worker was ready within {_START_S:g} s"
            try:
                head, options = {"memory_mb": self._memory_mb}, encode(self.options)
                answer, _ = _ask(worker, head, options, _START_S, too_late)
                if answer != {"ready": True}:
                    raise NoAnswerError("no worker could be started")
            except BaseException:
                worker.end()
                raise
            self._worker = worker
        return self._worker


def _ask(
    worker: ChildProcess, head: dict[str, Any], body: bytes, within_s: float, too_late: str
) -> Message:
    """The answer. Raises NoAnswerError."""
    try:
        return worker.ask(head, body, within_s=within_s)
    except TimeoutError:
        raise NoAnswerError(too_late) from None
    except GoneError:
        why = "the process that decided has ended; the memory may have run out"
        raise NoAnswerError(why) from None


def _check(name: str, value: object, least: int, most: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise UsageError(f"{name} must be from {least} to {most}, not {str(value)[:40]}")


def main() -> None:
    """The life of the process that decides."""
    serve(_prepare, load=_load)


def _load() -> None:
    """Load what decisions take, most of which one about a plan of our own needs."""
    from gpsfsm.gating.deciding import GateOptions

    _answer(GateOptions(), {"name": ""}, WARM_PLAN)


def _prepare(head: dict[str, Any], body: bytes) -> Any:
    with suppress(OSError, ValueError):  # a bound that the system refuses
        limit_memory(head["memory_mb"])
    from gpsfsm.gating.deciding import GateOptions

    options: GateOptions = decode(GateOptions, body)
    _answer(options, {"name": ""}, WARM_PLAN)  # loads what these options take
    return partial(_answer, options)


def _answer(options: GateOptions, head: dict[str, Any], text: bytes) -> Message:
    from gpsfsm.gating.deciding import gate_text

    try:
        return {"is": _VERDICT}, written(gate_text(text, head["name"], options))
    except UsageError as error:
        return {"is": _MISUSE, "wrong": str(error)}, b""


def written(verdict: Verdict) -> bytes:
    """A verdict as it is handed over, with at most ``MOST_FINDINGS`` findings of each kind."""
    return encode(_bounded(verdict))


def verdict_of(text: bytes) -> Verdict:
    """The verdict; raises ValueError for anything that ``written`` does not write."""
    from gpsfsm.gating.deciding import Verdict

    verdict: Verdict = decode(Verdict, text)
    if _bounded(verdict) != verdict:
        raise ValueError("this is more than a worker hands over")
    return verdict


def _bounded(verdict: Verdict) -> Verdict:
    """The part of a verdict that is handed over; the text of a plan goes only with findings."""
    report = verdict.report
    if report is not None:
        report = replace(
            report,
            findings=_cut(report.findings),
            suppressed=_cut(report.suppressed),
            source=report.source if report.findings else None,
        )
    return replace(verdict, findings=_cut(verdict.findings), report=report)


def _cut(findings: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Those of the greatest severity, in their order."""
    if len(findings) <= MOST_FINDINGS:
        return findings
    worst = sorted(range(len(findings)), key=lambda at: -findings[at].severity.rank)
    return tuple(findings[at] for at in sorted(worst[:MOST_FINDINGS]))
