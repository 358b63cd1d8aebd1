"""The log of a plan queue that also tells why plans do not run, and what models are asked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.cli._streams import complain
from gpsfsm.cli._views import tell
from gpsfsm.execution.queue_rows import QueueKind
from gpsfsm.execution.records import Status
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from gpsfsm.cli._drive import Interrupt
    from gpsfsm.execution.queue_rows import QueueLog, QueueRow

__all__ = ["TellingLog"]


class TellingLog:
    """Keeps each row first. ``codes`` are the exit codes of plans: one that goes on has none.

    A plan that ends has one by then if it has run; one that never began gets it here.
    """

    def __init__(
        self, log: QueueLog, output_format: str, codes: dict[int, int], interrupt: Interrupt
    ) -> None:
        self._log, self._format = log, output_format
        self._codes, self._interrupt = codes, interrupt

    def write_queue(self, at_us: int, row: QueueRow) -> None:
        """Keep a row, then tell what it means, if it is about a plan that goes on."""
        self._log.write_queue(at_us, row)
        data = row.data or {}
        continued = data.get("continues")
        if row.kind is QueueKind.ASKED:
            model = clip(str(data.get("model", "")), 200)
            self._tell(f"plan {row.plan} gave up; {model} is asked for a plan that goes on")
        elif row.kind is QueueKind.ATTEMPT:
            from gpsfsm.cli._generating import attempt_line  # noqa: PLC0415  (rarely needed)
            from gpsfsm.generation.stored import attempt_of  # noqa: PLC0415

            self._tell(attempt_line(attempt_of(data)))
        elif row.kind is QueueKind.GENERATED and data.get("accepted") is not True:
            self._codes[row.plan] = 130 if self._interrupt.asked else 1
            complain(f"plan {row.plan} is not continued: {row.message}")
        elif isinstance(continued, int) and row.kind is QueueKind.SUBMITTED:
            self._codes.pop(continued, None)
        elif isinstance(continued, int) and row.kind is QueueKind.REFUSED:
            self._codes[continued] = 1
        elif row.kind is QueueKind.ENDED and row.plan not in self._codes:
            self._never_began(row.plan, str(data.get("status", "")), row.message)

    def _never_began(self, plan: int, status: str, why: str) -> None:
        if status != Status.CANCELLED.value:
            self._codes[plan] = 2
            complain(f"plan {plan} is not run: {why}")
        elif self._interrupt.asked:
            self._codes[plan] = 130
        else:
            self._codes[plan] = 1
            complain(f"plan {plan} is not run: it was cancelled before it began")

    def _tell(self, text: str) -> None:
        tell(self._format, text)
