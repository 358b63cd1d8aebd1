"""Behaviour trees against engines that tick: py_trees, and one written from the definition."""

from __future__ import annotations

from itertools import product
from random import Random
from typing import TYPE_CHECKING

import py_trees
import pytest
from py_trees.common import ParallelPolicy

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.analysis.decide import decide
from gpsfsm.analysis.evaluate import Evaluator
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.compile import compile_plan
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.execution.explore import explore
from gpsfsm.execution.records import Status as RunStatus
from gpsfsm.model.event import End, Outcome
from tests.cases import batches
from tests.compile.trees import (
    ALL,
    LOOPS,
    PY_TREES,
    T,
    Use,
    World,
    random_tree,
    run_ticking,
    to_xml,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.compile import Compiled

_TREES = 250
_SIDE_BY_SIDE = {"All", "Parallel", "ParallelAll"}


def compiled_of(tree: T) -> Compiled:
    parsed = read_plan(to_xml(tree))
    assert parsed.plan is not None, parsed.problems
    assert not parsed.problems
    return compile_plan(parsed.plan)


def uses_of(compiled: Compiled) -> list[Use]:
    """The uses of the leaves, in the order of the runner instances."""
    plan = compiled.automaton.plan
    uses = []
    for runner in plan.runners:
        _, _, copy = plan.path(runner).partition("@")
        uses.append((runner.interface, int(copy or "1")))
    return uses


def scenarios(uses: list[Use]) -> Iterator[dict[Use, bool]]:
    for outcomes in product((True, False), repeat=len(uses)):
        yield dict(zip(uses, outcomes, strict=True))


def ours(
    compiled: Compiled, uses: list[Use], outcomes: Mapping[Use, bool]
) -> tuple[bool, list[Use]]:
    """How the automaton ends, and the leaves that it starts in their order."""
    run = Evaluator(compiled.automaton).run(
        lambda number: Outcome.SUCCEEDED if outcomes[uses[number]] else Outcome.FAILED
    )
    assert run.ends is not End.STUCK
    started = [uses[node - 1] for node in run.triggered if 1 <= node <= len(uses)]
    return run.ends is End.COMPLETED, started


# --- py_trees -------------------------------------------------------------------------------------


class Leaf(py_trees.behaviour.Behaviour):  # type: ignore[misc]  # py_trees has no types here
    """Runs for a tick, and then ends as its world says."""

    def __init__(self, name: str, world: World) -> None:
        super().__init__(name)
        self.world = world
        self.use: Use = (name, 0)

    def initialise(self) -> None:
        number, size = 0, 1
        node = self.parent
        while node is not None:
            if isinstance(node, py_trees.decorators.Retry):
                number, size = number + node.failures * size, size * node.num_failures
            elif isinstance(node, py_trees.decorators.Repeat):
                number, size = number + node.success * size, size * node.num_success
            node = node.parent
        self.use = (self.name, number + 1)
        self.world.started.append(self.use)

    def update(self) -> py_trees.common.Status:
        if self.status is not py_trees.common.Status.RUNNING:
            return py_trees.common.Status.RUNNING
        outcome = self.world.outcomes[self.use]
        return py_trees.common.Status.SUCCESS if outcome else py_trees.common.Status.FAILURE


def to_py_trees(tree: T, world: World) -> py_trees.behaviour.Behaviour:
    if tree.kind == "leaf":
        return Leaf(tree.leaf, world)
    children = [to_py_trees(child, world) for child in tree.children]
    if tree.kind == "Sequence":
        return py_trees.composites.Sequence("s", memory=True, children=children)
    if tree.kind == "Fallback":
        return py_trees.composites.Selector("f", memory=True, children=children)
    if tree.kind == "All":
        policy = ParallelPolicy.SuccessOnAll(synchronise=True)
        return py_trees.composites.Parallel("p", policy, children=children)
    if tree.kind == "RetryUntilSuccessful":
        return py_trees.decorators.Retry("r", children[0], tree.number)
    if tree.kind == "Repeat":
        return py_trees.decorators.Repeat("n", children[0], tree.number)
    made = {
        "Inverter": py_trees.decorators.Inverter,
        "ForceSuccess": py_trees.decorators.FailureIsSuccess,
        "ForceFailure": py_trees.decorators.SuccessIsFailure,
    }[tree.kind]
    return made("d", children[0])


def run_py_trees(tree: T, world: World) -> bool:
    root = to_py_trees(tree, world)
    for _ in range(1000):
        root.tick_once()
        if root.status is not py_trees.common.Status.RUNNING:
            return root.status is py_trees.common.Status.SUCCESS
    raise AssertionError("the tree does not end")


def agree(tree: T, compiled: Compiled, world: World, *, ended: bool) -> None:
    """The automaton ends like the engine and starts the same; a Parallel may have halted some."""
    uses = uses_of(compiled)
    completes, started = ours(compiled, uses, world.outcomes)
    assert completes is ended, (to_xml(tree), world.outcomes)
    if tree.kinds() & _SIDE_BY_SIDE:
        assert len(set(world.started)) == len(world.started)
        assert set(world.started) <= set(started), (to_xml(tree), world.outcomes)
    else:
        assert world.started == started, (to_xml(tree), world.outcomes)


@pytest.mark.parametrize("part", batches(10))
def test_py_trees_runs_alike(part: int) -> None:
    for seed in range(part, _TREES, 10):
        tree = random_tree(Random(seed), (*PY_TREES, *LOOPS), most=6)  # noqa: S311
        compiled = compiled_of(tree)
        for outcomes in scenarios(uses_of(compiled)):
            world = World(outcomes)
            ended = run_py_trees(tree, world)
            agree(tree, compiled, world, ended=ended)


@pytest.mark.parametrize("part", batches(10))
def test_ticking_runs_alike_however_long_the_leaves_take(part: int) -> None:
    for seed in range(part, _TREES, 10):
        random = Random(1000 + seed)  # noqa: S311
        tree = random_tree(random, ALL, most=6)
        compiled = compiled_of(tree)
        for outcomes in scenarios(uses_of(compiled)):
            lengths = {use: random.randint(1, 3) for use in outcomes}
            world = World(outcomes, lengths.__getitem__)
            ended = run_ticking(tree, world)
            agree(tree, compiled, world, ended=ended)


@pytest.mark.parametrize("part", batches(4))
def test_the_kernel_runs_alike(part: int) -> None:
    """The engine that executes plans: in each of its runs the tree ends as when it is ticked."""
    for seed in range(part, 60, 4):
        tree = random_tree(Random(2000 + seed), ALL, most=4)  # noqa: S311
        compiled = compiled_of(tree)
        uses = uses_of(compiled)
        for run in explore(compiled, orders=False):
            outcomes = dict.fromkeys(uses, False)
            for number, outcome in run.outcomes.items():
                outcomes[uses[number]] = outcome is Outcome.SUCCEEDED
            # Leaves whose outcome the run did not need end last, in one of both ways.
            needed = {uses[number] for number in run.outcomes}
            lengths = {use: 1 if use in needed else 50 * len(uses) for use in uses}
            world = World(outcomes, lengths.__getitem__)
            assert run_ticking(tree, world) is (run.status is RunStatus.COMPLETED), to_xml(tree)


@pytest.mark.parametrize("part", batches(6))
def test_both_deciders_find_what_the_engine_does(part: int) -> None:
    for seed in range(part, 90, 6):
        tree = random_tree(Random(3000 + seed), ALL, most=5)  # noqa: S311
        compiled = compiled_of(tree)
        plan = compiled.automaton.plan
        facts = decide(compiled, constraints_of(plan), AnalysisOptions()).facts()
        assert facts is not None
        uses = uses_of(compiled)
        ends = set()
        started: set[Use] = set()
        for outcomes in scenarios(uses):
            world = World(outcomes)
            ends.add(run_ticking(tree, world))
            started |= set(ours(compiled, uses, outcomes)[1])
        often = {(True,): ("always", "never"), (False,): ("never", "always")}
        expected = often.get(tuple(ends), ("sometimes", "sometimes"))
        assert (facts.completes, facts.gives_up) == expected, to_xml(tree)
        assert facts.stuck == "never"
        never = [
            plan.path(runner)
            for runner, use in zip(plan.runners, uses, strict=True)
            if use not in started
        ]
        assert list(facts.unreachable) == never, to_xml(tree)
