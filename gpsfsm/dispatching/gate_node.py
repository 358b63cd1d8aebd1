"""The gate as a node of ROS 2, in front of a Fabric server (docs/dispatch.md).

``PlanKeeper`` decides, in a process apart that is killed when its time is up, and writes down what
it has decided before anything comes of it. ``serve_gate`` is the life of the node.
"""

from __future__ import annotations

import json
import threading
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from gpsfsm import logs
from gpsfsm.errors import GpsfsmError
from gpsfsm.gating import Gate
from gpsfsm.gating.deciding import refusal
from gpsfsm.model.printable import clip
from gpsfsm.model.report import Report
from gpsfsm.report import RenderOptions, render
from gpsfsm.ros.fabric import PUBLIC, WAIT_S, Fabric, full_name
from gpsfsm.ros.fabric_front import THREADS, FabricFront
from gpsfsm.ros.node import RosNode
from gpsfsm.streams import append_text, write_text

if TYPE_CHECKING:
    from gpsfsm.gating import GateOptions, Verdict
    from gpsfsm.model.ros import RosSettings
    from gpsfsm.running.interruption import Interruption

_MOST_FINDINGS = 10
_LONGEST_CRITIQUE = 100_000
_WATCH_S = 1.0


@dataclass(frozen=True, kw_only=True)
class GateNode:
    """The settings of the node. ``private`` is the namespace of the server's names."""

    options: GateOptions
    ros: RosSettings
    budget_ms: int
    memory_mb: int
    private: str
    wait_s: float = WAIT_S
    receipts: str | None = None


class PlanKeeper:
    """Decides about texts; each decision is a line on standard output and one in ``receipts``."""

    def __init__(self, gate: Gate, receipts: str | None = None) -> None:
        self._gate = gate
        self._receipts = receipts
        self._verdicts: dict[str, Verdict] = {}  # those accepted plans that are on their way
        self._troubles: set[str] = set()
        self._lock = threading.Lock()

    def refused(self, plan: str, service: str) -> str:
        """The reason why a plan may not run, "" if it may; it is written down first.

        Raises GpsfsmError if it cannot be: then nothing is passed on.
        """
        verdict = self._decided(plan)
        why = _why_not(verdict)
        self._write("rejected" if why else "accepted", verdict, service, why)
        return why

    def _decided(self, plan: str) -> Verdict:
        """The verdict; a text that is too long is not even handed to the process that decides."""
        content = plan.encode("utf-8", "surrogatepass")
        options = self._gate.options
        most = options.check.limits.max_bytes
        if len(content) > most:
            why = f"the plan has {len(content):,} bytes; the limit is {most:,} (--max-bytes)"
            return refusal(content, options, why, "plan")
        return self._gate(content, "plan")

    def passed(self, service: str, plan_id: str, error: str) -> None:
        """An accepted plan was passed on."""
        line = f"passed on ({service}) as {clip(plan_id, 200)}"
        if not plan_id:
            line = f"not taken by the server ({service}): {clip(error, 300)}"
        self._line(line)

    def critique(self, plan: str) -> tuple[bool, str]:
        """True if a plan may run, and all findings in the words of ``--format llm``."""
        verdict = self._decided(plan)
        if verdict.report is None or is_machine(verdict):
            return False, _why_not(verdict)
        shown = Report((replace(verdict.report, path="plan"),))
        text = render(shown, "llm", options=RenderOptions())
        return verdict.accepted, text[:_LONGEST_CRITIQUE]

    def trouble(self, message: str) -> None:
        """Write to standard error what is wrong, once for each message until ``well``."""
        with self._lock:
            if message in self._troubles or len(self._troubles) > 1_000:
                return
            self._troubles.add(message)
        logs.event("warning", "trouble", message)

    def well(self) -> None:
        """Nothing is wrong by now: what was said may be said again."""
        with self._lock:
            self._troubles.clear()

    def _write(self, decision: str, verdict: Verdict, service: str, why: str) -> None:
        if self._receipts is not None:
            entry = {
                "time": datetime.now(UTC).isoformat(timespec="milliseconds"),
                "service": service,
                "decision": decision,
                **verdict.to_dict(),
            }
            with self._lock:
                append_text(json.dumps(entry) + "\n", self._receipts)
        reason = f": {clip(why, 500)}" if why else ""
        self._line(f"{decision} {verdict.digests.plan[:16]} ({service}){reason}")

    def _line(self, text: str) -> None:
        with self._lock, suppress(GpsfsmError):  # nobody reads it: that decides nothing
            write_text(f"{text}\n")


def is_machine(verdict: Verdict) -> bool:
    """True if the text is a machine, which no Fabric server runs."""
    return verdict.report is not None and verdict.report.machine


def _why_not(verdict: Verdict) -> str:
    """The findings that refuse a plan, in one short line each; "" if it may run."""
    if verdict.accepted and not is_machine(verdict):
        return ""
    if is_machine(verdict):
        return "it is a machine, and Fabric runs plans only"
    lines = [
        f"{each.rule} at line {each.location.line}: {clip(each.message, 500)}"
        for each in verdict.findings[:_MOST_FINDINGS]
    ]
    more = len(verdict.findings) - _MOST_FINDINGS
    if more > 0:
        lines.append(f"and {more:,} more")
    return "\n".join([clip(verdict.message, 500), *lines])


def serve_gate(settings: GateNode, interruption: Interruption) -> int:
    """Stand in front of a server until somebody ends it. Raises GpsfsmError if that cannot be."""
    root = f"{full_name(settings.private)}{PUBLIC}"
    with ExitStack() as stack:
        keepers: list[PlanKeeper] = []

        def odd(error: Exception) -> None:
            message = f"{type(error).__name__}: {clip(str(error), 200)}"
            for keeper in keepers:
                keeper.trouble(f"a message was dropped: {message}")

        node = RosNode(settings.ros, "gpsfsm_gate", threads=THREADS, on_error=odd)
        stack.callback(node.close)
        try:
            private = Fabric.at(node, root, settings.wait_s, lambda: interruption.requested)
        except KeyboardInterrupt:
            return 0
        options = for_engine(settings.options, private.release.engine)
        gate = stack.enter_context(
            Gate(options, budget_ms=settings.budget_ms, memory_mb=settings.memory_mb)
        )
        keeper = PlanKeeper(gate, settings.receipts)
        keepers.append(keeper)
        front = FabricFront(node, private, keeper)
        stack.callback(front.close)
        write_text(
            f"ready: {PUBLIC} is gated for {private.release} below {root}, "
            f"as the engine {private.release.engine} runs plans\n"
        )
        stopped = threading.Event()
        interruption.on_request = stopped.set
        while not (interruption.requested or stopped.wait(_WATCH_S)):
            why = front.trouble()
            if why:
                keeper.trouble(f"nothing is passed on: {why}")
            else:
                keeper.well()
    return 0


def for_engine(options: GateOptions, engine: str) -> GateOptions:
    """The options for plans that a server runs: it gets the very text, and reads it its own way."""
    return replace(
        options, check=replace(options.check, engine=engine, from_response=False), allow_trees=False
    )
