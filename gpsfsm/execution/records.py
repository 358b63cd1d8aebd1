"""Inputs of the kernel, its records, and its commands."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping

RunValue = bool | int | float | str | list["RunValue"]
"""What runners are given and hand over: what JSON can hold, objects and null left out."""


class Status(StrEnum):
    """The status of a run: those of the original server, GAVE_UP and STUCK.

    HANG and ABORT are ends of runs under the profile of an engine without a give-up.
    """

    QUEUED = "QUEUED"
    RUNNING = "RUNNING"
    STOPPING = "STOPPING"
    COMPLETED = "COMPLETED"
    GAVE_UP = "GAVE_UP"
    STUCK = "STUCK"
    HANG = "HANG"
    ABORT = "ABORT"
    CANCELLED = "CANCELLED"
    REFUSED = "REFUSED"

    @property
    def ended(self) -> bool:
        """True if nothing more happens."""
        return self not in UNFINISHED


UNFINISHED = (Status.QUEUED, Status.RUNNING, Status.STOPPING)
"""How a run stands as long as something may happen."""


class Kind(StrEnum):
    """The kinds of records of a run. Inputs come from outside, the others follow from them."""

    # inputs
    BEGIN = "BEGIN"
    LOADED = "LOADED"  # a runner was loaded
    NOT_LOADED = "NOT_LOADED"  # and here it could not be
    SUCCEEDED = "SUCCEEDED"  # the outcome of an instance
    FAILED = "FAILED"
    TIMEOUT = "TIMEOUT"  # an instance has used up its time
    STOPPED = "STOPPED"  # an instance that was to stop has stopped
    PAUSE = "PAUSE"
    RESUME = "RESUME"
    CANCEL = "CANCEL"  # by a user, or because the bond is lost
    SILENCE = "SILENCE"  # nothing more can happen by itself
    REPORTED = "REPORTED"  # the end, as the server reports it that drives the run
    # marks: they are written down and change nothing in the run
    LOG = "LOG"  # a line of a runner
    NOTE = "NOTE"  # about the run as a whole: forced, another plan is queued, …
    CONTINUED = "CONTINUED"  # the run continues in another process
    RESTARTED = "RESTARTED"  # an instance that was active when a process ended is asked again
    # what follows
    TRIGGERED = "TRIGGERED"  # an instance, with its parameters
    STARTED = "STARTED"  # an instance: its runner is loaded and has been asked to act
    HELD = "HELD"  # an instance that is triggered during a pause
    JOINED = "JOINED"  # a join has fired
    LOADING = "LOADING"
    UNLOADED = "UNLOADED"
    STOPPING = "STOPPING"  # an instance is asked to stop
    LATE = "LATE"  # an answer of an instance that is not active any more changes nothing
    ENDED = "ENDED"  # the run, with its status


MARKS = (Kind.LOG, Kind.NOTE, Kind.CONTINUED, Kind.RESTARTED)
"""Kinds of inputs that only the journal is told of, never the kernel."""
AWAITED, DOUBTED = "it is waited for", "in doubt"
"""The beginnings of the lines about what may still act outside: for a while, and at the end."""


@dataclass(frozen=True, slots=True)
class Input:
    """Something that has happened.

    ``number`` is that of a runner instance, ``runner`` that of a runner (``Kernel.runners``).
    """

    kind: Kind
    number: int = -1
    runner: int = -1
    outputs: Mapping[str, RunValue] = field(default_factory=dict)
    message: str = ""


class Record(NamedTuple):
    """One event of a run, as it is journaled.

    ``node`` is a node of the automaton (an instance or a join), -1 for others; ``runner`` a runner
    that is loaded, -1 for others; ``data`` are parameters, outputs or a status; ``message`` says
    why.
    """

    kind: Kind
    node: int = -1
    runner: int = -1
    data: Mapping[str, RunValue] | None = None
    message: str = ""


class Load(NamedTuple):
    """Load a runner; answer with LOADED or NOT_LOADED."""

    runner: int


class Unload(NamedTuple):
    """Unload a runner that nothing needs any more."""

    runner: int


class Start(NamedTuple):
    """Let an instance act; answer with SUCCEEDED, FAILED or TIMEOUT.

    ``visit`` counts how often it has been triggered until now; in a plan it is 1.
    """

    number: int
    runner: int
    parameters: Mapping[str, RunValue]
    visit: int = 1


class Stop(NamedTuple):
    """Let an instance stop within the grace time; answer with STOPPED."""

    number: int


Command = Load | Unload | Start | Stop


@dataclass(frozen=True, slots=True)
class Left:
    """The remains of a run in real time whose process ended.

    ``at_us``: the time of the run at its last event; ``active``: the instances that act or are to
    stop, in the order of their start; ``loaded``: the runners that the run counts as loaded, in
    their order; ``loading``: those that were being loaded; ``cancel``: why the run is cancelled
    instead of gone on with, "" if it is not.
    """

    at_us: int
    active: tuple[Start, ...]
    loaded: tuple[int, ...]
    loading: tuple[int, ...]
    cancel: str = ""
