"""How long does a cold ``gpsfsm check`` take, compared with its libraries alone?

A is a new process that checks a plan of 10 runners; B is a new process of the same interpreter
that only imports lxml.etree, networkx, z3 and click. The two take turns, so that a change of the
machine's mood meets both; what counts is the ratio of the medians.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from benchmarks.common import GPSFSM, circumstances, median, percentile, run, table, write_plan

LIBRARIES = (sys.executable, "-c", "import lxml.etree, networkx, z3, click")
TARGET = 1.6


def measure(pairs: int) -> tuple[list[float], list[float]]:
    """Seconds of ``pairs`` runs of A and of B."""
    with tempfile.TemporaryDirectory() as folder:
        plan = Path(folder) / "plan.xml"
        write_plan(plan, "random", 4, 10)
        check = (*GPSFSM, "check", "--isolated", str(plan))
        ours: list[float] = []
        libraries: list[float] = []
        for pair in range(pairs + 2):  # the first two fill the caches
            a = run(check, cwd=Path(folder))
            b = run(LIBRARIES, cwd=Path(folder))
            if a.code not in (0, 1) or b.code != 0:
                raise SystemExit(f"the cold start failed:\n{a.err}{b.err}")
            if pair >= 2:
                ours.append(a.seconds)
                libraries.append(b.seconds)
    return ours, libraries


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=40)
    pairs = parser.parse_args().pairs
    where = circumstances()
    ours, libraries = measure(pairs)
    ratio = median(ours) / median(libraries)
    rows = [
        [name, *(f"{1000 * value:.0f}" for value in (median(found), percentile(found, 0.95)))]
        for name, found in (("`gpsfsm check plan.xml`", ours), ("the imports alone", libraries))
    ]
    print(where)
    print()
    print(table(["process", "median, ms", "95th percentile, ms"], rows))
    print()
    print(
        f"{pairs} pairs of processes, in turn. Ratio of the medians: **{ratio:.2f}** "
        f"(target: at most {TARGET})."
    )


if __name__ == "__main__":
    main()
