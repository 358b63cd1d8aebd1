"""Promela models of an automaton, for SPIN: the most natural encoding and an expert's.

In both, everything that happens one after the other is one process; a fork starts processes.

``natural``: who has succeeded adds one to a counter, and a join waits for the count.

``expert``: a join receives one message from each of its inputs, in a fixed order, over channels
declared as exclusive (``xr``, ``xs``), so that SPIN's partial order reduction has next to nothing
left to interleave.

The answer "yes" is an error that SPIN finds: a violated assertion for a node that can be
triggered, an invalid end state for one that can be missed.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from benchmarks.other_tools.questions import (
    CanMiss,
    CanTrigger,
    Cone,
    Question,
    Style,
    completes,
    cone_of,
    threads,
)
from gpsfsm.model.automaton import Automaton, Signal
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Iterator, Set


def promela_of(
    automaton: Automaton,
    question: Question | None = None,
    *,
    style: Style = "natural",
    never_fails: Set[int] = frozenset(),
) -> str:
    """The Promela model that asks ``question`` (by default: can the plan complete?).

    ``never_fails`` are nodes of runner instances that always succeed.
    """
    cone = cone_of(automaton, question or completes(automaton), never_fails)
    return (_Natural(cone) if style == "natural" else _Expert(cone)).text()


class _Model(ABC):
    """A process per thread. How processes tell each other something is left to the styles."""

    choice = ""

    def __init__(self, cone: Cone) -> None:
        self.cone = cone
        question = cone.question
        self.missed = question.node if isinstance(question, CanMiss) else None
        self.after = question.after if isinstance(question, CanMiss) else None
        self.thread = threads(cone, apart=self.missed)
        self.members: dict[int, list[int]] = {}
        for node, head in self.thread.items():
            self.members.setdefault(head, []).append(node)

    @abstractmethod
    def declarations(self, head: int) -> Iterator[str]:
        """The variables or channels that a process listens to."""

    @abstractmethod
    def promises(self, head: int) -> Iterator[str]:
        """What a process declares at its beginning."""

    @abstractmethod
    def wait(self, head: int, label: str) -> Iterator[str]:
        """Wait for as many inputs as the first node of a process needs."""

    @abstractmethod
    def tell(self, connection: int, head: int) -> str:
        """Tell a waiting process that one of its inputs has come."""

    def text(self) -> str:
        lines: list[str] = []
        for head in self.members:
            if self.waits(head):
                lines += self.declarations(head)
        for head in self.members:
            lines += self._process(head)
        return "\n".join([*lines, ""])

    def waits(self, head: int) -> bool:
        """Whether a process waits for others; one with a single input is started instead."""
        inputs = self.cone.into[head]
        return self.cone.collects(head) or len(inputs) > 1 or (head == self.missed and head != 0)

    def sent(self, head: int) -> Iterator[int]:
        """The connections through which a process tells others something."""
        for node in self.members[head]:
            for event in (Event.STARTED, *self.cone.events(node)):
                for number in self.cone.targets(Signal(node, event)):
                    target = self.cone.edges[number].target
                    if self.thread[target] == target and self.waits(target):
                        yield number

    def _process(self, head: int) -> list[str]:
        waits = self.waits(head)
        # A join whose waiting is asked about begins to wait when its units are triggered: only
        # then is it wrong that it still waits at the end. Any other may wait for ever.
        active = head == 0 or (waits and not (head == self.missed and self.after is not None))
        lines = [f"{'active ' if active else ''}proctype p{head}() {{"]
        lines += [f"  {promise};" for promise in self.promises(head)]
        if waits:
            missing = self.cone.collects(head) and len(self.cone.into[head]) < self.need(head)
            label = "wait" if head == self.missed else "end_wait"
            steps = [f"{label}: false"] if missing else self.wait(head, label)
            lines += [f"  {step};" for step in steps]
        for node in self.members[head]:
            lines += self._node(node)
        return [*lines, "  stop: skip", "}"]

    def need(self, node: int) -> int:
        """How many inputs a node needs."""
        return max(1, self.cone.node(node).need)

    def _node(self, node: int) -> list[str]:
        lines = [f"  n{node}: /* {self.cone.automaton.name(node)} */"]
        if isinstance(self.cone.question, CanTrigger) and node == self.cone.question.node:
            return [*lines, "  assert(false); goto stop;"]
        before = "".join(f"{step}; " for step in self._steps(Signal(node, Event.STARTED)))
        events = self.cone.events(node)
        if len(events) == 1:
            return [*lines, f"  {before}{self._emit(Signal(node, events[0]))};"]
        choices = [f"  :: {self.choice}{self._emit(Signal(node, event))}" for event in events]
        return [*lines, f"  {before}if", *choices, "  fi;"]

    def _emit(self, signal: Signal) -> str:
        """What an event does, and where this process goes on."""
        goes_on = "stop"
        for number in self.cone.targets(signal):
            target = self.cone.edges[number].target
            if self.thread[target] != target:
                goes_on = f"n{target}"
        return "; ".join([*self._steps(signal), f"goto {goes_on}"])

    def _steps(self, signal: Signal) -> list[str]:
        steps = []
        if signal == self.after and self.missed is not None:
            steps.append(f"run p{self.missed}()")
        for number in self.cone.targets(signal):
            target = self.cone.edges[number].target
            if self.thread[target] == target:
                waits = self.waits(target)
                steps.append(self.tell(number, target) if waits else f"run p{target}()")
        return [f"atomic {{ {'; '.join(steps)} }}"] if len(steps) > 1 else steps


class _Natural(_Model):
    """Shared counters."""

    def declarations(self, head: int) -> Iterator[str]:
        yield f"{'byte' if len(self.cone.into[head]) < 256 else 'int'} arrived{head};"

    def promises(self, head: int) -> Iterator[str]:  # noqa: ARG002
        yield from ()

    def wait(self, head: int, label: str) -> Iterator[str]:
        yield f"{label}: arrived{head} >= {self.need(head)}"

    def tell(self, connection: int, head: int) -> str:  # noqa: ARG002
        return f"arrived{head}++"


class _Expert(_Model):
    """A channel per input. The outcome is a step of its own, local to its process."""

    choice = "true -> "

    def declarations(self, head: int) -> Iterator[str]:
        for number in self.cone.into[head]:
            yield f"chan c{number} = [1] of {{ bit }};"

    def promises(self, head: int) -> Iterator[str]:
        if self.waits(head):
            yield from (f"xr c{number}" for number in self.cone.into[head])
        yield from (f"xs c{number}" for number in self.sent(head))

    def wait(self, head: int, label: str) -> Iterator[str]:
        inputs = self.cone.into[head]
        if self.cone.collects(head):
            yield from (f"{label}{number}: c{number}?_" for number in inputs)
        else:
            choices = " ".join(f":: c{number}?_" for number in inputs) or ":: false"
            yield f"{label}: if {choices} fi"

    def tell(self, connection: int, head: int) -> str:  # noqa: ARG002
        return f"c{connection}!1"
