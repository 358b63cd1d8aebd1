"""What it costs to hand plans to other processes: 1,000 plans in each engine of ``--jobs``.

The overhead is that of the transport alone: plans go out and reports of the usual size come back,
and nothing is done in between. The check, of 200 plans, is the real one, and its results are
compared as bytes.
"""

from __future__ import annotations

import argparse
import importlib.util
import subprocess
import sys
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import benchmarks.workers as importable  # for the workers: this module is __main__
from benchmarks.common import ROOT, circumstances, seconds, table
from gpsfsm.api import check_options
from gpsfsm.checking import check_text, failed
from gpsfsm.checking.parallel import CheckWork
from gpsfsm.model.report import Report
from gpsfsm.report import render
from gpsfsm.workers import engine_of, map_items

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.checking.parallel import Text
    from gpsfsm.model.report import PlanReport

PLANS = 1_000
CHECKED = 200
WAYPOINTS = 5
ENGINES = ("1", "2", "ray")


@dataclass(frozen=True, slots=True)
class Nothing:
    """Answers every plan with the same report."""

    report: PlanReport

    def __call__(self, _item: Text) -> PlanReport:
        return self.report


def plans() -> list[Text]:
    """Chains with a recovery for each waypoint, all different."""
    script = str(ROOT / "corpus" / "generate.py")
    command = [sys.executable, script, "chain", str(WAYPOINTS)]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return [
        (f"p{number:04}.xml", text.replace('x="', f'x="{number}', 1).encode())
        for number in range(PLANS)
    ]


def lost(item: Text, how: str) -> PlanReport:
    return failed(item[0], how)


def timed(
    jobs: str, work: Callable[[Text], PlanReport], items: list[Text]
) -> tuple[float, float, list[PlanReport]]:
    """The seconds up to the first result, those after it, and the results."""
    began = time.perf_counter()
    results = map_items(engine_of(jobs, len(items)), work, items, lost=lost)
    reports = [next(results)]
    first = time.perf_counter()
    reports += results
    return first - began, time.perf_counter() - first, reports


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--engines", default=",".join(ENGINES))
    chosen = parser.parse_args().engines.split(",")
    if importlib.util.find_spec("ray") is None:
        raise SystemExit("this needs the extra 'ray'")
    where = circumstances()
    items = plans()
    options = check_options()
    nothing = importable.Nothing(check_text(items[0][1], items[0][0], options))
    rows, reference = [], ""
    for jobs in chosen:
        start, overhead, _ = timed(jobs, nothing, items)
        first, rest, reports = timed(jobs, CheckWork(options), items[:CHECKED])
        written = render(Report(tuple(reports)), "json")
        reference = reference or written
        if written != reference:
            raise SystemExit(f"--jobs {jobs} gives another report")
        rows.append(
            [
                f"`--jobs {jobs}`",
                seconds(start),
                f"{overhead * 1e3:.0f}",
                seconds(first),
                seconds(rest),
                f"{(CHECKED - 1) / rest:.0f}",
            ]
        )
    print(where)
    print()
    head = ["engine", "start, s", "overhead of 1,000 plans, ms", "first report, s"]
    print(table([*head, "the others, s", "plans/s"], rows))
    print("\nThe reports are the same, byte for byte.")


if __name__ == "__main__":
    main()
