"""The precision of a reading: what a reader says of constructs that it does not take over exactly.

A reader consumes a construct, over-approximates it and says so, or refuses the file. It never lets
a run go missing. So an automaton has all runs of its file: what it never does, the file never does.
A run that enters none of the ``inexact`` nodes of the automaton is a run of the file too; of any
other run nobody knows (docs/semantics.md, 9.6).

    <state id="a"><transition event="go" cond="x > 1" target="b"/>…      line 4
    Approximation(Reading.OVER, "cond", line 4, Cause.VALUE)    its choice is an inexact node
"""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Final, Literal

from gpsfsm.late import dataclass

if TYPE_CHECKING:
    from gpsfsm.model.plan import Location


class Reading(StrEnum):
    """The relation of the automaton to a construct of the file.

    OVER: it allows more than the construct. SKIPPED: the construct has no meaning for the runs, and
    nothing of it was read. DEFAULTED: a value was assumed that the file leaves out.
    """

    OVER = "over-approximated"
    SKIPPED = "skipped"
    DEFAULTED = "defaulted"


class Cause(StrEnum):
    """The cause, as a short clause."""

    VALUE = "depends on a value that is not read"
    CLOCK = "depends on a clock"
    ROUNDS = "its rounds are not counted"
    VERSION = "versions of the engine differ"
    THROWS = "it may throw, which ends the tree"
    ORDER = "the order of events is not followed"
    PRIORITY = "priorities are not followed"
    HISTORY = "the state to go back to is not remembered"
    EVENTS = "events that the machine itself sends are not followed"
    CODE = "code decides that is not run"
    ELSEWHERE = "it is defined in a file that was not read"
    UNDECLARED = "the file does not declare its outcomes"
    COMBINATIONS = "it has too many combinations of outcomes"
    DRAWING = "the drawing may leave out targets"
    UNKNOWN_NODE = "its behaviour is unknown"
    NAMESPACE = "it belongs to another namespace"
    NO_MEANING = "it does not affect the runs"
    NOT_WRITTEN = "the file does not say it"
    DATA = "data is not read"
    EARLIER = "an earlier transition is always taken instead"
    FALSE = "its condition never holds"
    INVOKED = "what is invoked is another machine"
    PREEMPTION = "nobody is assumed to preempt it"
    IMPORTS = "it is assumed to replace no name that this file uses"
    ADDS_NOTHING = "it is assumed to add no state"
    ANOTHER_MACHINE = "another machine of the file was read"
    RESUMED = "the run is assumed to be resumed there"
    NO_LIMIT = "the limit of a run is assumed not to be reached"


@dataclass(frozen=True, slots=True)
class Approximation:
    """A construct, as the file calls it, that was not taken over exactly."""

    reading: Reading
    construct: str
    location: Location
    cause: Cause


EXACT: Final = "exact"
REFUSED: Final = "refused"


@dataclass(frozen=True, slots=True)
class Construct:
    """The declaration of a reader about a construct of its format.

    ``names``: the names that its approximations bear; none where they bear those of the file.
    ``about``: the rest of its description; ``how``: the form that it takes in the automaton.
    """

    reading: Reading | Literal["exact", "refused"]
    names: tuple[str, ...]
    about: str
    how: str
    causes: tuple[Cause, ...] = ()

    def covers(self, approximation: Approximation) -> bool:
        """True if this declares what a reader says of a file."""
        return (
            approximation.reading == self.reading
            and approximation.cause in self.causes
            and (not self.names or approximation.construct in self.names)
        )
