"""Promela models of an automaton, for SPIN: the most natural encoding and an expert's.

``natural``: one process per runner instance, started when it is triggered; a join counts what has
arrived, and a process of its own waits for the count.

``expert``: everything that happens one after the other is one process; a join receives one message
from each of its inputs, in a fixed order, over channels declared as exclusive (``xr``, ``xs``), so
that SPIN's partial order reduction has next to nothing left to interleave.

In both, the answer "yes" is an error that SPIN finds: a violated assertion for a node that can be
triggered, an invalid end state for one that can be missed.
"""

from __future__ import annotations

from collections.abc import Iterable, Set

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
from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import Event


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


class _Natural:
    """One process per runner instance, a counter per join."""

    def __init__(self, cone: Cone) -> None:
        self.cone = cone
        question = cone.question
        self.missed = question.node if isinstance(question, CanMiss) else None
        self.after = question.after if isinstance(question, CanMiss) else None
        self.thread = threads(cone)

    def text(self) -> str:
        lines = ["bool waited, fired;"]
        processes: list[str] = []
        for node in self.cone.nodes:
            if self.cone.collects(node):
                size = "byte" if len(self.cone.into[node]) < 256 else "int"
                lines.append(f"{size} arrived{node};")
                processes += self._join(node)
            elif self._merges(node):
                lines.append(f"bool seen{node};")
            if self.cone.node(node).kind is NodeKind.RUNNER:
                processes += self._runner(node)
        if self.missed is not None and not self.cone.collects(self.missed):
            processes.append("active proctype monitor() { end: waited -> fired }")
        first = "waited = true; " if self.missed is not None and self.after is None else ""
        start = self._report(Signal(0, Event.SUCCEEDED))
        return "\n".join([*lines, *processes, f"init {{ atomic {{ {first}{start} }} }}", ""])

    def _merges(self, node: int) -> bool:
        """Whether several signals that can all come lead here, of which the first counts."""
        several = len(self.cone.into[node]) > 1 and not self.cone.collects(node)
        return several and self.thread[node] == node

    def _runner(self, node: int) -> list[str]:
        lines = [f"proctype runner{node}() {{ /* {self.cone.automaton.name(node)} */"]
        started = Signal(node, Event.STARTED)
        if self.cone.targets(started):
            lines.append(f"  atomic {{ {self._report(started)} }};")
        lines.append("  if")
        for event in self.cone.events(node):
            lines.append(f"  :: atomic {{ {self._report(Signal(node, event))} }}")
        return [*lines, "  fi", "}"]

    def _join(self, node: int) -> list[str]:
        """A join with too few inputs waits for ever, as it should."""
        wait = f"arrived{node} == {self.cone.node(node).need}"
        if node == self.missed:
            wait = f"waited -> {wait}"
        return [
            f"active proctype join{node}() {{ /* {self.cone.automaton.name(node)} */",
            f"  end: {wait} -> atomic {{ {self._fire(node)} }}",
            "}",
        ]

    def _report(self, signal: Signal) -> str:
        """What the event of a node does, as one step."""
        steps = ["waited = true"] if signal == self.after else []
        for number in self.cone.targets(signal):
            target = self.cone.edges[number].target
            if self.cone.collects(target):
                steps.append(f"arrived{target}++")
            elif self._merges(target):
                once = f":: !seen{target} -> seen{target} = true; {self._fire(target)}"
                steps.append(f"if {once} :: else fi")
            else:
                steps.append(self._fire(target))
        return "; ".join(steps) or "skip"

    def _fire(self, node: int) -> str:
        """What happens when a node is triggered, or a join fires."""
        if isinstance(self.cone.question, CanTrigger) and node == self.cone.question.node:
            return "assert(false)"
        steps = ["fired = true"] if node == self.missed else []
        if self.cone.node(node).kind is NodeKind.RUNNER:
            steps.append(f"run runner{node}()")
        else:
            steps.append(self._report(Signal(node, Event.SUCCEEDED)))
        return "; ".join(steps)


class _Expert:
    """One process per thread of events that follow each other, exclusive channels between them."""

    def __init__(self, cone: Cone) -> None:
        self.cone = cone
        question = cone.question
        self.missed = question.node if isinstance(question, CanMiss) else None
        self.after = question.after if isinstance(question, CanMiss) else None
        self.thread = threads(cone, apart=self.missed)
        self.members: dict[int, list[int]] = {}
        for node, head in self.thread.items():
            self.members.setdefault(head, []).append(node)

    def text(self) -> str:
        lines = [
            f"chan c{number} = [1] of {{ bit }};"
            for head in self.members
            if self._receives(head)
            for number in self.cone.into[head]
        ]
        for head in self.members:
            lines += self._process(head)
        return "\n".join([*lines, ""])

    def _receives(self, head: int) -> bool:
        """Whether a process waits for messages; one of a single input is started instead."""
        inputs = self.cone.into[head]
        return self.cone.collects(head) or len(inputs) > 1 or (head == self.missed and head != 0)

    def _process(self, head: int) -> list[str]:
        receives = self._receives(head)
        # A join whose waiting is asked about begins to wait when its units are triggered: only
        # then is it wrong that it still waits at the end. Any other may wait for ever.
        waits_for_after = head == self.missed and self.after is not None
        active = head == 0 or (receives and not waits_for_after)
        kind = "active proctype" if active else "proctype"
        lines = [f"{kind} p{head}() {{", *self._exclusive(head)]
        if receives:
            lines += self._receive(head)
        for node in self.members[head]:
            lines += self._node(node)
        return [*lines, "  stop: skip", "}"]

    def _exclusive(self, head: int) -> Iterable[str]:
        if self._receives(head):
            yield from (f"  xr c{number};" for number in self.cone.into[head])
        for node in self.members[head]:
            for event in (Event.STARTED, *self.cone.events(node)):
                for number in self.cone.targets(Signal(node, event)):
                    target = self.cone.edges[number].target
                    if self.thread[target] == target and self._receives(target):
                        yield f"  xs c{number};"

    def _receive(self, head: int) -> list[str]:
        inputs = self.cone.into[head]
        need = self.cone.node(head).need
        if need > 1 and need != len(inputs):  # one input never comes
            return ["  wait: false;"] if head == self.missed else ["  end_wait: false;"]
        labels = [f"end_{number}: " if head != self.missed else "" for number in inputs]
        if need > 1:
            return [f"  {label}c{number}?_;" for label, number in zip(labels, inputs, strict=True)]
        choices = " ".join(f":: c{number}?_" for number in inputs)
        if not inputs:
            choices = ":: false"
        return [f"  {labels[0] if labels else ''}if {choices} fi;"]

    def _node(self, node: int) -> list[str]:
        lines = [f"  n{node}: /* {self.cone.automaton.name(node)} */"]
        if isinstance(self.cone.question, CanTrigger) and node == self.cone.question.node:
            return [*lines, "  assert(false); goto stop;"]
        started = Signal(node, Event.STARTED)
        before = "".join(f"{step}; " for step in self._steps(started))
        events = self.cone.events(node)
        if len(events) == 1:
            return [*lines, f"  {before}{self._emit(Signal(node, events[0]))};"]
        choices = [f"  :: true -> {self._emit(Signal(node, event))}" for event in events]
        return [*lines, f"  {before}if", *choices, "  fi;"]

    def _emit(self, signal: Signal) -> str:
        """What an event does, and where this process goes on."""
        for number in self.cone.targets(signal):
            target = self.cone.edges[number].target
            if self.thread[target] != target:
                return "; ".join([*self._steps(signal), f"goto n{target}"])
        return "; ".join([*self._steps(signal), "goto stop"])

    def _steps(self, signal: Signal) -> list[str]:
        steps = []
        if signal == self.after and self.missed is not None:
            steps.append(f"run p{self.missed}()")
        for number in self.cone.targets(signal):
            target = self.cone.edges[number].target
            if self.thread[target] == target:
                steps.append(f"c{number}!1" if self._receives(target) else f"run p{target}()")
        return steps
