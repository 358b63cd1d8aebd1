"""Explorations of the machines of behaviour trees, and what is read off them.

Each of them is compared, in the same process, with one that plays every instant
(``tests/analysis/machines/played.py``): both list the same configurations and steps. Processor
time, the least of three.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from benchmarks.common import circumstances, table
from gpsfsm.analysis.machines.decide import Judge
from gpsfsm.analysis.machines.search import Exploration
from gpsfsm.compile.instants import Instants
from gpsfsm.compile.plan_text import forest_in
from gpsfsm.compile.tree_machine import machine_of_tree
from gpsfsm.late import collecting_rarely
from tests.analysis.machines.played import Played
from tests.analysis.machines.random_machines import PLAIN

if TYPE_CHECKING:
    from collections.abc import Callable

MOST = 50_000


def watched(lanes: int) -> str:
    """Lanes that are tried again, beside each other, for as long as two conditions hold."""
    parts = "".join(
        f'<RetryUntilSuccessful num_attempts="2"><Sequence><Go{each}/><Look{each}/></Sequence>'
        "</RetryUntilSuccessful>"
        for each in range(lanes)
    )
    beside = f'<Parallel success_count="{lanes}" failure_count="1">{parts}</Parallel>'
    return f"<ReactiveSequence><Ready/><Safe/>{beside}</ReactiveSequence>"


def replanned(rounds: int) -> str:
    """A path that is planned again while it is followed, with pauses, and rounds of recoveries."""
    plan = "<RateController><Fallback><ReactiveSequence><Near/><Valid/></ReactiveSequence><Plan/>"
    pause = "<PathLongerOnApproach><Sequence><Cancel/><Pause/></Sequence></PathLongerOnApproach>"
    follow = '<RecoveryNode number_of_retries="1"><Follow/><Clear/></RecoveryNode>'
    recover = "<ReactiveFallback><Changed/><RoundRobin><Turn/><Back/></RoundRobin>"
    return (
        f'<RecoveryNode number_of_retries="{rounds}">'
        f"<PipelineSequence>{plan}</Fallback></RateController>"
        f"<ReactiveSequence>{pause}{follow}</ReactiveSequence></PipelineSequence>"
        f"{recover}</ReactiveFallback></RecoveryNode>"
    )


FAMILIES: tuple[tuple[str, Callable[[int], str], tuple[int, ...]], ...] = (
    ("lanes under two conditions", watched, (2, 3, 4)),
    ("replanned and recovered, rounds", replanned, (1, 2, 4)),
)


def least(work: Callable[[], Any]) -> tuple[float, Any]:
    """The processor time of some work, and its result."""
    times, result = [], None
    for _ in range(3):
        begin = time.process_time()
        with collecting_rarely():  # as a check does
            result = work()
        times.append(time.process_time() - begin)
    return min(times), result


def row(name: str, body: str) -> list[str]:
    """A line of the table."""
    text = f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>'
    forest = forest_in(text)
    assert forest is not None
    machine = machine_of_tree(forest)
    assert machine is not None
    automaton = machine.automaton
    allowed = [PLAIN] * len(automaton.runners)
    explored_s, explored = least(lambda: Exploration(automaton, allowed, limit=MOST))
    played_s, played = least(lambda: Played(automaton, allowed, most=MOST))
    assert explored.configurations == played.configurations
    assert explored.steps == played.steps
    judged_s, _ = least(lambda: Judge(explored).facts())
    return [
        name,
        f"{explored.reached:,}",
        f"{sum(map(len, explored.steps)):,}",
        f"{instants_of(lambda: Exploration(automaton, allowed, limit=MOST)):,}",
        f"{1000 * explored_s:,.0f}",
        f"{played_s / explored_s:.1f}",
        f"{judged_s / explored_s:.1f}",
    ]


def instants_of(work: Callable[[], Any]) -> int:
    """How many instants are played meanwhile."""
    after, played = Instants.after, 0

    def counted(*step: Any) -> Any:
        nonlocal played
        played += 1
        return after(*step)

    Instants.after = counted  # type: ignore[method-assign]
    try:
        work()
    finally:
        Instants.after = after  # type: ignore[method-assign]
    return played


def main() -> None:
    """Print the table."""
    head = ["tree", "configurations", "steps", "instants played", "explored, ms"]
    head += ["every instant played, times", "the facts, times"]
    where = circumstances()
    rows = [row(f"{name}: {size}", body(size)) for name, body, sizes in FAMILIES for size in sizes]
    print(where)
    print()
    print(table(head, rows))


if __name__ == "__main__":
    main()
