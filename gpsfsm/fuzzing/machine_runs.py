"""A run of a machine, whose instances are visited again and again.

An instance is active from the instant of its trigger to that of its outcome or its stop (semantics,
9.2). What happens at the instant at which the run ends is read off the configuration of the kernel,
which has stopped listening by then.

    records    A triggered, A failed, A triggered, B triggered, A stops, B succeeded: it completes
    spans      A from 0 s to 1 s, A from 1 s to 2 s, B from 1 s to 3 s
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from gpsfsm.execution.machine_kernel import MachineKernel
from gpsfsm.execution.records import Kind, Status
from gpsfsm.fuzzing.runs import Run, Span
from gpsfsm.fuzzing.subject import Fate
from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.fuzzing.runs import Moments
    from gpsfsm.fuzzing.subject import Subject, TimedScenario

_OUTCOMES = {Kind.SUCCEEDED: Outcome.SUCCEEDED, Kind.FAILED: Outcome.FAILED}
_OVER = (*_OUTCOMES, Kind.STOPPING, Kind.STOPPED)
"""What ends a visit: its outcome, or that the machine stops it."""


@dataclass(frozen=True)
class MachineRun(Run):
    """A run of a machine; ``active`` are the instances that are active after its last instant."""

    active: tuple[int, ...] = ()

    @cached_property
    def spans(self) -> tuple[Span, ...]:
        """The times at which instances are active, by instance, then by visit."""
        begun: dict[int, int] = {}
        spans: list[Span] = []
        for index, (at_us, _, records) in enumerate(self.moments[: self.decided + 1]):
            # at the end all that is active is stopped, which is not what the machine says
            over = _OVER if index < self.decided else (*_OUTCOMES,)
            for record in records:
                number = record.node - 1
                if record.kind is Kind.TRIGGERED:
                    begun[number] = at_us
                elif record.kind in over and number in begun:
                    spans.append(Span(number, begun.pop(number), at_us))
        for number, begin_us in begun.items():
            gone = number not in self.active  # the instant of the end has stopped it
            spans.append(Span(number, begin_us, self.decided_us if gone else math.inf))
        cut_off = self.status is Status.CANCELLED  # then nothing begins at the last instant
        new = (number for number in self.active if number not in begun and not cut_off)
        spans += (Span(number, self.decided_us, math.inf) for number in new)
        return tuple(sorted(spans))

    @cached_property
    def triggered(self) -> dict[int, int]:
        """The first trigger of each instance, in microseconds, by its number."""
        first: dict[int, int] = {}
        for span in self.spans:
            first.setdefault(span.number, span.begin_us)
        return first

    @cached_property
    def _ends(self) -> dict[int, tuple[int, Outcome]]:
        """The last outcome of each instance."""
        return {number: (at_us, outcome) for at_us, number, outcome in self._outcomes}

    @cached_property
    def _outcomes(self) -> tuple[tuple[int, int, Outcome], ...]:
        return tuple(
            (at_us, record.node - 1, _OUTCOMES[record.kind])
            for at_us, _, records in self.moments[: self.decided + 1]
            for record in records
            if record.kind in _OUTCOMES
        )

    @cached_property
    def active_at_end(self) -> tuple[int, ...]:
        """The instances that are active when it is fixed how the run ends, in document order."""
        return tuple(sorted({each.number for each in self.spans if each.end_us == math.inf}))

    @property
    def choices(self) -> tuple[tuple[int, Outcome], ...]:
        """All outcomes, as they come; then who hangs."""
        visits = [0] * len(self.plan.runners)
        for span in self.spans:
            visits[span.number] += 1
        hanging = (
            (number, Outcome.HANG)
            for number in self.active_at_end
            if self.subject.act_in(self.scenario, number, visits[number]).fate is Fate.HANG
        )
        return (*((number, outcome) for _, number, outcome in self._outcomes), *hanging)


def machine_run(
    subject: Subject, scenario: TimedScenario, kernel: Kernel, sink: Moments
) -> MachineRun:
    """The run that a kernel has made."""
    assert isinstance(kernel, MachineKernel)
    bits = kernel.configuration.active | kernel.configuration.hanging
    active = tuple(number for number in range(bits.bit_length()) if bits >> number & 1)
    return MachineRun(subject, scenario, tuple(sink.moments), kernel.status, sink.decided, active)
