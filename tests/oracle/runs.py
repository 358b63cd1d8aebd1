"""Runs as section 4 of the semantics says: all scenarios, and for orphans all orders of events."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import product

from .graph import Block, Graph, JoinNode, RunnerNode, compile_plan
from .model import P, R, action_key, place

SUCCEEDED, FAILED, NO_START, HANG = "SUCCEEDED", "FAILED", "NO_START", "HANG"
_NO_START_TO_COME = "NO_START to come"  # not an outcome: see Run.orphans

Predicate = Callable[[Mapping[str, str]], bool]


class System:
    """A plan under a fault model; ``faults`` is a subset of {"no-start", "hang"}."""

    def __init__(self, whole: P, faults: frozenset[str] = frozenset()) -> None:
        unknown = faults - {"failed", "no-start", "hang"}
        if unknown:
            raise ValueError(f"unknown faults: {sorted(unknown)}")
        self.graph: Graph = compile_plan(whole, no_start="no-start" in faults)
        self.paths = tuple(runner.path for runner in self.graph.runners)
        self.index = {path: index for index, path in enumerate(self.paths)}
        self.blocks: dict[str, Block] = {block.path: block for block in self.graph.blocks}
        self.kinds = (
            SUCCEEDED,
            FAILED,
            *([NO_START] if "no-start" in faults else []),
            *([HANG] if "hang" in faults else []),
        )
        keys = [action_key(at.node) for at in place(whole).walk() if isinstance(at.node, R)]
        # The number of the action of each instance: equal for equal actions.
        self.actions = tuple(keys.index(key) for key in keys)
        self._memo: dict[tuple[str, ...], int] = {}

    def run(self, outcomes: tuple[str, ...]) -> Run:
        """The maximal run of a scenario."""
        return Run(self, outcomes, self.play(outcomes))

    def play(self, outcomes: tuple[str, ...]) -> int:
        if outcomes not in self._memo:
            self._memo[outcomes] = play(self.graph, outcomes)
        return self._memo[outcomes]

    def allowed(self, *, consistent: bool, constraint: Predicate | None) -> Iterator[Run]:
        """The maximal runs of all scenarios that the constraints allow."""
        for outcomes in product(self.kinds, repeat=len(self.paths)):
            if consistent and any(
                outcomes[index] != outcomes[first] for index, first in enumerate(self.actions)
            ):
                continue
            if constraint is None or constraint(dict(zip(self.paths, outcomes, strict=True))):
                yield self.run(outcomes)


def play(graph: Graph, outcomes: tuple[str, ...], forced: int = 0, suppressed: int = 0) -> int:
    """The signals of the maximal run. Events only enable events, so their order is no matter."""
    fired = graph.start | forced
    for node in graph.nodes:
        if isinstance(node, JoinNode):
            if sum(1 for signal in node.inputs if signal & fired) >= node.need:
                fired |= node.fires & ~suppressed
        elif node.trigger & fired:
            fired |= _emitted(node, outcomes[node.index]) & ~suppressed
    return fired


def _emitted(node: RunnerNode, outcome: str) -> int:
    match outcome:
        case "SUCCEEDED":
            return node.started | node.succeeded
        case "FAILED":
            return node.started | node.failed
        case "NO_START":
            return node.failed
        case "HANG":
            return node.started
        case _:
            assert outcome == _NO_START_TO_COME
            return 0


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A maximal run: its scenario (in document order) and the signals that came."""

    system: System
    outcomes: tuple[str, ...]
    fired: int

    @property
    def scenario(self) -> dict[str, str]:
        return dict(zip(self.system.paths, self.outcomes, strict=True))

    @property
    def completed(self) -> bool:
        return bool(self.fired & self.system.graph.success)

    @property
    def gave_up(self) -> bool:
        return bool(self.fired & self.system.graph.failure)

    @property
    def stuck(self) -> bool:
        return not self.completed and not self.gave_up

    @property
    def ends(self) -> str:
        assert not (self.completed and self.gave_up), "the two endings exclude each other"
        return "COMPLETED" if self.completed else "GAVE_UP" if self.gave_up else "STUCK"

    def _runner(self, path: str) -> RunnerNode:
        return self.system.graph.runners[self.system.index[path]]

    def triggers(self, path: str) -> bool:
        """Whether the instance is triggered in this run."""
        return bool(self.fired & self._runner(path).trigger)

    def emits_failed(self, path: str) -> bool:
        """Whether the instance emits FAILED in this run (outcome FAILED or NO_START)."""
        return bool(self.fired & self._runner(path).failed)

    @property
    def failures(self) -> int:
        """The number of FAILED events."""
        return sum(1 for runner in self.system.graph.runners if self.fired & runner.failed)

    def with_outcome(self, path: str, outcome: str) -> Run:
        """The run of the same scenario with another outcome of one instance."""
        changed = list(self.outcomes)
        changed[self.system.index[path]] = outcome
        return self.system.run(tuple(changed))

    def waits(self, control: str) -> bool:
        """Whether the parallel_all triggered its units and its join never fires."""
        block = self.system.blocks[control]
        return bool(self.fired & block.trigger) and not self.fired & block.success

    def with_units_mended(self, control: str) -> Run:
        """The run in which the units of a parallel_all that failed here succeed instead.

        The success signal of a unit leads out of the unit only, and so does its failure signal:
        to force the one and to suppress the other changes nothing inside.
        """
        forced = suppressed = 0
        for success, failure in self.system.blocks[control].units:
            if self.fired & failure:
                forced |= success
                suppressed |= failure
        fired = play(self.system.graph, self.outcomes, forced, suppressed)
        return Run(self.system, self.outcomes, fired)

    def orphans(self, candidates: frozenset[str] | None = None) -> frozenset[str]:
        """The instances that are active when ``complete`` is triggered, in some order of events.

        Every order is explored: a state is the set of the outcomes delivered so far, a step
        delivers one that is pending, and what it triggers follows at the same instant. An outcome
        that is not delivered is played like one that never comes, HANG, or, where even STARTED
        will not come, like silence; joins and triggers are thus closed in every state. What comes
        after ``complete`` is of no interest, so such states have no steps.

        ``candidates`` are the instances asked for (all if None).
        """
        if not self.completed:
            return frozenset()  # in no order: a part of a run has no more signals than the whole
        paths = self.system.paths if candidates is None else candidates
        wanted = {path for path in paths if self._may_be_orphan(path)}
        results: set[str] = set()
        nothing: frozenset[str] = frozenset()
        todo, seen = [nothing], {nothing}
        while todo and not wanted <= results:
            delivered = todo.pop()
            fired = self._after(delivered)
            pending = {
                runner.path
                for runner in self.system.graph.runners
                if runner.trigger & fired and runner.path not in delivered
            }
            if fired & self.system.graph.success:
                results |= pending & wanted
                continue
            for path in pending:
                after = delivered | {path}
                if self.outcomes[self.system.index[path]] != HANG and after not in seen:
                    seen.add(after)
                    todo.append(after)
        return frozenset(results)

    def failures_to_give_up(self) -> int | None:
        """The fewest failures that have come when ``give_up`` is triggered; None if it never is.

        Every order is explored, as for orphans, the states with the fewest failures first. What
        comes after ``give_up`` is of no interest.
        """
        if not self.gave_up:
            return None  # in no order
        nothing: frozenset[str] = frozenset()
        todo, seen = [(0, 0, nothing)], {nothing}
        while True:
            failures, _, delivered = heappop(todo)
            fired = self._after(delivered)
            if fired & self.system.graph.failure:
                return failures
            for runner in self.system.graph.runners:
                after = delivered | {runner.path}
                outcome = self.outcomes[runner.index]
                if runner.trigger & fired and outcome != HANG and after not in seen:
                    seen.add(after)
                    failed = outcome in (FAILED, NO_START)
                    heappush(todo, (failures + failed, len(seen), after))

    def _after(self, delivered: frozenset[str]) -> int:
        """The signals that have come once these outcomes, and no others, are delivered."""
        to_come = {SUCCEEDED: HANG, FAILED: HANG, NO_START: _NO_START_TO_COME, HANG: HANG}
        return self.system.play(
            tuple(
                outcome if path in delivered else to_come[outcome]
                for path, outcome in zip(self.system.paths, self.outcomes, strict=True)
            )
        )

    def _may_be_orphan(self, path: str) -> bool:
        """A necessary condition, to spare searches that must fail.

        Up to the instant at which an orphan is found, its outcome is not delivered. All signals up
        to then come also if everything but that outcome is delivered, for more deliveries give
        more signals. So ``complete`` and the orphan must be triggered in that case too.
        """
        fired = self._after(frozenset(self.system.paths) - {path})
        return bool(fired & self.system.graph.success and fired & self._runner(path).trigger)
