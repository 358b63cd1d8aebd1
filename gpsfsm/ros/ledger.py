"""The ledger of goals: what may act on the robot, by what its servers have said and not said.

It is a state machine without rclpy and without a clock. "No answer yet" is a state of its own,
and never counts as "nothing there"::

    NOT_SENT ──sent──▶ IN_FLIGHT ──accepted──▶ ACCEPTED ──ended──▶ ENDED
        ▲                 │   ╲                   │                  ▲
        │                 │    ╲──rejected────────┼──────────────────┤
        │              silent                   silent               │
        │                 ▼                       ▼                  │
        ╰──never there── UNKNOWN ◀────────────────╯──ended, lost─────╯

Worked example: a goal is sent, and its server freezes before it answers. The entry is IN_FLIGHT,
then UNKNOWN; a server that comes back may still accept it, so a stop is not confirmed, and no other
goal goes to the same resource. If another server appears under the name, and says that it does not
have the goal, the goal has never begun: it is NOT_SENT, and goes to that server under the same id.

A request to a service is an entry as well; it cannot be cancelled.
"""

from __future__ import annotations

import threading
import uuid
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from gpsfsm.execution.records import RunValue

    Tell = Callable[[str, Mapping[str, RunValue]], object]

_MOST_ENDED = 200
"""Entries that are kept after their ends."""


LEDGER = "ledger"
"""The name of a state in the data of a line of a journal."""

IN_DOUBT = 3
"""The exit code if a goal on the robot may still act."""


class GoalState(StrEnum):
    """The states of an entry."""

    NOT_SENT = "NOT_SENT"
    IN_FLIGHT = "IN_FLIGHT"  # sent, neither accepted nor rejected
    ACCEPTED = "ACCEPTED"
    ENDED = "ENDED"
    UNKNOWN = "UNKNOWN"  # its server has gone or does not answer


class Said(StrEnum):
    """The observations that change an entry."""

    SENT = "sent"
    ACCEPTED = "accepted"  # by the answer to the goal, or by the status topic
    REJECTED = "rejected"
    ENDED = "ended"  # by its result, or by the status topic
    SILENT = "silent"  # the server gives no sign of life
    ALIVE = "alive"  # it gives one again
    ABSENT = "absent"  # the server to which the goal went does not know the goal
    ABSENT_IN_NEW = "absent in new"  # and neither does one that has appeared since


_NAMESPACE = uuid.UUID("5b0ff1a2-2f7f-4a0e-9a53-0d4d3f6a8c11")


class Word(StrEnum):
    """The words of a person about a goal of a process that has ended."""

    SUCCEEDED = "succeeded"
    ENDED = "ended"  # however, so that its step has failed
    NEVER = "never"  # begun, so that it is sent again


LOST, NEVER = "lost", "never began"
"""How entries end of which a server knows nothing any more, and which were not sent."""
MAY_ACT = frozenset({GoalState.IN_FLIGHT, GoalState.ACCEPTED, GoalState.UNKNOWN})
"""States in which something may act on the robot, or begin to."""


def goal_id(key: str) -> uuid.UUID:
    """The id of the goal of an action of a run: the same after a resume."""
    return uuid.uuid5(_NAMESPACE, key)


@dataclass(frozen=True, slots=True)
class Entry:
    """A goal or a request. ``who`` names its server, ``resources`` are what it may use.

    ``may_repeat``: it may be done a second time, should the first server have done it unseen.
    ``accepted``: the server has said once that it has it. ``unwanted``: it is to be cancelled.
    ``how`` is how it has ended, in a word.
    """

    goal: str
    who: str
    resources: frozenset[str] = frozenset()
    is_request: bool = False
    may_repeat: bool = False
    state: GoalState = GoalState.NOT_SENT
    accepted: bool = False
    unwanted: bool = False
    how: str = ""

    @property
    def may_act(self) -> bool:
        """True if it may act on the robot, now or later."""
        return self.state in MAY_ACT

    @property
    def is_in_doubt(self) -> bool:
        """True if nothing else may begin on its resources."""
        return self.state is GoalState.UNKNOWN or (self.may_act and self.unwanted)

    @property
    def words(self) -> str:
        """Words for people about what may still happen; "" for nothing."""
        what = "request" if self.is_request else f"goal {self.goal[:8]}"
        where = f"the {what} to {self.who}"
        if self.state is GoalState.IN_FLIGHT:
            return f"{where} has no answer yet, and may still begin"
        if self.state is GoalState.ACCEPTED:
            return f"{where} has been accepted, and is not known to have ended"
        if self.state is GoalState.UNKNOWN:
            return f"{where}: its server does not answer, so whether it acts is unknown"
        return ""

    @property
    def line(self) -> tuple[str, dict[str, RunValue]]:
        """The line about it in the journal, for people and for programs."""
        what = "request" if self.is_request else f"goal {self.goal[:8]}"
        text = self.words if self.state is not GoalState.ACCEPTED else f"the {what} was accepted"
        text = text or f"the {what} to {self.who}: {self.how or 'it is sent again'}"
        return text, {LEDGER: self.state.value, "goal": self.goal, "server": self.who}


def after(entry: Entry, said: Said, how: str = "") -> Entry:
    """An entry after an observation. Ends are final: what comes late or twice changes nothing."""
    state = entry.state
    if said is Said.SENT and state is GoalState.NOT_SENT:
        if entry.unwanted:
            return _ended(entry, NEVER)
        return replace(entry, state=GoalState.IN_FLIGHT)
    if not entry.may_act:
        return entry
    if said is Said.ACCEPTED:
        return replace(entry, state=GoalState.ACCEPTED, accepted=True)
    if said in (Said.REJECTED, Said.ENDED):
        return _ended(entry, how or said.value)
    if said is Said.SILENT:
        return replace(entry, state=GoalState.UNKNOWN)
    if said is Said.ALIVE and state is GoalState.UNKNOWN:
        state = GoalState.ACCEPTED if entry.accepted else GoalState.IN_FLIGHT
        return replace(entry, state=state)
    if said is Said.ABSENT and entry.accepted:  # else it may be on its way
        return _ended(entry, LOST)
    if said is Said.ABSENT_IN_NEW:
        if entry.accepted or entry.unwanted or not entry.may_repeat:
            return _ended(entry, LOST)
        return replace(entry, state=GoalState.NOT_SENT)
    return entry


def is_news(before: GoalState, now: GoalState) -> bool:
    """True if a journal needs a line about a change: its rows about steps tell of the others.

    A step that has started may have sent its goal; one that has ended says that its goal has ended,
    unless that was unknown before.
    """
    telling = (GoalState.ACCEPTED, GoalState.UNKNOWN, GoalState.NOT_SENT)
    return now is not before and (now in telling or before is GoalState.UNKNOWN)


def _ended(entry: Entry, how: str) -> Entry:
    return replace(entry, state=GoalState.ENDED, how=how)


class Ledger:
    """The entries of one process; may be used by all of its threads."""

    def __init__(self) -> None:
        self._entries: dict[str, Entry] = {}
        self._lock = threading.RLock()
        self._stopped = False
        self._tell: dict[str, Tell] = {}

    def begin(self, entry: Entry, tell: Tell = lambda *_: None) -> None:
        """Enter a goal before it is sent; one that is entered already keeps what is known of it.

        ``tell`` gets the lines about it for the journal, in the thread in which it changes.
        """
        with self._lock:
            self._tell[entry.goal] = tell
            before = self._entries.get(entry.goal)
            if before is None or not before.may_act:
                self._entries.pop(entry.goal, None)
                self._entries[entry.goal] = entry
            over = GoalState.ENDED
            ended = [each.goal for each in self._entries.values() if each.state is over]
            for goal in ended[:-_MOST_ENDED]:
                del self._entries[goal], self._tell[goal]

    def __getitem__(self, goal: str) -> Entry:
        with self._lock:
            return self._entries[goal]

    def may_act(self, goal: str) -> bool:
        """True if a goal may act; one that is not entered, or not any more, does not."""
        with self._lock:
            return goal in self._entries and self._entries[goal].may_act

    def take(self, goal: str, said: Said, how: str = "") -> Entry:
        """Take in an observation. After a stop nothing is sent: who wants to has to look."""
        with self._lock:
            if said is Said.SENT and self._stopped:
                self.cancel(goal)
            return self._change(goal, lambda entry: after(entry, said, how))

    def forget(self, goal: str) -> None:
        """Leave a goal to others: none of ours was sent under its name."""
        with self._lock:
            if goal in self._entries:
                del self._entries[goal], self._tell[goal]

    def stop(self) -> None:
        """Want the ends of all goals, and let no other one begin until ``release``."""
        with self._lock:
            self._stopped = True
            for entry in self.open():
                self.cancel(entry.goal)

    def release(self) -> None:
        """Let goals begin again: a person has looked at what requests may have done."""
        with self._lock:
            self._stopped = False
            for entry in self.open():
                if entry.is_request and entry.state is GoalState.UNKNOWN:
                    self._change(entry.goal, lambda entry: _ended(entry, LOST))

    def cancel(self, goal: str) -> Entry:
        """Want its end from now on."""
        return self._change(goal, lambda entry: replace(entry, unwanted=True))

    def _change(self, goal: str, change: Callable[[Entry], Entry]) -> Entry:
        with self._lock:
            before = self._entries[goal]
            entry = self._entries[goal] = change(before)
            if is_news(before.state, entry.state):
                self._tell[goal](*entry.line)
        return entry

    def open(self) -> list[Entry]:
        """Everything that may act: a stop is confirmed if there is nothing."""
        with self._lock:
            return [each for each in self._entries.values() if each.may_act]

    def unwanted(self) -> list[Entry]:
        """Goals that are to be cancelled, as long as they may act."""
        return [each for each in self.open() if each.unwanted and not each.is_request]

    def blocking(self, resources: Iterable[str], besides: str) -> list[Entry]:
        """The entries in doubt that keep others from these resources."""
        wanted = frozenset(resources)
        return [
            each
            for each in self.open()
            if each.goal != besides and each.is_in_doubt and each.resources & wanted
        ]


OURS = Ledger()
"""The ledger of this process, which drives one robot."""


def doubts(tell: Callable[[str], object]) -> int:
    """The number of goals of this process that may still act; each is put into words."""
    for entry in (left := OURS.open()):
        tell(f"in doubt: {entry.words}")
    return len(left)
