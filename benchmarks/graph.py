"""What does the graph cost? The checkout is compared with the last commit that made no graph.

Processes of both take turns, so that a change of the machine's mood meets both. *Warm* is a check
of a plan of 10 runners in a process that has checked some already; *large* is a whole process that
checks 100,000 runners; *cold* one that checks 10, beside one that only imports the libraries.
"""

from __future__ import annotations

import argparse
import io
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.common import GPSFSM, ROOT, Measured, circumstances, median, run, table, write_plan

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

BEFORE = "e83b624"
"""The last commit whose analyses read flat tuples that the compiler had made."""

PACKAGES = ("gpsfsm", "analysis", "grammars", "runners")

LIBRARIES = (sys.executable, "-c", "import lxml.etree, networkx, z3, click")
WARM = """
import sys, time
sys.path.insert(0, sys.argv[1])
import gpsfsm
text = open(sys.argv[2], "rb").read()
times = []
for number in range(320):
    started = time.perf_counter()
    gpsfsm.check(text, solver=sys.argv[3])
    times.append(time.perf_counter() - started)
print(1000 * sorted(times[20:])[150])
"""
LARGE = (("chain", (50_000,)), ("nested", (5, 10)))
MOST_WARM, MOST_LARGE, MOST_MEMORY, MOST_COLD = 1.1, 1.2, 1.5, 1.3


def checkout(folder: Path) -> None:
    """The files of the commit before."""
    command = ["git", "archive", BEFORE, *PACKAGES]
    archive = subprocess.run(command, cwd=ROOT, capture_output=True, check=True).stdout
    with tarfile.open(fileobj=io.BytesIO(archive)) as files:
        files.extractall(folder, filter="tar")
    for root in (folder, ROOT):  # also where the environment forbids to keep compiled modules
        packages = [str(root / name) for name in PACKAGES]
        subprocess.run([sys.executable, "-m", "compileall", "-q", *packages], check=True)


def command_of(root: Path) -> tuple[str, ...]:
    """The command ``gpsfsm`` of a checkout."""
    interpreter, option, code = GPSFSM
    return interpreter, option, f"import sys; sys.path.insert(0, {str(root)!r}); {code}"


def in_turn(commands: Sequence[Sequence[str]], rounds: int) -> list[list[Measured]]:
    """The results of each command, which take turns."""
    results: list[list[Measured]] = [[] for _ in commands]
    for _ in range(rounds):
        for number, command in enumerate(commands):
            done = run(command)
            if done.code not in (0, 1):
                raise SystemExit(f"no verdict:\n{done.err}")
            results[number].append(done)
    return results


def medians(results: list[list[Measured]], figure: Callable[[Measured], float]) -> list[float]:
    """The median of a figure, for each command."""
    return [median(map(figure, each)) for each in results]


def row(name: str, unit: str, figures: Sequence[float], most: float) -> list[str]:
    """A line of the table: before, now, how many times as much, and the aim."""
    before, now = figures
    shown = [f"{value:.0f}" if value >= 100 else f"{value:.2f}" for value in figures]
    return [f"{name}, {unit}", *shown, f"**{now / before:.2f}**", f"{most:.1f}"]


def rows_of(folder: Path, chosen: argparse.Namespace) -> list[list[str]]:
    roots = (folder, ROOT)
    plan = folder / "plan.xml"
    write_plan(plan, "random", 4, 10)
    rows = []
    for solver in ("auto", "structural"):
        commands = [(sys.executable, "-c", WARM, str(root), str(plan), solver) for root in roots]
        results = in_turn(commands, chosen.rounds)
        figures = medians(results, lambda done: float(done.out))
        rows.append(row(f"warm, 10 runners, `{solver}`", "ms", figures, MOST_WARM))
    for family, arguments in LARGE:
        large = folder / f"{family}.xml"
        write_plan(large, family, *arguments)
        options = ("check", "--isolated", "--format", "json", str(large))
        commands = [(*command_of(root), *options) for root in roots]
        results = in_turn(commands, chosen.large_rounds)
        times = medians(results, lambda done: done.seconds)
        memory = medians(results, lambda done: done.peak_mb)
        rows.append(row(f"100,000 runners, {family}", "s", times, MOST_LARGE))
        rows.append(row(f"100,000 runners, {family}", "MB", memory, MOST_MEMORY))
    commands = [LIBRARIES, (*command_of(ROOT), "check", "--isolated", str(plan))]
    results = in_turn(commands, 4 * chosen.rounds)
    cold = medians(results, lambda done: 1000 * done.seconds)
    rows.append(row("cold, 10 runners, beside the imports alone", "ms", cold, MOST_COLD))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--large-rounds", type=int, default=3)
    chosen = parser.parse_args()
    where = circumstances()
    with tempfile.TemporaryDirectory() as folder:
        checkout(Path(folder))
        rows = rows_of(Path(folder), chosen)
    print(where)
    print()
    head = ["what, and its unit", f"before ({BEFORE})", "now", "ratio", "aim: at most"]
    print(table(head, rows))


if __name__ == "__main__":
    main()
