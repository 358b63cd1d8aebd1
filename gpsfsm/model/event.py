"""Events, outcomes and endings (semantics, sections 2 and 4)."""

from __future__ import annotations

from enum import StrEnum


class Event(StrEnum):
    """The events that nodes of the automaton can emit. Joins and start emit SUCCEEDED only."""

    STARTED = "STARTED"
    STOPPED = "STOPPED"
    SUCCEEDED = "SUCCEEDED"
    FAILED = "FAILED"


class Outcome(StrEnum):
    """The outcome that a scenario decides for one runner instance.

    NO_START is FAILED without STARTED (fault model ``no-start``). HANG is neither SUCCEEDED nor
    FAILED, ever (fault model ``hang``). The order is the canonical one of counterexamples.
    """

    SUCCEEDED = "SUCCEEDED"
    FAILED = "FAILED"
    NO_START = "NO_START"
    HANG = "HANG"


EMITTED: dict[Outcome, tuple[Event, ...]] = {
    Outcome.SUCCEEDED: (Event.STARTED, Event.SUCCEEDED),
    Outcome.FAILED: (Event.STARTED, Event.FAILED),
    Outcome.NO_START: (Event.FAILED,),
    Outcome.HANG: (Event.STARTED,),
}
"""The events that a triggered runner instance emits, in order, by its outcome."""


class End(StrEnum):
    """The end of a maximal run.

    HANG and ABORT exist only on engines without a give-up (docs/engines.md): with HANG the plan
    stays in the state running for ever, with ABORT the engine crashes. ENDLESS exists only for
    machines with loops.
    """

    COMPLETED = "COMPLETED"
    GAVE_UP = "GAVE_UP"
    STUCK = "STUCK"
    HANG = "HANG"
    ABORT = "ABORT"
    ENDLESS = "ENDLESS"
