"""What does it cost to grade an answer, and how does that grow with task and plan?

A thousand plans of ten runners are graded one after the other in one process, against a task of
seven steps, three of which have an alternative. What each plan deserves is known from how it is
made, and every grade is compared with that. The same plans are checked without a task as well:
what counts is the ratio. Then tasks of up to 1,000 steps meet plans of as many runners. All times
are those of the processor.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import gpsfsm
from benchmarks.common import circumstances, median, percentile, table
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.checking import CheckOptions
from gpsfsm.grading.grader import Grade, Grader
from gpsfsm.tasks.load import read_task

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

TARGET_MS = 10.0
PLANS = 1_000
SIZES = (10, 100, 1_000)
STEPS = 7
WITH_ALTERNATIVE = (1, 3, 5)
NAME = "nav2_capabilities/WaypointRunner"


@dataclass(frozen=True, slots=True)
class Case:
    """An answer, and the grade that it deserves."""

    kind: str
    text: str
    grade: Grade


def drive(place: int, depth: int = 1) -> str:
    return f'{"    " * depth}<Runner interface="{NAME}" provider="{NAME}" x="{place}" y="0.5"/>'


def recovery(place: int) -> str:
    return f'    <Control type="recovery">\n{drive(place, 2)}\n    </Control>'


def parts() -> list[list[str]]:
    """A right plan: for each step its lines."""
    return [
        [drive(step), recovery(step + 100)] if step in WITH_ALTERNATIVE else [drive(step)]
        for step in range(STEPS)
    ]


def written(steps: Sequence[Sequence[str]]) -> str:
    return "\n".join(["<Plan>", *(line for step in steps for line in step), "</Plan>", ""])


def right(_: random.Random) -> tuple[str, Grade]:
    return written(parts()), Grade.SUCCESS


def nested(rng: random.Random) -> tuple[str, Grade]:
    steps = parts()
    cut = rng.randrange(1, STEPS)
    steps[cut] = ['    <Control type="sequential">', *steps[cut]]
    steps[-1] = [*steps[-1], "    </Control>"]
    return written(steps), Grade.SUCCESS


def swapped(rng: random.Random) -> tuple[str, Grade]:
    steps = parts()
    one, other = rng.sample(range(STEPS), 2)
    steps[one], steps[other] = steps[other], steps[one]
    return written(steps), Grade.PARTIAL


def elsewhere(rng: random.Random) -> tuple[str, Grade]:
    steps = parts()
    steps[rng.randrange(STEPS)][0] = drive(rng.randrange(200, 300))
    return written(steps), Grade.PARTIAL


def beside(rng: random.Random) -> tuple[str, Grade]:
    steps = parts()
    one = rng.randrange(STEPS - 1)
    steps[one] = ['    <Control type="parallel_all">', *steps[one]]
    steps[one + 1] = [*steps[one + 1], "    </Control>"]
    return written(steps), Grade.PARTIAL


def unclosed(rng: random.Random) -> tuple[str, Grade]:
    text, grade = rng.choice((right, swapped))(rng)
    lost = text.replace("</Plan>\n", "")
    return lost, Grade.PARTIAL if grade is Grade.SUCCESS else Grade.FAILED


KINDS: dict[str, Callable[[random.Random], tuple[str, Grade]]] = {
    "right": right,
    "right, nested": nested,
    "two steps swapped": swapped,
    "to another place": elsewhere,
    "two steps at once": beside,
    "last tag missing": unclosed,
}


def task_text(steps: int, alternatives: Sequence[int] = ()) -> bytes:
    lines = ["interface: WaypointRunner", "places:"]
    for step in range(steps):
        lines.append(f"  p{step}: {{x: {step}, y: 0.5}}")
        if step in alternatives:
            lines.append(f"  q{step}: {{x: {step + 100}, y: 0.5}}")
    lines.append("steps:")
    for step in range(steps):
        lines.append(f"  - do: p{step}")
        if step in alternatives:
            lines.append(f"    else: q{step}")
    return "\n".join(lines).encode()


def timed(work: Callable[[], Grade | None]) -> tuple[float, Grade | None]:
    """Milliseconds of the processor, and what came out.

    Grading waits for nothing, and so other work on the machine counts less than on the clock.
    """
    started = time.process_time()
    outcome = work()
    return 1000 * (time.process_time() - started), outcome


def graded(grader: Grader, case: Case) -> float:
    took, grade = timed(lambda: grader.grade(case.text, "answer.xml").grade)
    if grade is not case.grade:
        raise SystemExit(f"{case.kind}: the grade is {grade}, not {case.grade}:\n{case.text}")
    return took


def checked(case: Case) -> float:
    def work() -> None:
        gpsfsm.check(case.text)

    return timed(work)[0]


def many(plans: int) -> tuple[list[list[str]], float, float, float]:
    """Rows of a table by kind; the medians of grading, without z3 too, and of checking."""
    rng = random.Random(6)  # noqa: S311  (plans, not secrets)
    kinds = list(KINDS)
    cases = [
        Case(kinds[number % len(kinds)], *KINDS[kinds[number % len(kinds)]](rng))
        for number in range(plans)
    ]
    task = read_task(task_text(STEPS, WITH_ALTERNATIVE))
    grader = Grader(task)
    alone = Grader(task, CheckOptions(analysis=AnalysisOptions(solver="structural")))
    for case in cases[: len(kinds)]:  # imports are not what is asked here
        graded(grader, case)
        graded(alone, case)
        checked(case)
    grading: dict[str, list[float]] = defaultdict(list)
    searching: dict[str, list[float]] = defaultdict(list)
    checking: dict[str, list[float]] = defaultdict(list)
    for case in cases:
        grading[case.kind].append(graded(grader, case))
        searching[case.kind].append(graded(alone, case))
        checking[case.kind].append(checked(case))
    ours = [took for seconds in grading.values() for took in seconds]
    quick = [took for seconds in searching.values() for took in seconds]
    plain = [took for seconds in checking.values() for took in seconds]
    named = [(kind, grading[kind], searching[kind], checking[kind]) for kind in kinds]
    rows = [row(*each) for each in [*named, ("all", ours, quick, plain)]]
    return rows, median(ours), median(quick), median(plain)


def row(
    name: str, grading: Sequence[float], alone: Sequence[float], checking: Sequence[float]
) -> list[str]:
    slow = (percentile(grading, 0.95), max(grading))
    figures = (median(grading), *slow, median(alone), median(checking))
    return [name, str(len(grading)), *(f"{figure:.2f}" for figure in figures)]


def long_right(size: int) -> tuple[bytes, str, Grade]:
    return task_text(size), written([[drive(step)] for step in range(size)]), Grade.SUCCESS


def long_guarded(size: int) -> tuple[bytes, str, Grade]:
    steps = range(size // 2)
    text = written([[drive(step), recovery(step + 100)] for step in steps])
    return task_text(size // 2, steps), text, Grade.SUCCESS


def long_swapped(size: int) -> tuple[bytes, str, Grade]:
    steps = [[drive(step)] for step in range(size)]
    steps[-2:] = steps[:-3:-1]
    return task_text(size), written(steps), Grade.PARTIAL


def long_at_once(size: int) -> tuple[bytes, str, Grade]:
    steps = [drive(step, 2) for step in range(size)]
    whole = ['    <Control type="parallel_all">', *steps, "    </Control>"]
    return task_text(size), written([whole]), Grade.PARTIAL


LARGE = {
    "right": long_right,
    "right, each step with an alternative": long_guarded,
    "last two steps swapped": long_swapped,
    "all steps at once": long_at_once,
}


def large() -> list[list[str]]:
    """Tasks of many steps against plans of many runners: seconds, and growth."""
    rows = []
    for name, made in LARGE.items():
        before = 0.0
        for size in SIZES:
            content, text, grade = made(size)
            loading = time.process_time()
            task = read_task(content)
            loading = time.process_time() - loading
            case = Case(name, text, grade)
            took = min(graded(Grader(task), case) for _ in range(2)) / 1000
            growth = f"{took / before:.1f}x" if before else ""
            sizes = [f"{len(task.steps):,}", f"{size:,}"]
            rows.append([name, *sizes, f"{loading:.3f}", f"{took:.3f}", growth])
            before = took
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plans", type=int, default=PLANS)
    plans = parser.parse_args().plans
    where = circumstances()
    rows, ours, quick, plain = many(plans)
    print(where)
    print()
    head = ["plans of 10 runners", "number", "median, ms", "95th percentile, ms", "slowest, ms"]
    head += ["--solver structural, median, ms", "checked without a task, median, ms"]
    print(table(head, rows))
    print()
    print(
        f"Median per plan: **{ours:.2f} ms** with the proof by z3, {quick:.2f} ms without "
        f"(target: under {TARGET_MS:.0f} ms); a check without a task takes {plain:.2f} ms."
    )
    print()
    head = ["plan", "steps", "runners", "reading the task, s", "grading, s", "growth"]
    print(table(head, large()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
