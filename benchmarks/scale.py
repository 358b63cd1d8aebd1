"""Time and memory of ``gpsfsm check --format json`` as plans grow from 10 to 100,000 runners.

Every figure is one whole process, from the start of the interpreter to the last byte of output.
Its answers are compared with what is known of the family: a fast wrong answer is no result.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.common import GPSFSM, ROOT, Measured, circumstances, run, seconds, table, write_plan

if TYPE_CHECKING:
    from collections.abc import Callable

Facts = dict[str, Any]
SIZES = (10, 100, 1_000, 10_000, 100_000)
TIMEOUT_S = 300.0


@dataclass(frozen=True, slots=True)
class Family:
    """``arguments`` of the generator for a number of runners, and what the facts must say."""

    name: str
    arguments: Callable[[int], tuple[int, ...]]
    holds: Callable[[Facts, int], bool]


def _decades(runners: int) -> int:
    return len(str(runners)) - 1


def _chain(facts: Facts, runners: int) -> bool:
    return (
        facts["fewest_failures_to_give_up"] == 2
        and facts["join_deadlocks"] == []
        and len(facts["dangling"]) == runners // 2
    )


def _fanout(facts: Facts, runners: int) -> bool:
    return (
        facts["fewest_failures_to_give_up"] == 1
        and [each["effect"] for each in facts["join_deadlocks"]] == ["give_up"]
        and len(facts["dangling"]) == runners
    )


def _nested(facts: Facts, runners: int) -> bool:
    joins = runners > 10  # with one level there is no parallel control
    return bool(facts["join_deadlocks"]) is joins


def _random(facts: Facts, runners: int) -> bool:
    return len(facts["dangling"]) <= runners


FAMILIES = (
    Family("chain", lambda runners: (runners // 2,), _chain),
    Family("fanout", lambda runners: (runners - 2,), _fanout),
    Family("nested", lambda runners: (_decades(runners), 10), _nested),
    Family("random", lambda runners: (1, runners), _random),
)


def verdict_of(measured: Measured, family: Family, runners: int) -> str:
    """What is wrong with a result, or nothing."""
    if measured.timed_out:
        return f"no answer within {TIMEOUT_S:.0f} s"
    if measured.code not in (0, 1):
        lines = measured.err.strip().splitlines() or [f"exit {measured.code}"]
        return f"no verdict: {lines[-1]}"
    facts = json.loads(measured.out)["plans"][0]["facts"]
    common = (
        facts["runners"] == runners
        and facts["completes"] == "sometimes"
        and facts["gives_up"] == "sometimes"
        and facts["stuck"] == "never"
        and facts["unreachable"] == []
    )
    return "" if common and family.holds(facts, runners) else "WRONG ANSWER"


def growth(now: float, before: float | None) -> str:
    """How many times more than a decade before."""
    return "" if before is None else f"{now / before:.1f}x"


def measure(family: Family, runners: int) -> dict[str, Any]:
    """Run one check: its time, its memory, the size of the plan, what is wrong with the answer."""
    with tempfile.TemporaryDirectory() as folder:
        plan = Path(folder) / "plan.xml"
        write_plan(plan, family.name, *family.arguments(runners))
        command = (*GPSFSM, "check", "--isolated", "--format", "json", str(plan))
        completed = run(command, timeout_s=TIMEOUT_S, cwd=Path(folder))
        return {
            "seconds": completed.seconds,
            "peak_mb": completed.peak_mb,
            "plan_mb": plan.stat().st_size / 1e6,
            "output_mb": len(completed.out) / 1e6,
            "wrong": verdict_of(completed, family, runners),
        }


def measure_apart(family: Family, runners: int) -> dict[str, Any]:
    """Do the same in a process of its own, since reading the answer takes memory: common.run."""
    worker = (sys.executable, "-m", "benchmarks.scale", "--one", family.name, str(runners))
    done = run(worker, timeout_s=2 * TIMEOUT_S, cwd=ROOT)
    if done.code != 0:
        raise SystemExit(f"{family.name} {runners}: {done.err}")
    measured: dict[str, Any] = json.loads(done.out)
    return measured


def rows_of(family: Family, sizes: tuple[int, ...]) -> list[list[str]]:
    """The lines of the table for one family, up to the first size without an answer."""
    rows: list[list[str]] = []
    before: dict[str, Any] = {}
    for runners in sizes:
        measured = measure_apart(family, runners)
        row = [family.name, f"{runners:,}", f"{measured['plan_mb']:.1f}"]
        if measured["wrong"]:
            return [*rows, [*row, "", measured["wrong"], "", f"{measured['peak_mb']:.0f}", ""]]
        row += [
            f"{measured['output_mb']:.1f}",
            seconds(measured["seconds"]),
            growth(measured["seconds"], before.get("seconds")),
            f"{measured['peak_mb']:.0f}",
            growth(measured["peak_mb"], before.get("peak_mb")),
        ]
        rows.append(row)
        before = measured
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--largest", type=int, default=SIZES[-1])
    parser.add_argument("--one", nargs=2, metavar=("FAMILY", "RUNNERS"), help="one figure, as JSON")
    chosen = parser.parse_args()
    if chosen.one:
        (family,) = (family for family in FAMILIES if family.name == chosen.one[0])
        print(json.dumps(measure(family, int(chosen.one[1]))))
        return
    sizes = tuple(size for size in SIZES if size <= chosen.largest)
    where = circumstances()
    rows = [row for family in FAMILIES for row in rows_of(family, sizes)]
    print(where)
    print()
    head = ["family", "runners", "plan, MB", "answer, MB", "time, s", "growth"]
    print(table([*head, "peak memory, MB", "growth"], rows))


if __name__ == "__main__":
    main()
