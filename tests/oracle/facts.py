"""All facts of a plan, by looking at every run (semantics, section 5)."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

from .runs import FAILED, HANG, NO_START, SUCCEEDED, Predicate, Run, System

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from .graph import Block, RunnerNode
    from .model import P


def facts(
    whole: P,
    *,
    faults: frozenset[str] = frozenset(),
    consistent: bool = False,
    constraint: Predicate | None = None,
) -> dict[str, Any] | None:
    """The facts of the JSON contract; None if the constraints admit no scenario.

    ``faults`` is a subset of {"no-start", "hang"}; ``constraint`` says of a scenario, a mapping
    from element path to outcome, whether it is allowed.
    """
    system = System(whole, faults)
    runs = list(system.allowed(consistent=consistent, constraint=constraint))
    if not runs:
        return None
    runners = system.graph.runners
    triggered = 0
    for run in runs:
        triggered |= run.fired
    reachable = [runner for runner in runners if runner.trigger & triggered]
    return {
        "runners": len(runners),
        "completes": _frequency(run.completed for run in runs),
        "gives_up": _frequency(run.gave_up for run in runs),
        "stuck": _frequency(run.stuck for run in runs),
        "unreachable": [runner.path for runner in runners if runner not in reachable],
        "dangling": [entry for runner in reachable for entry in _dangling(runner, runs)],
        "join_deadlocks": [
            {"control": block.path, "effect": _deadlock_effect(block, runs)}
            for block in system.graph.blocks
            if any(run.waits(block.path) for run in runs)
        ],
        "orphans": _orphans(runs),
        "fewest_failures_to_give_up": _fewest_failures(runs),
    }


def _fewest_failures(runs: list[Run]) -> int | None:
    # Runs with the same signals differ in outcomes that are never asked for: one is enough.
    different = {run.fired: run for run in runs}.values()
    numbers = [run.failures_to_give_up() for run in different]
    return min((number for number in numbers if number is not None), default=None)


def _frequency(answers: Iterable[bool]) -> str:
    seen = set(answers)
    return "sometimes" if len(seen) == 2 else "always" if seen == {True} else "never"


def _dangling(runner: RunnerNode, runs: list[Run]) -> list[dict[str, str]]:
    graph = runs[0].system.graph
    events = (("SUCCEEDED", runner.succeeded), ("FAILED", runner.failed))
    dangling = [event for event, signal in events if not any(graph.reaches(signal))]
    effect = "give_up" if dangling and _decides_give_up(runner.path, runs) else "dont_care"
    return [{"runner": runner.path, "event": event, "effect": effect} for event in dangling]


def _decides_give_up(path: str, runs: list[Run]) -> bool:
    return any(
        run.emits_failed(path) and run.gave_up and not run.with_outcome(path, SUCCEEDED).gave_up
        for run in runs
    )


def _deadlock_effect(block: Block, runs: list[Run]) -> str:
    to_runner, _ = runs[0].system.graph.reaches(block.failure)
    if to_runner:
        return "escalated"
    waiting = [run for run in runs if run.waits(block.path)]
    if any(run.stuck for run in waiting):
        return "stuck"
    if any(run.gave_up and not run.with_units_mended(block.path).gave_up for run in waiting):
        return "give_up"
    return "absorbed"


def _orphans(runs: list[Run]) -> list[str]:
    paths = runs[0].system.paths
    result: frozenset[str] = frozenset()
    # Runs with the same signals differ in outcomes that are never asked for: one is enough.
    for run in {run.fired: run for run in runs}.values():
        missing = frozenset(paths) - result
        if missing:
            result |= run.orphans(missing)
    return [path for path in paths if path in result]


_RANK = {SUCCEEDED: 0, FAILED: 1, NO_START: 2, HANG: 3}


def canonical_scenario(
    whole: P,
    claim: Callable[[Run], bool],
    *,
    faults: frozenset[str] = frozenset(),
    consistent: bool = False,
    constraint: Predicate | None = None,
) -> Run | None:
    """The run of the smallest allowed scenario that shows the claim; None if none does.

    Smallest: fewest outcomes other than SUCCEEDED, over all instances, triggered or not; then
    the first list of their places in document order; then the kinds of these outcomes, place by
    place, in the order FAILED, NO_START, HANG.
    """
    system = System(whole, faults)
    runs = system.allowed(consistent=consistent, constraint=constraint)
    return min(filter(claim, runs), key=_size, default=None)


def _size(run: Run) -> tuple[int, list[int], list[int]]:
    places = [at for at, outcome in enumerate(run.outcomes) if outcome != SUCCEEDED]
    return len(places), places, [_RANK[run.outcomes[at]] for at in places]


def holds_for_all_fillings(
    whole: P,
    partial: Mapping[str, str],
    claim: Callable[[Run], bool],
    *,
    faults: frozenset[str] = frozenset(),
    constraint: Predicate | None = None,
) -> bool:
    """Whether the claim holds for every completion of the outcomes that are left open.

    With a ``constraint`` only the completions that it allows count; if there is none at all the
    answer is False, for a claim about nothing shows nothing.
    """
    system = System(whole, faults)
    unknown = set(partial) - set(system.paths)
    if unknown:
        raise ValueError(f"no such runner instances: {sorted(unknown)}")
    choices = [(partial[path],) if path in partial else system.kinds for path in system.paths]
    answers = {
        claim(system.run(outcomes))
        for outcomes in product(*choices)
        if constraint is None or constraint(dict(zip(system.paths, outcomes, strict=True)))
    }
    return answers == {True}
