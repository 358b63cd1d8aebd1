"""Grouping (semantics, section 3): the tree of units that a plan stands for.

Each recovery is folded into the sibling right before it. The tree is kept in flat tuples with
every parent before its children, so that a pass from the root is a loop forwards and a pass from
the leaves a loop backwards.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

from gpsfsm.late import dataclass
from gpsfsm.model.automaton import Automaton, Edge, Node, Tie
from gpsfsm.model.plan import ControlType, Element, Kind, Location, Plan
from gpsfsm.model.story import Vocabulary

if TYPE_CHECKING:
    from gpsfsm.model.precision import Approximation


class UnitKind(IntEnum):
    """The kinds of units.

    GUARD: ``children[0]`` is guarded by the others. EMPTY: a control without units. DEAD: a
    recovery that guards nothing; its children are compiled, but nothing ever triggers them.
    The others come from behaviour trees only. NOT: the success of its only child is its failure,
    and the other way round. COUNT: a parallel that succeeds with ``Units.needs`` successes.
    BRANCH: ``children[0]`` decides whether the second or the third runs. WAIT: a COUNT that ends
    when all its children have ended.
    """

    RUNNER = 0
    EMPTY = 1
    SEQUENCE = 2
    GUARD = 3
    ALL = 4
    ANY = 5
    DEAD = 6
    NOT = 7
    COUNT = 8
    BRANCH = 9
    WAIT = 10


_KINDS = {
    ControlType.SEQUENTIAL: UnitKind.SEQUENCE,
    ControlType.PARALLEL_ALL: UnitKind.ALL,
    ControlType.PARALLEL_ANY: UnitKind.ANY,
}


@dataclass(frozen=True, slots=True)
class Units:
    """The units of a plan; unit 0 is the plan itself.

    ``elements[u]`` is the index of the element that unit u stands for (of the recovery, for a
    guard), ``parents[u]`` is -1 for the plan and for units of kind DEAD, ``positions[u]`` is the
    place among the parent's children. ``needs`` are the successes that a unit of kind COUNT or
    WAIT needs.
    """

    kinds: tuple[UnitKind, ...]
    elements: tuple[int, ...]
    children: tuple[tuple[int, ...], ...]
    parents: tuple[int, ...]
    positions: tuple[int, ...]
    needs: Mapping[int, int] = field(default_factory=dict)

    @property
    def plain(self) -> bool:
        """True if all units are of the kinds that plans have: so every unit can succeed."""
        return all(kind <= UnitKind.DEAD for kind in self.kinds)

    def __len__(self) -> int:
        return len(self.kinds)


@dataclass(frozen=True, slots=False, eq=False)
class TreePlan(Plan):
    """A plan that was unfolded from a behaviour tree.

    Its elements are the nodes that run, one per use of a node, with the places that these have in
    the file; its units are known already. ``paths`` are the element paths; the second use of a node
    has ``@2`` behind its path.
    """

    vocabulary: ClassVar[Vocabulary] = Vocabulary.TREE

    paths: tuple[str, ...] = ()
    units: Units = field(default_factory=lambda: Units((), (), (), (), ()))

    def path(self, element: Element | int) -> str:
        """The element path, ``/root/BehaviorTree[1]/Sequence[1]/Action[2]``."""
        return self.paths[element if isinstance(element, int) else element.index]


@dataclass(frozen=True, slots=False, eq=False)
class MachinePlan(Plan):
    """A machine that was handed in: an element for each node, below a root, and its connections.

    It has no units. ``paths`` are the paths of the elements; the others are the parts of its
    automaton. ``approximations`` are the constructs that the reader did not take over exactly;
    ``inexact`` the nodes that stand for those of which it says more than the file does: the machine
    has all runs of the file, and perhaps others, each of which enters one of these nodes.
    """

    vocabulary: ClassVar[Vocabulary] = Vocabulary.MACHINE
    nested: ClassVar[bool] = False

    paths: tuple[str, ...] = ()
    nodes: tuple[Node, ...] = ()
    edges: tuple[Edge, ...] = ()
    stops: tuple[Edge, ...] = ()
    approximations: tuple[Approximation, ...] = ()
    inexact: frozenset[int] = frozenset()

    @cached_property
    def automaton(self) -> Automaton:
        """Its automaton."""
        return Automaton.of(self, self.nodes, self.edges, stops=self.stops)

    def path(self, element: Element | int) -> str:
        """The path of a node, ``/machine/drive``."""
        return self.paths[element if isinstance(element, int) else element.index]


@dataclass(frozen=True, slots=True)
class Pruned:
    """A leaf that nothing enters: the node ``before`` it never fails, or never succeeds.

    ``spot`` is that of its element.
    """

    spot: tuple[str, int]
    before: str
    location: Location
    fails: bool


@dataclass(frozen=True, slots=False, eq=False)
class TreeMachine(MachinePlan):
    """The machine of a behaviour tree that is no plan (``compile/tree_machine.py``).

    Its elements are the uses of leaves, joins, choices and ticks, with their places in the file of
    the tree. ``ties`` are the conditions on the blackboard that have one answer, if nothing but the
    tree writes there. ``pruned`` are leaves that nothing enters, with the cause.
    """

    vocabulary: ClassVar[Vocabulary] = Vocabulary.TREE

    ties: tuple[Tie, ...] = ()
    pruned: tuple[Pruned, ...] = ()


def is_recovery(element: Element) -> bool:
    """True for a recovery control."""
    return element.control_type is ControlType.RECOVERY


def group_units(plan: Plan) -> Units:
    """Fold recoveries into the siblings before them; linear, for any depth."""
    if isinstance(plan, TreePlan):
        return plan.units
    builder = _Builder(plan)
    builder.add(UnitKind.SEQUENCE, plan.elements[0], -1)
    builder.fill()
    # What passes over the units as loops rely on: parents come before their children.
    assert all(parent < unit for unit, parent in enumerate(builder.parents))
    return Units(
        kinds=tuple(builder.kinds),
        elements=tuple(builder.elements),
        children=tuple(map(tuple, builder.children)),
        parents=tuple(builder.parents),
        positions=tuple(builder.positions),
    )


class _Builder:
    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.kinds: list[UnitKind] = []
        self.elements: list[int] = []
        self.children: list[list[int]] = []
        self.parents: list[int] = []
        self.positions: list[int] = []
        self.pending: list[int] = []

    def add(self, kind: UnitKind, element: Element, parent: int) -> int:
        unit = len(self.kinds)
        self.kinds.append(kind)
        self.elements.append(element.index)
        self.children.append([])
        self.parents.append(parent)
        self.positions.append(len(self.children[parent]) if parent >= 0 else 0)
        if parent >= 0:
            self.children[parent].append(unit)
        if kind is not UnitKind.RUNNER:
            self.pending.append(unit)
        return unit

    def fill(self) -> None:
        """Give every pending unit the units of its element's children."""
        while self.pending:
            unit = self.pending.pop()
            base: Element | None = None
            guards: list[Element] = []
            for child in self.plan.children(self.plan.elements[self.elements[unit]]):
                if not is_recovery(child):
                    self._add_group(unit, base, guards)
                    base, guards = child, []
                elif base is None:
                    self.add(UnitKind.DEAD, child, -1)
                else:
                    guards.append(child)
            self._add_group(unit, base, guards)

    def _add_group(self, parent: int, base: Element | None, guards: list[Element]) -> None:
        """Add ``base`` under its guards, the last recovery being the outermost guard."""
        if base is None:
            return
        for recovery in reversed(guards):
            if self._has_units(recovery):
                parent = self.add(UnitKind.GUARD, recovery, parent)
            else:  # a recovery without units changes nothing; what is in it is never triggered
                self.add(UnitKind.DEAD, recovery, -1)
        if base.kind is Kind.RUNNER:
            self.add(UnitKind.RUNNER, base, parent)
        elif self._has_units(base):
            assert base.control_type is not None
            self.add(_KINDS[base.control_type], base, parent)
        else:
            self.add(UnitKind.EMPTY, base, parent)

    def _has_units(self, element: Element) -> bool:
        return any(not is_recovery(child) for child in self.plan.children(element))
