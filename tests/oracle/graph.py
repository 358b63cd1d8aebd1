"""Compilation as section 3 of the semantics says, by plain recursion.

A signal is a whole number with one bit set, so that a set of signals that have come is a whole
number too; *nothing* is 0, which no set contains. Nodes are made in an order in which the inputs
of a node exist before it: one pass over them plays a run.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from .model import C, P, Placed, R, place

NOTHING = 0
Outlets = tuple[int, int]


@dataclass(frozen=True, slots=True)
class RunnerNode:
    """A runner instance: ``index`` in document order, what triggers it, what it can emit."""

    path: str
    index: int
    trigger: int
    started: int
    succeeded: int
    failed: int


@dataclass(frozen=True, slots=True)
class JoinNode:
    """Emits ``fires`` once, as soon as ``need`` of the inputs have come (0s never come)."""

    need: int
    inputs: tuple[int, ...]
    fires: int


@dataclass(frozen=True, slots=True)
class Block:
    """A parallel_all of more than one unit; ``units`` are their (success, failure) signals."""

    path: str
    trigger: int
    success: int
    failure: int
    units: tuple[Outlets, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Graph:
    """The automaton: ``complete`` is triggered by ``success``, ``give_up`` by ``failure``.

    ``triggers`` has the signal that triggers a unit, by the path of what is not a recovery in it.
    """

    nodes: tuple[RunnerNode | JoinNode, ...]
    runners: tuple[RunnerNode, ...]
    blocks: tuple[Block, ...]
    start: int
    success: int
    failure: int
    triggers: dict[str, int]

    def reaches(self, signal: int) -> tuple[bool, bool]:
        """Whether the signal, followed through joins, leads to a runner; and to ``complete``."""
        to_runner = to_complete = False
        todo, seen = [signal], {NOTHING}
        while todo:
            current = todo.pop()
            if current in seen:
                continue
            seen.add(current)
            to_complete |= current == self.success
            to_runner |= any(runner.trigger == current for runner in self.runners)
            todo += [
                node.fires
                for node in self.nodes
                if isinstance(node, JoinNode) and current in node.inputs
            ]
        return to_runner, to_complete


def compile_plan(whole: P, *, no_start: bool = False) -> Graph:
    """The automaton of a plan; ``no_start``: units of parallels are triggered by STARTED."""
    root = place(whole)
    instances = [placed.path for placed in root.walk() if isinstance(placed.node, R)]
    order = {path: index for index, path in enumerate(instances)}
    compiler = _Compiler(order, no_start)
    start = compiler.signal()
    success, failure = compiler.sequential(compiler.units(root.children), start)
    runners = [node for node in compiler.nodes if isinstance(node, RunnerNode)]
    return Graph(
        nodes=tuple(compiler.nodes),
        runners=tuple(sorted(runners, key=lambda node: node.index)),
        blocks=tuple(sorted(compiler.blocks, key=lambda block: _document_order(root, block))),
        start=start,
        success=success,
        failure=failure,
        triggers=compiler.triggers,
    )


def _document_order(root: Placed, block: Block) -> int:
    return [placed.path for placed in root.walk()].index(block.path)


@dataclass
class _Unit:
    """A child and the recoveries that guard it, innermost first."""

    guarded: Placed
    recoveries: list[Placed] = field(default_factory=list)


@dataclass
class _Compiler:
    order: dict[str, int]
    no_start: bool
    nodes: list[RunnerNode | JoinNode] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)
    triggers: dict[str, int] = field(default_factory=dict)
    signals: int = 0

    def signal(self) -> int:
        self.signals += 1
        return 1 << self.signals

    def units(self, children: tuple[Placed, ...]) -> list[_Unit]:
        """Group the children; a recovery without a sibling before it is compiled untriggered."""
        units: list[_Unit] = []
        for child in children:
            if not (isinstance(child.node, C) and child.node.type == "recovery"):
                units.append(_Unit(child))
            elif units:
                units[-1].recoveries.append(child)
            else:
                self.guard((NOTHING, NOTHING), child)
        return units

    def unit(self, unit: _Unit, trigger: int) -> Outlets:
        self.triggers[unit.guarded.path] = trigger
        outlets = self.element(unit.guarded, trigger)
        for recovery in unit.recoveries:
            outlets = self.guard(outlets, recovery)
        return outlets

    def guard(self, guarded: Outlets, recovery: Placed) -> Outlets:
        success, failure = guarded
        successes = [success]
        for unit in self.units(recovery.children):
            success, failure = self.unit(unit, failure)
            successes.append(success)
        return self.any_of(successes), failure

    def element(self, placed: Placed, trigger: int) -> Outlets:
        if isinstance(placed.node, R):
            node = RunnerNode(
                placed.path,
                self.order[placed.path],
                trigger,
                self.signal(),
                self.signal(),
                self.signal(),
            )
            self.nodes.append(node)
            return node.succeeded, node.failed
        assert isinstance(placed.node, C)
        units = self.units(placed.children)
        if not units:
            return trigger, NOTHING
        if placed.node.type == "sequential":
            return self.sequential(units, trigger)
        outcomes = self.parallel(units, trigger)
        successes, failures = [one[0] for one in outcomes], [one[1] for one in outcomes]
        if placed.node.type == "parallel_any":
            return self.any_of(successes), self.all_of(failures)
        assert placed.node.type == "parallel_all"
        success, failure = self.all_of(successes), self.any_of(failures)
        if len(units) > 1:
            self.blocks.append(Block(placed.path, trigger, success, failure, tuple(outcomes)))
        return success, failure

    def sequential(self, units: list[_Unit], trigger: int) -> Outlets:
        failures = []
        for unit in units:
            trigger, failure = self.unit(unit, trigger)
            failures.append(failure)
        return trigger, self.any_of(failures)

    def parallel(self, units: list[_Unit], trigger: int) -> list[Outlets]:
        results = []
        for unit in units:
            before = len(self.nodes)
            results.append(self.unit(unit, trigger))
            if self.no_start and trigger != NOTHING:
                # The next unit waits for the first runner that this unit's trigger triggers.
                runners = [node for node in self.nodes[before:] if isinstance(node, RunnerNode)]
                direct = [node for node in runners if node.trigger == trigger]
                if direct:
                    trigger = min(direct, key=lambda node: node.index).started
        return results

    def any_of(self, signals: list[int]) -> int:
        present = [signal for signal in signals if signal != NOTHING]
        if len(present) <= 1:
            return present[0] if present else NOTHING
        return self.join(1, present)

    def all_of(self, signals: list[int]) -> int:
        """Needs every unit, also one that has no such signal: then it never fires."""
        present = [signal for signal in signals if signal != NOTHING]
        if not present or len(signals) == 1:
            return present[0] if present else NOTHING
        return self.join(len(signals), present)

    def join(self, need: int, inputs: list[int]) -> int:
        node = JoinNode(need, tuple(inputs), self.signal())
        self.nodes.append(node)
        return node.fires
