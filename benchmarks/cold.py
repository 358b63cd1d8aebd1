"""How long does a cold ``gpsfsm check`` take, and what of that is not its libraries? And the gate?

Three new processes of the same interpreter take turns, so that a change of the machine's mood meets
them all: one checks a plan of 10 runners, one gates it, and one only imports lxml.etree, z3 and
click. z3 belongs to the libraries, since a plan of up to 200 runners is put to it. The own part is
the median of the differences of the first and the last.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from benchmarks.common import GPSFSM, circumstances, median, percentile, run, table, write_plan

LIBRARIES = (sys.executable, "-c", "import lxml.etree, z3, click")
CHECK, GATE, IMPORTS = "`gpsfsm check plan.xml`", "`gpsfsm gate plan.xml`", "the imports alone"
OWN_MS = 60
GATE_RATIO = 1.5


def measure(rounds: int) -> dict[str, list[float]]:
    """Milliseconds of ``rounds`` runs of each process."""
    with tempfile.TemporaryDirectory() as folder:
        plan = Path(folder) / "plan.xml"
        write_plan(plan, "random", 4, 10)
        commands = {
            CHECK: (*GPSFSM, "check", "--isolated", str(plan)),
            GATE: (*GPSFSM, "gate", str(plan)),
            IMPORTS: LIBRARIES,
        }
        times: dict[str, list[float]] = {name: [] for name in commands}
        for number in range(rounds + 2):  # the first two fill the caches
            for name, command in commands.items():
                done = run(command, cwd=Path(folder))
                if done.code not in ((0,) if name == IMPORTS else (0, 1)):
                    raise SystemExit(f"the cold start failed:\n{done.err}")
                if number >= 2:
                    times[name].append(1000 * done.seconds)
    return times


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=40)
    rounds = parser.parse_args().pairs
    where = circumstances()
    times = measure(rounds)
    check, gate, imports = (times[name] for name in (CHECK, GATE, IMPORTS))
    own = median([all_of_it - theirs for all_of_it, theirs in zip(check, imports, strict=True)])
    ratio = median([one / other for one, other in zip(gate, check, strict=True)])
    rows = [
        [name, *(f"{value:.0f}" for value in (median(each), percentile(each, 0.95)))]
        for name, each in times.items()
    ]
    print(where)
    print()
    print(table(["process", "median, ms", "95th percentile, ms"], rows))
    print()
    print(
        f"{rounds} rounds of processes, in turn. Own part of a check: **{own:.0f} ms** (target: at "
        f"most {OWN_MS}). Gate against check: **{ratio:.2f}** (target: at most {GATE_RATIO})."
    )


if __name__ == "__main__":
    main()
