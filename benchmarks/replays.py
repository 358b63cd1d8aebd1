"""What do scenarios cost: finding, replaying and telling them, as part of a check?

Each figure is the processor time of one check in a process of its own, the least of some rounds,
and of that the time in which scenarios are made. With ``--before`` a checkout of an earlier commit
takes turns with this one:

    git worktree add --detach /tmp/before COMMIT
    python benchmarks/replays.py --before /tmp/before
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.analysis.context import Context

ROOT = Path(__file__).resolve().parents[1]
ROUNDS = 2
PLANS = (
    ("nested", "10", "2"),
    ("nested", "4", "10"),
    ("nested", "13", "2"),
    ("random", "7", "1000"),
    ("random", "7", "10000"),
    ("chain", "5000"),
)
MORE = 1_000
"""Scenarios per rule of the last line, for which there are more findings than scenarios else."""


class Cost(NamedTuple):
    """Seconds of a check, those for its scenarios, and the numbers of findings and scenarios."""

    check: float
    scenarios: float
    findings: int
    shown: int


def one(max_scenarios: int) -> Cost:
    """The cost of a check of the plan in standard input, in this process."""
    import gpsfsm
    from gpsfsm.analysis.context import Context

    spent = [0.0]
    gpsfsm.check("<Plan/>")  # what is loaded late
    Context.scenario = timed(Context.scenario, spent)  # type: ignore[method-assign]
    text = sys.stdin.read()
    start = time.process_time()
    report = gpsfsm.check(text, solver="structural", max_scenarios=max_scenarios)
    check = time.process_time() - start
    shown = sum(finding.scenario is not None for finding in report.findings)
    return Cost(check, spent[0], len(report.findings), shown)


def timed(function: Callable[..., object], spent: list[float]) -> Callable[..., object]:
    """A method of a context that adds its processor time to ``spent``."""

    def called(self: Context, *arguments: object) -> object:
        start = time.process_time()
        try:
            return function(self, *arguments)
        finally:
            spent[0] += time.process_time() - start

    return called


def measured(tree: Path, text: str, max_scenarios: int) -> Cost:
    """The cost of a check by the package in a checkout, in a new process."""
    command = [sys.executable, __file__, "--one", str(max_scenarios)]
    environment = os.environ | {"PYTHONPATH": str(tree)}
    done = subprocess.run(
        command, input=text, env=environment, capture_output=True, text=True, check=True
    )
    check, scenarios, findings, shown = done.stdout.split()
    return Cost(float(check), float(scenarios), int(findings), int(shown))


def row(name: str, text: str, max_scenarios: int, trees: list[Path]) -> list[str]:
    """A line of the table."""
    costs: dict[Path, list[Cost]] = {tree: [] for tree in trees}
    for _ in range(ROUNDS):
        for tree in trees:
            costs[tree].append(measured(tree, text, max_scenarios))
    cells: list[str] = [name]
    cells += map(str, costs[trees[0]][0][2:])
    cells += (f"{min(each.scenarios for each in costs[tree]):.2f}" for tree in trees)
    cells += (f"{min(each.check for each in costs[tree]):.2f}" for tree in trees)
    return cells


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--before", type=Path, help="a checkout of an earlier commit")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.one is not None:
        print(*one(chosen.one))
        return
    sys.path.insert(0, str(ROOT))
    from benchmarks.common import circumstances, table

    trees = [*filter(None, [chosen.before]), ROOT]
    when = ("before", "after") if chosen.before else ("now",)
    heads = [f"{what}, s, {each}" for what in ("scenarios", "check") for each in when]
    generate = str(ROOT / "corpus" / "generate.py")
    texts = {
        " ".join(plan): subprocess.run(
            [sys.executable, generate, *plan], capture_output=True, text=True, check=True
        ).stdout
        for plan in PLANS
    }
    first = next(iter(texts))
    rows = [row(name, text, 100, trees) for name, text in texts.items()]
    rows.append(row(f"{first}, --max-scenarios {MORE}", texts[first], MORE, trees))
    print(circumstances())
    print()
    print(table(["plan", "findings", "with a scenario", *heads], rows))


if __name__ == "__main__":
    main()
