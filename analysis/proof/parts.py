"""The refutation of a large plan, unit by unit: z3 refutes each kind of unit once.

What a unit does is settled by what its children do, so that a claim about the plan follows from
claims about units (assume and guarantee, by induction from the leaves). For each unit z3 is asked
whether it can break its *contract* though both its children keep theirs:

- only what is triggered ends, and it does not both succeed and fail;
- what is triggered and holds no active instance has ended;
- while certain instances in it are active it does not succeed, or does not fail (their *states*);
- without the failures of a class that it needs it does not fail (see ``decisions/fewest.py``).

A child is four free literals and its contract, whatever is in it. A control of many children is
taken for controls of two, one in the other, which mean the same. Units that look alike from outside
and inside are one problem, and all problems together are one disjunction:

    sequence(guard(A, B), guard(C, D), guard(E, F))     the guards are one problem, of two runners;
    the sequence of two guards is another, and so is the sequence of that sequence and a guard

That the joins of the automaton are those of the units, each with the ends of its children as
inputs, is looked up and not taken on trust. The contract of the plan says the rest: it has ended,
one way or the other, when nobody is active.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.decisions.fewest import spans_of
from gpsfsm.analysis.proof.refutation import FALSE, Circuit, UnprovedError
from gpsfsm.compile import UnitKind
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.report import Frequency

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.analysis.proof.refutation import Refutation
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.model.automaton import Signal

LOCAL = frozenset({"completion", "fewest", "joins", "orphans", "reachability", "stuck"})
"""The analyses whose answers follow from the contracts of the units."""

SUCCEEDED, FAILED, OPEN = 1, 2, 4
"""Bits of a state: the ends that a unit can have while an instance in it is active."""

_DIVIDED = (UnitKind.GUARD, UnitKind.ANY)
_IN_ORDER = (UnitKind.SEQUENCE, UnitKind.GUARD)


class _View(NamedTuple):
    """A unit from outside. ``states``: those of the instances in it; ``spans``: it has classes."""

    reached: bool
    can_fail: bool
    states: frozenset[int]
    spans: bool


class _Problem(NamedTuple):
    """A unit of two children, or of one (``second`` is None)."""

    kind: UnitKind
    first: _View
    second: _View | None


_UNREACHED = _View(False, False, frozenset(), False)


class _Pair(NamedTuple):
    """A node of the tree of units of two: its children are nodes, or -1."""

    kind: UnitKind
    first: int
    second: int
    view: _View


class Parts:
    """The problems of the units of one plan. UnprovedError: the plan has no such parts."""

    def __init__(
        self, structure: Structure, ends: tuple[Frequency, Frequency], fewest: int | None
    ) -> None:
        self._structure = structure
        self._compiled = structure.compiled
        self._automaton = structure.compiled.automaton
        self._units = structure.units
        self._ends = ends
        kinds = self._units.kinds
        if not (self._units.plain and structure.constraints.independent) or UnitKind.EMPTY in kinds:
            raise UnprovedError
        self._spans = spans_of(structure, fewest) if fewest else {}
        self._problems: dict[_Problem, None] = {}
        self._pairs: list[_Pair] = []
        self._leaves: dict[int, int] = {}  # by unit of a runner its node
        self._require_connections()
        self._root = self._fold()
        self._require_orphans()

    def hand_in(self, refutation: Refutation) -> None:
        """Hand in the problems, each with names of its own; a solution of one breaks a contract."""
        root = self._pairs[self._root].view
        for number, problem in enumerate(self._problems):
            circuit = Circuit(f"p{number}v")
            broken = _Contract(circuit, problem).broken()
            refutation.never_in(circuit.text(), circuit.names(broken))
        circuit = Circuit("pv")
        broken = _Contract(circuit, _Problem(UnitKind.SEQUENCE, root, None)).of_plan(self._ends)
        refutation.never_in(circuit.text(), circuit.names(broken))

    # -- what is looked up in the automaton ---------------------------------------------------

    def _require_connections(self) -> None:
        """Raise UnprovedError unless runners, joins and ends are connected as the units say."""
        automaton, compiled = self._automaton, self._compiled
        self._require((automaton.complete, 0), (compiled.outlets[0][0],))
        self._require((automaton.give_up, 0), (compiled.outlets[0][1],))
        for unit, kind in enumerate(self._units.kinds):
            if kind is UnitKind.RUNNER:
                node = automaton.runner_node(self._structure.number[unit])
                self._require((node, 0), (compiled.triggers[unit],))
            elif kind is not UnitKind.DEAD:
                self._require_unit(unit, kind)

    def _require_unit(self, unit: int, kind: UnitKind) -> None:
        compiled, children = self._compiled, self._units.children[unit]
        outlets = [compiled.outlets[child] for child in children]
        trigger = compiled.triggers[unit]
        for child, (success, failure) in zip(children, outlets, strict=True):
            if compiled.triggers[child] != trigger:
                raise UnprovedError
            if kind in _IN_ORDER:
                trigger = success if kind is UnitKind.SEQUENCE else failure
        success, failure = compiled.outlets[unit]
        successes, failures = ([outlet[place] for outlet in outlets] for place in (0, 1))
        one, each = 1, len(children)
        if kind is UnitKind.SEQUENCE:
            successes = successes[-1:]
        elif kind is UnitKind.GUARD:
            failures = failures[-1:]
        self._require_join(success, each if kind is UnitKind.ALL else one, successes)
        self._require_join(failure, each if kind is UnitKind.ANY else one, failures)

    def _require_join(
        self, outlet: Signal | None, need: int, inputs: Sequence[Signal | None]
    ) -> None:
        """Raise UnprovedError unless the signal comes with so many of the inputs."""
        present = [signal for signal in inputs if signal is not None]
        if len(inputs) == 1 or (need == 1 and len(present) <= 1):
            expected = present[0] if present else None
            if outlet != expected:
                raise UnprovedError
        elif not present:
            if outlet is not None:
                raise UnprovedError
        else:
            if outlet is None or self._automaton.nodes[outlet.node].kind is not NodeKind.JOIN:
                raise UnprovedError
            self._require((outlet.node, need), present)

    def _require(self, node: tuple[int, int], signals: Sequence[Signal | None]) -> None:
        """Raise UnprovedError unless a node has this need and these inputs."""
        inputs = tuple(signal for signal in signals if signal is not None)
        index, need = node
        if self._automaton.nodes[index].need != need or self._automaton.inputs[index] != inputs:
            raise UnprovedError

    # -- the tree of units of two -------------------------------------------------------------

    def _fold(self) -> int:
        """Make the tree, from the leaves; return its root."""
        structure, units = self._structure, self._units
        nodes = [-1] * len(units)
        for unit in reversed(range(len(units))):
            kind = units.kinds[unit]
            if not structure.reached[unit]:
                nodes[unit] = self._add(_Pair(kind, -1, -1, _UNREACHED))
            elif kind is UnitKind.RUNNER:
                states, spans = frozenset((OPEN,)), unit in self._spans
                view = _View(True, structure.can_fail[unit], states, spans)
                nodes[unit] = self._leaves[unit] = self._add(_Pair(kind, -1, -1, view))
            else:
                nodes[unit] = self._fold_children(kind, [nodes[c] for c in units.children[unit]])
                view = self._pairs[nodes[unit]].view
                if view.can_fail is not structure.can_fail[unit]:
                    raise UnprovedError
        return nodes[0]

    def _fold_children(self, kind: UnitKind, nodes: Sequence[int]) -> int:
        """One node for a control of these children: the first half and the second half."""
        if len(nodes) == 1:
            return nodes[0]
        middle = len(nodes) // 2
        first = self._fold_children(kind, nodes[:middle])
        second = self._fold_children(kind, nodes[middle:])
        one, other = self._pairs[first].view, self._pairs[second].view
        if not one.reached:
            return self._add(_Pair(kind, first, second, _UNREACHED))
        self._problems[_Problem(kind, one, other)] = None
        return self._add(_Pair(kind, first, second, _combined(kind, one, other)))

    def _add(self, pair: _Pair) -> int:
        self._pairs.append(pair)
        return len(self._pairs) - 1

    def _require_orphans(self) -> None:
        """Raise UnprovedError unless the states of the plan are those of the instances outlived."""
        completes: list[dict[int, bool]] = [{} for _ in self._pairs]
        states = (state for pair in self._pairs for state in pair.view.states)
        assert all(state & OPEN for state in states), (
            "while an instance is active, a unit may go on"
        )
        root = self._pairs[self._root].view
        completes[self._root] = {state: bool(state & SUCCEEDED) for state in root.states}
        for node in reversed(range(len(self._pairs))):  # children come before their parents
            kind, first, second, view = self._pairs[node]
            if first < 0 or not view.reached:
                continue
            one, other = self._pairs[first].view, self._pairs[second].view
            for child, seen, beside, place in ((first, one, other, 0), (second, other, one, 1)):
                completes[child] = {
                    state: completes[node][_around(kind, state, beside, place)]
                    for state in seen.states
                }
        for unit, node in self._leaves.items():
            if completes[node][OPEN] is not self._structure.outlived[unit]:
                raise UnprovedError


def _combined(kind: UnitKind, one: _View, other: _View) -> _View:
    """A control of two units, the first of which is reached."""
    both = kind in _DIVIDED
    can_fail = one.can_fail and other.can_fail if both else one.can_fail or other.can_fail
    states = {_around(kind, state, other, 0) for state in one.states}
    states |= {_around(kind, state, one, 1) for state in other.states}
    return _View(True, can_fail, frozenset(states), one.spans or other.spans)


def _around(kind: UnitKind, state: int, beside: _View, place: int) -> int:
    """The state of an instance in a control of two, by its state in one of them.

    ``beside`` is the other one; every unit that is triggered can succeed.
    """
    if kind in _IN_ORDER and place == 1:
        return state
    usual, unusual = (
        (SUCCEEDED, FAILED) if kind in (UnitKind.SEQUENCE, UnitKind.ALL) else (FAILED, SUCCEEDED)
    )
    able = SUCCEEDED | (FAILED if beside.can_fail else 0)  # the ends of the other one
    around = state & unusual  # which is the end of both
    if state & usual:
        around |= able if beside.reached else usual
    if state & OPEN:
        around |= OPEN if kind in _IN_ORDER else OPEN | (able & unusual)
    return around


class _Contract:
    """The contract of a unit, as literals of one circuit, where its children keep theirs."""

    def __init__(self, circuit: Circuit, problem: _Problem) -> None:
        self._circuit = circuit
        self._kind = problem.kind
        self._views = (problem.first, problem.second)
        self.trigger = circuit.fresh()

    def broken(self) -> list[int]:
        """The literals of which each breaks the contract."""
        circuit, (first, second) = self._circuit, self._views
        assert second is not None
        one = self._child(first, self.trigger)
        follows = {UnitKind.SEQUENCE: one.succeeds, UnitKind.GUARD: one.fails}
        begins = follows.get(self._kind, self.trigger)
        other = self._child(second, begins)
        succeeds, fails = self._ends(one, other)
        holds = circuit.any((one.holds, other.holds))
        view = _combined(self._kind, first, second)
        broken = [
            *(circuit.all((each, -self.trigger)) for each in (succeeds, fails, holds)),
            circuit.all((succeeds, fails)),
            circuit.all((self.trigger, -holds, -succeeds, -fails)),
            *(() if second.reached else (begins,)),
            *(() if view.can_fail else (fails,)),
        ]
        for child, beside, flags, place in (
            (first, second, one.states, 0),
            (second, first, other.states, 1),
        ):
            for state in sorted(child.states):
                around = _around(self._kind, state, beside, place)
                broken += self._against(around, flags[state], succeeds, fails)
        if view.spans:
            spared = circuit.fresh()
            parts = [each.spared for each in (one, other) if each.spared != FALSE]
            if self._kind in _DIVIDED:
                circuit.require(-spared, *parts)
            else:
                for part in parts:
                    circuit.require(-spared, part)
            broken.append(circuit.all((spared, fails)))
        return [each for each in broken if each != FALSE]

    def of_plan(self, ends: tuple[Frequency, Frequency]) -> list[int]:
        """The literals that contradict the facts; the plan, the only child, keeps its contract."""
        circuit = self._circuit
        circuit.require(self.trigger)
        plan = self._child(self._views[0], self.trigger)
        broken = [circuit.all((-plan.holds, -plan.succeeds, -plan.fails))]
        for state, flag in sorted(plan.states.items()):
            if not state & SUCCEEDED:
                broken.append(circuit.all((flag, plan.succeeds)))
        for frequency, end in zip(ends, (plan.succeeds, plan.fails), strict=True):
            if frequency is Frequency.NEVER:
                broken.append(end)
            elif frequency is Frequency.ALWAYS:
                broken.append(circuit.all((-plan.holds, -end)))
        if plan.spared != FALSE:
            broken.append(circuit.all((plan.spared, plan.fails)))
        return [each for each in broken if each != FALSE]

    def _ends(self, one: _Child, other: _Child) -> tuple[int, int]:
        circuit = self._circuit
        if self._kind is UnitKind.SEQUENCE:
            return other.succeeds, circuit.any((one.fails, other.fails))
        if self._kind is UnitKind.GUARD:
            return circuit.any((one.succeeds, other.succeeds)), other.fails
        successes, failures = (one.succeeds, other.succeeds), (one.fails, other.fails)
        if self._kind is UnitKind.ALL:
            return circuit.all(successes), circuit.any(failures)
        return circuit.any(successes), circuit.all(failures)

    def _child(self, view: _View, triggered: int) -> _Child:
        """A child that keeps its contract."""
        circuit = self._circuit
        if not view.reached:
            return _Child(FALSE, FALSE, FALSE, {}, FALSE)
        succeeds = circuit.fresh()
        fails = circuit.fresh() if view.can_fail else FALSE
        flags = {state: circuit.fresh() for state in sorted(view.states)}
        holds = circuit.any(flags.values())
        for each in (succeeds, fails, holds):
            circuit.require(-each, triggered)
        circuit.require(-succeeds, -fails)
        circuit.require(-triggered, holds, succeeds, fails)
        for state, flag in flags.items():
            for wrong in self._against(state, flag, succeeds, fails):
                circuit.require(-wrong)
        spared = circuit.fresh() if view.spans else FALSE
        circuit.require(-spared, -fails)
        return _Child(succeeds, fails, holds, flags, spared)

    def _against(self, state: int, flag: int, succeeds: int, fails: int) -> list[int]:
        """The ends that an active instance in this state rules out."""
        ends = ((SUCCEEDED, succeeds), (FAILED, fails))
        return [self._circuit.all((flag, end)) for bit, end in ends if not state & bit]


class _Child(NamedTuple):
    """Literals: it succeeds, fails, holds active instances, by their states; a class is spared."""

    succeeds: int
    fails: int
    holds: int
    states: dict[int, int]
    spared: int
