"""What a user sees of real plans, and how often the gate is right: the tables of docs/findings.md.

Experiment 1 is the part of the paper's experiment that the development material holds: plans that
three models wrote for five navigation tasks, graded by people. Each is checked with default
settings, and put to the gate with its task, for the paper's machine and for each engine. Then one
defect at a time is planted in the plans that people graded a success (the operators of
``gpsfsm fuzz --mutate``), and the gate decides again.

Whether a plan with a defect is safe is judged without the gate, its rules and the tasks: the
executor plays all scenarios, and ``does_the_task`` walks the steps of the task beside each run.

    safe       diff says that it does the same as the plan it was made of
    unsafe     diff says that it does not, and a run misses the task
    otherwise  it does something else, and no run misses the task

Nothing here depends on the machine.
"""

from __future__ import annotations

import os
import statistics
import sys
from collections import Counter, defaultdict
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.common import ROOT, table
from gpsfsm.api import check_options
from gpsfsm.checking import check_text
from gpsfsm.equivalence import compare
from gpsfsm.errors import GpsfsmError
from gpsfsm.execution.records import Status
from gpsfsm.fuzzing.operators import Tree, operators
from gpsfsm.fuzzing.runs import play
from gpsfsm.fuzzing.subject import Fate, TimedScenario, subject_of
from gpsfsm.gating import GateOptions
from gpsfsm.gating.deciding import gate_text
from gpsfsm.grading.experiment import read_experiment
from gpsfsm.grading.grader import Grade
from gpsfsm.model.finding import Severity
from gpsfsm.model.report import Report
from gpsfsm.report import render
from gpsfsm.syntax import parse
from gpsfsm.tasks.load import load_task

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.fuzzing.runs import Run
    from gpsfsm.gating.deciding import Verdict
    from gpsfsm.grading.experiment import Answer
    from gpsfsm.model.plan import Plan
    from gpsfsm.tasks.task import Task

EXPERIMENT = Path(os.environ.get("GPSFSM_CORPUS", ROOT.parent / "shared/corpus")) / "experiment1"
TASKS = ROOT / "experiments" / "navigation"
ENGINES = ("paper", "fabric-v1", "fabric-v2")
A, B, C, D, E, F = (2.0, -0.5), (0.0, 2.0), (-2.0, 0.0), (0.0, -2.0), (1.0, 3.0), (-3.0, -1.0)
STEPS = {
    1: ((A,),),
    2: ((A,), (B,), (C,), (D,)),
    3: ((A,), (E, B), (C,), (D,)),
    4: ((A,), (E, B), (F, C), (D,)),
    5: ((A, B), (E, B), (F, C), (D, C)),
}
"""The five tasks once more, in code: the places of each step, the first choice first."""
MOST_RUNNERS = 12
"""Of a plan with more runners not all scenarios are played; there is none in the material."""


# --- the judge of runs ---------------------------------------------------------------------------


def does_the_task(run: Run, task: int) -> bool:
    """True if a run goes to the places of the task in order, and gives up only where it must.

    For a task of the steps (A), (E, else B), a run that fails at E must go to B next; a run that
    fails at A, or at E and B, must give up right there and go nowhere else.
    """
    moves = [
        (event.kind, _place(run, event.number))
        for event in run.events
        if event.kind in ("STARTED", "SUCCEEDED", "FAILED")
    ]
    expected = iter(moves)
    for step in STEPS[task]:
        for place in step:
            if next(expected, None) != ("STARTED", place):
                return False
            kind, where = next(expected, ("", None))
            if where != place or kind not in ("SUCCEEDED", "FAILED"):
                return False
            if kind == "SUCCEEDED":
                break
        else:
            return run.status is Status.GAVE_UP and next(expected, None) is None
    return run.status is Status.COMPLETED and next(expected, None) is None


def _place(run: Run, number: int) -> tuple[float, float] | None:
    """Where a runner goes; None if it is no waypoint runner, or has no such numbers."""
    runner = run.runner(number)
    values = {each.name: each.text for each in runner.attributes}
    if not values.get("interface", "").endswith("/WaypointRunner"):
        return None
    try:
        return float(values["x"]), float(values["y"])
    except (KeyError, ValueError):
        return None


def misses(text: str, task: int) -> bool:
    """True if some run of the plan misses the task, or the plan cannot be run at all."""
    try:
        subject = subject_of(text, faults=["failed"])
    except GpsfsmError:
        return True
    count = len(subject.plan.runners)
    assert count <= MOST_RUNNERS, f"{count} runners: not all of their scenarios can be played"
    for fates in product((Fate.SUCCEEDED, Fate.FAILED), repeat=count):
        acts = {number: subject.act(number, fate) for number, fate in enumerate(fates)}
        scenario = TimedScenario(tuple(acts[number] for number in range(count)))
        if not does_the_task(play(subject, scenario), task):
            return True
    return False


# --- planted defects -----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Mutant:
    """A plan with one defect: the operator, whether diff says it is the same, and whether it errs.

    ``same`` is None if it is not decided, or if the text is no plan any more.
    """

    operator: str
    text: str
    task: int
    same: bool | None
    unsafe: bool


def mutants(answers: Sequence[Answer]) -> Iterator[Mutant]:
    """The mutants of the plans that people graded a success, each text of a task once."""
    seen: set[tuple[int, str]] = set()
    for answer in answers:
        if answer.key.cell.system != "fabric" or answer.human is not Grade.SUCCESS:
            continue
        task = answer.key.cell.task
        plan = parse(Path(str(answer.path)).read_bytes(), file="plan.xml").plan
        assert plan is not None
        assert not misses(str(Tree(plan)), task), f"{answer.path} misses its task"
        seen.add((task, str(Tree(plan))))
        for operator in operators():
            for mutation in operator.mutations(plan):
                tree = Tree(plan)
                mutation.change(tree)
                text = str(tree)
                if (task, text) not in seen:
                    seen.add((task, text))
                    same = _same(plan, text)
                    yield Mutant(operator.name, text, task, same, not same and misses(text, task))


def _same(plan: Plan, text: str) -> bool | None:
    after = parse(text, file="plan.xml").plan
    if after is None:
        return None
    try:
        return compare(plan, after) is None
    except GpsfsmError:
        return None


# --- tables --------------------------------------------------------------------------------------


def gate(text: str | bytes, task: Task, engine: str, *, trees: bool = False) -> Verdict:
    """The verdict of the gate on a plan with its task; ``trees``: with ``--allow-trees``."""
    check = replace(check_options(engine=engine), task=task, trees=trees)
    return gate_text(text, "plan.xml", GateOptions(check=check))


def share(part: int, whole: int) -> str:
    """A count as a share: ``3 of 60 (5.0 %)``."""
    return f"{part} of {whole} ({100 * part / whole:.1f} %)" if whole else "none"


def seen_by_users(answers: Sequence[Answer], tasks: dict[int, Task]) -> list[list[str]]:
    """One row per system and model: warnings, lines, and the gate's acceptances by grade."""
    rows = defaultdict(list)
    for answer in answers:
        if answer.human is not None:
            rows[answer.key.cell.system, answer.key.cell.model].append(answer)
            rows[answer.key.cell.system, "~all"].append(answer)
    return [
        [system, model.removeprefix("~"), *_row(rows[system, model], tasks)]
        for system, model in sorted(rows)
    ]


def _row(answers: Sequence[Answer], tasks: dict[int, Task]) -> list[str]:
    counts: Counter[str] = Counter()
    lines: list[int] = []
    for answer in answers:
        text, cell = Path(str(answer.path)).read_bytes(), answer.key.cell
        accepted = gate(text, tasks[cell.task], "paper", trees=cell.system != "fabric").accepted
        if answer.human is not Grade.SUCCESS:
            counts["unsafe"] += 1
            counts["missed"] += accepted
            continue
        report = check_text(text, "plan.xml", check_options())
        counts["safe"] += 1
        counts["quiet"] += all(each.severity is Severity.INFO for each in report.findings)
        counts["accepted"] += accepted
        lines.append(render(Report((report,))).count("\n"))
    return [
        share(counts["quiet"], counts["safe"]),
        f"{statistics.median(lines):g}" if lines else "",
        share(counts["accepted"], counts["safe"]),
        share(counts["safe"] - counts["accepted"], counts["safe"]),
        share(counts["missed"], counts["unsafe"]),
    ]


def figures(name: str, cases: Sequence[tuple[bool, Verdict]]) -> list[str]:
    """The three figures of a gate; a case is whether the plan is safe, and the verdict."""
    safe = [verdict for is_safe, verdict in cases if is_safe]
    unsafe = [verdict for is_safe, verdict in cases if not is_safe]
    undecided = sum(verdict.reason.exit_code == 2 for _, verdict in cases)
    return [
        name,
        share(sum(each.accepted for each in unsafe), len(unsafe)),
        share(sum(each.accepted for each in safe), len(safe)),
        share(undecided, len(cases)),
    ]


def graded(
    answers: Sequence[Answer], tasks: dict[int, Task], engine: str
) -> list[tuple[bool, Verdict]]:
    """The plans that people graded, safe or not, with the verdicts; "": the behaviour trees."""
    return [
        (
            one.human is Grade.SUCCESS,
            gate(
                Path(str(one.path)).read_bytes(),
                tasks[one.key.cell.task],
                engine or "paper",
                trees=not engine,
            ),
        )
        for one in answers
        if one.human is not None and (one.key.cell.system == "fabric") == bool(engine)
    ]


def main() -> int:
    if not EXPERIMENT.is_dir():
        print(f"the experiment is not here: {EXPERIMENT} (GPSFSM_CORPUS)", file=sys.stderr)
        return 2
    answers = read_experiment(str(EXPERIMENT))
    tasks = {number: load_task(str(TASKS / f"task{number}.yaml")) for number in STEPS}
    head = ["system", "model", "S without a warning", "lines, median", "S accepted"]
    head += ["false alarms: S not accepted", "missed: F and P accepted"]
    print(table(head, seen_by_users(answers, tasks)))
    rows = [
        figures(f"experiment 1, `{engine}`", graded(answers, tasks, engine)) for engine in ENGINES
    ]
    rows.append(figures("its behaviour trees, `--allow-trees`", graded(answers, tasks, "")))
    planted = list(mutants(answers))
    judged = [(one, gate(one.text, tasks[one.task], "paper")) for one in planted]
    counted = [(one, verdict) for one, verdict in judged if one.same or one.unsafe]
    rows.append(figures("planted defects", [(not one.unsafe, verdict) for one, verdict in counted]))
    print()
    print(table(["plans", "unsafe accepted", "safe authorised", "undecided"], rows))
    other = [verdict for one, verdict in judged if not one.same and not one.unsafe]
    kinds = Counter(one.operator for one in planted)
    print()
    print(
        f"{len(planted)} different plans with one defect ("
        + ", ".join(f"{name} {number}" for name, number in sorted(kinds.items()))
        + f"); {len(other)} of them behave differently from the original but miss no task, and the "
        f"gate accepts {sum(each.accepted for each in other)} of these."
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
