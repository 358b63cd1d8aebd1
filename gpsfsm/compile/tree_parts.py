"""The parts of the machine of a tree, while it grows: leaves, choices, joins, what leads to them.

A node of a tree lies between the events that enter it and those that it ends by (``Ends``). What is
compiled last is numbered first: leaves in the order of the file, and joins behind them.

Events that are not all known yet have a number of their own, a *port*: those that enter the body of
a loop, of which the ones that go back come later.

    port -1 entered by the start; the body is the leaf A, entered by -1; A FAILED goes back to -1
    at the end: A is entered by the start and by A FAILED
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.compile.tree_scripts import Scripts
from gpsfsm.compile.tree_ties import Question, Ties
from gpsfsm.compile.units import TreeMachine
from gpsfsm.model.automaton import Edge, Node, NodeKind
from gpsfsm.model.capability import CHOICE, TICK
from gpsfsm.model.event import Event
from gpsfsm.model.plan import Attribute, Element, Kind
from gpsfsm.model.precision import Approximation, Cause, Reading

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.compile.trees import Scope
    from gpsfsm.model.tree import Forest, TreeNode

MAX_RUNNERS = 4_000
"""Uses of leaves, choices and ticks in one machine."""

Signals = tuple[int, ...]
"""Events: that of a node is ``4 * node + event``; -1, -2, … are ports."""

_EVENTS = (Event.SUCCEEDED, Event.FAILED)
_STATUSES = ("SUCCESS", "FAILURE", "SKIPPED", "RUNNING")


class Ends(NamedTuple):
    """The events that a node ends by."""

    success: Signals = ()
    failure: Signals = ()
    skipped: Signals = ()

    @property
    def all(self) -> Signals:
        """All of them."""
        return joined(self.success, self.failure, self.skipped)


class Visit(NamedTuple):
    """A node that is to be compiled, and where.

    ``enter``: the events that enter it. ``again``: it may be entered several times in a run, or has
    run before. ``rerun``: nothing has reset it since it ended. ``beside``: something beside it may
    halt it, or end before it.
    """

    node: int
    enter: Signals
    scope: Scope
    again: bool = False
    rerun: bool = False
    beside: bool = False


Steps = Generator[Visit, Ends, Ends]
"""The compilation of a node: it asks for what is in it, and says what it ends by."""


class TooLargeError(Exception):
    """A machine with more than ``MAX_RUNNERS`` runners."""


class BlockedError(Exception):
    """Something is wrong with the tree that has been reported."""


def joined(*rows: Signals) -> Signals:
    """All events of some rows, each once, in order."""
    return tuple(dict.fromkeys(signal for row in rows for signal in row))


def all_of(rows: Sequence[Ends]) -> Ends:
    """The ends of several nodes, together."""
    return Ends(
        joined(*(each.success for each in rows)),
        joined(*(each.failure for each in rows)),
        joined(*(each.skipped for each in rows)),
    )


def ends_at(condition: str, signals: Signals) -> Ends:
    """The end that a condition at the beginning of a node names."""
    if condition == "_failureIf":
        return Ends(failure=signals)
    return Ends(success=signals) if condition == "_successIf" else Ends(skipped=signals)


def _construct(node: TreeNode, of: str) -> str:
    """The construct that a choice stands for: a condition among the attributes, else the node."""
    name = of.partition(":")[0]
    return name if name.startswith("_") else node.identity


class Part(NamedTuple):
    """A node of the machine, before all are numbered."""

    kind: NodeKind
    node: TreeNode
    attributes: tuple[Attribute, ...] = ()
    need: int = 0


@dataclass(slots=True)
class Parts:
    """All parts of one machine. ``written_out``: how long loops may be that are written out."""

    forest: Forest
    written_out: int
    parts: list[Part] = field(default_factory=list)
    edges: list[tuple[Signals, int]] = field(default_factory=list)
    stops: list[tuple[Signals, int]] = field(default_factory=list)
    ports: list[Signals] = field(default_factory=list)
    approximations: dict[tuple[int, str], Approximation] = field(default_factory=dict)
    inexact: set[int] = field(default_factory=set)  # parts that the tree may have no run through
    runners: int = 0
    thrown: list[int] = field(default_factory=list)  # events by which an exception ends the tree
    ties: Ties = field(init=False)
    scripts: Scripts = field(init=False)

    def __post_init__(self) -> None:
        self.ties = Ties(self.forest.models or {})
        self.scripts = Scripts.of(self.forest)

    def runner(self, node: TreeNode, attributes: tuple[Attribute, ...], enter: Signals) -> Ends:
        """A runner that these events trigger. Raises TooLargeError."""
        self.runners += 1
        if self.runners > MAX_RUNNERS or (self.written_out and self.runners > MAX_RUNNERS // 4):
            raise TooLargeError
        index = len(self.parts)
        self.parts.append(Part(NodeKind.RUNNER, node, attributes))
        self.edges.append((enter, index))
        return Ends((4 * index,), (4 * index + 1,))

    def choice(
        self,
        node: TreeNode,
        of: str,
        enter: Signals,
        about: Question | None = None,
        *,
        cause: Cause = Cause.VALUE,
    ) -> Ends:
        """Nobody knows: it holds (success) or it does not (failure)."""
        self.ties.ask(len(self.parts), about)
        ends = self.own(node, CHOICE, enter, of)
        self.approximate(node, cause, len(self.parts) - 1, construct=_construct(node, of))
        return ends

    def approximate(self, node: TreeNode, cause: Cause, begin: int, *, construct: str = "") -> None:
        """The parts from ``begin`` on may have runs that the tree does not have."""
        construct = construct or node.identity
        reading = Approximation(Reading.OVER, construct, node.location, cause)
        self.approximations.setdefault((node.index, construct), reading)
        self.inexact.update(range(begin, len(self.parts)))

    def evaluated(self, node: TreeNode, name: str, enter: Signals) -> Signals:
        """The events on which the script in an attribute has been evaluated without throwing."""
        if not (enter and node.attribute(name) and self.scripts.may_throw(node.text(name))):
            return enter
        of = f"{name}: it does not throw"
        chosen = self.choice(node, of, enter, cause=Cause.THROWS)
        self.thrown += chosen.failure
        return chosen.success

    def tick(self, node: TreeNode, enter: Signals) -> Signals:
        """A moment later."""
        return self.own(node, TICK, enter).success

    def own(self, node: TreeNode, interface: str, enter: Signals, of: str = "") -> Ends:
        """A choice or a tick."""
        texts = {"interface": interface, "provider": interface, "of": of}
        attributes = tuple(
            Attribute(name, text, text, node.line, node.column)
            for name, text in texts.items()
            if text
        )
        return self.runner(node, attributes, enter)

    def join(self, node: TreeNode, inputs: Signals, need: int, enter: Signals) -> int:
        """A join, which forgets all whenever the node is entered; its event."""
        index = len(self.parts)
        self.parts.append(Part(NodeKind.JOIN, node, need=need))
        self.edges.append((inputs, index))
        self.stops.append((enter, index))
        return 4 * index

    def port(self, enter: Signals) -> int:
        """A port that is entered by these events, and perhaps by more."""
        self.ports.append(enter)
        return -len(self.ports)

    def back(self, node: TreeNode, port: int, signals: Signals) -> None:
        """A port is entered by these, too. What is no outcome takes a moment: a loop must."""
        outcomes = tuple(each for each in signals if self.is_outcome(each))
        others = tuple(each for each in signals if not self.is_outcome(each))
        if others:
            outcomes = (*outcomes, *self.tick(node, others))
        self.ports[-port - 1] = joined(self.ports[-port - 1], outcomes)

    def ends_of(self, node: TreeNode, status: str, signals: Signals, begin: int) -> Ends:
        """The end that a status names; RUNNING is none: the node is ticked again, at this port."""
        name = status.strip().upper()
        if name == "RUNNING":
            self.back(node, begin, signals)
            return Ends()
        if name == "SUCCESS":
            return Ends(success=signals)
        if name not in _STATUSES:  # it throws, unless a version takes that for FAILURE
            name = "FAILURE"
            chosen = self.choice(node, f"{status.strip()} is a status", signals, cause=Cause.THROWS)
            self.thrown += chosen.failure
            signals = chosen.success
        return Ends(skipped=signals) if name == "SKIPPED" else Ends(failure=signals)

    def is_outcome(self, signal: int) -> bool:
        """True for an outcome of a runner, of which it is known that it is one."""
        return signal >= 0 and self.parts[signal // 4].kind is NodeKind.RUNNER

    def meant(self, signals: Signals) -> Signals:
        """The events that ports stand for, as far as these are known."""
        pending = list(reversed(signals))
        seen: set[int] = set()
        result: dict[int, None] = {}
        while pending:
            each = pending.pop()
            if each >= 0:
                result[each] = None
            elif each not in seen:
                seen.add(each)
                pending += reversed(self.ports[-each - 1])
        return tuple(result)

    def stop(self, signals: Signals, begin: int, end: int) -> None:
        """These events halt all that was compiled from one part to another."""
        if signals:
            self.stops += (
                (signals, index)
                for index in range(begin, end)
                if self.parts[index].kind is NodeKind.RUNNER
            )

    def order(self) -> list[int]:
        """All parts in the order of the file: the start, the leaves, the joins."""
        ranks = {NodeKind.START: 0, NodeKind.RUNNER: 1}
        return sorted(
            range(len(self.parts)),
            key=lambda each: (
                ranks.get(self.parts[each].kind, 2),
                self.parts[each].node.index,
                each,
            ),
        )

    def numbered(self, top: TreeNode, ends: Ends) -> TreeMachine:
        """The machine of all parts, with both ends behind them."""
        order = self.order()
        parts = [self.parts[each] for each in order]
        place = {old: new for new, old in enumerate(order)}
        complete, give_up = len(parts), len(parts) + 1
        parts += [Part(NodeKind.COMPLETE, top), Part(NodeKind.GIVE_UP, top)]
        nodes = tuple(
            Node(index, part.kind, index + 1, part.need) for index, part in enumerate(parts)
        )
        edges = self.resolved(
            [(signals, place[target]) for signals, target in self.edges]
            + [
                (ends.success, complete),
                (joined(ends.failure, ends.skipped, tuple(self.thrown)), give_up),
            ],
            place,
        )
        stops = self.resolved([(signals, place[target]) for signals, target in self.stops], place)
        elements, paths = _elements(top, parts)
        return TreeMachine(
            self.forest.file,
            elements,
            paths=paths,
            nodes=nodes,
            edges=edges,
            stops=stops,
            ties=tuple(self.ties.all(place, self.meant)),
            approximations=tuple(each for _, each in sorted(self.approximations.items())),
            inexact=frozenset(place[each] for each in self.inexact),
        )

    def resolved(self, rows: list[tuple[Signals, int]], place: dict[int, int]) -> tuple[Edge, ...]:
        """The connections, with the events that ports stand for; each once, in order."""
        meant: dict[int, Signals] = {}
        connections: dict[Edge, None] = {}
        for signals, target in rows:
            for signal in signals:
                if signal not in meant:
                    meant[signal] = self.meant((signal,))
                for each in meant[signal]:
                    edge = Edge(place[each // 4], _EVENTS[each % 4], target)
                    connections[edge] = None
        return tuple(connections)


def _elements(top: TreeNode, parts: Sequence[Part]) -> tuple[tuple[Element, ...], tuple[str, ...]]:
    """The elements of a machine below that of its tree; their paths, ``@2`` for a second use."""
    inside = tuple(range(1, len(parts) + 1))
    elements = [
        Element(
            index=0,
            kind=Kind.PLAN,
            parent=-1,
            ordinal=1,
            children=inside,
            attributes=(),
            line=top.line,
            column=top.column,
            start=top.start,
            end=top.end,
            file=top.file,
        )
    ]
    paths = [top.path]
    uses: dict[str, int] = {}
    for index, (kind, node, attributes, _) in enumerate(parts, start=1):
        runs = kind is NodeKind.RUNNER
        elements.append(
            Element(
                index=index,
                kind=Kind.RUNNER if runs else Kind.CONTROL,
                parent=0,
                ordinal=index,
                children=(),
                attributes=attributes,
                line=node.line,
                column=node.column,
                start=node.start,
                end=node.end,
                tag="" if runs else node.identity if kind is NodeKind.JOIN else kind,
                file=node.file,
            )
        )
        use = uses[node.path] = uses.get(node.path, 0) + 1
        paths.append(node.path if use == 1 else f"{node.path}@{use}")
    return tuple(elements), tuple(paths)
