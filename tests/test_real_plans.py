"""Plans and answers that language models really wrote, with human labels."""

from __future__ import annotations

import csv
import json
import re
import statistics
from collections import Counter
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import pytest
from lxml import etree

import gpsfsm
from benchmarks import findings as figures
from gpsfsm.api import check_options
from gpsfsm.fixing.suggest import Suggestions
from gpsfsm.gating import GateOptions
from gpsfsm.gating.deciding import gate_text
from gpsfsm.grading.grader import Grade
from gpsfsm.model.finding import Severity
from gpsfsm.model.report import Report
from gpsfsm.model.report import Verdict as CheckVerdict
from gpsfsm.report import RenderOptions, render
from gpsfsm.tasks.load import load_task
from tests.cases import ALL

if TYPE_CHECKING:
    from pathlib import Path

    from gpsfsm.gating.deciding import Verdict
    from gpsfsm.model.report import PlanReport


@cache
def checked(folder: Path) -> dict[str, PlanReport]:
    """The reports on the plans of a folder, by their path in it."""
    reports = gpsfsm.check([folder]).plans
    return {report.path.removeprefix(f"{folder}/"): report for report in reports}


def test_every_plan_gets_a_verdict(shared_corpus: Path) -> None:
    folders = [shared_corpus / "experiment1" / "fabric", shared_corpus / "plans"]
    folders.append(shared_corpus / "experiment2")
    plans = [plan for folder in folders for plan in checked(folder).values()]
    assert len(plans) > 370
    assert all(plan.verdict in (CheckVerdict.ACCEPTED, CheckVerdict.REJECTED) for plan in plans)
    for plan in plans:
        if plan.verdict is CheckVerdict.ACCEPTED:
            assert plan.facts is not None
            assert plan.facts.stuck == "never"


def test_no_plan_that_people_judged_a_success_is_rejected(shared_corpus: Path) -> None:
    """Of the plans for which a label is known; partial ones may be either."""
    root = shared_corpus / "experiment1"
    with (root / "labels.csv").open() as file:
        labels = {row["path"]: row["human"] for row in csv.DictReader(file)}
    fabric = {path: human for path, human in labels.items() if path.startswith("fabric/")}
    reports = checked(root / "fabric")
    verdicts = {path: reports[path.removeprefix("fabric/")].verdict for path in fabric}
    successes = [path for path, human in fabric.items() if human == "S"]
    assert len(successes) > 80
    assert {verdicts[path] for path in successes} == {CheckVerdict.ACCEPTED}


def test_no_success_is_warned_of_misplaced_recoveries_or_single_units(shared_corpus: Path) -> None:
    root = shared_corpus / "experiment1"
    with (root / "labels.csv").open() as file:
        labels = {row["path"]: row["human"] for row in csv.DictReader(file)}
    units = Counter[str]()
    for path, report in checked(root / "fabric").items():
        for finding in report.findings:
            if finding.rule in ("GP316", "GP317"):
                assert finding.rule == "GP317"
                assert finding.severity is Severity.INFO
                units[labels[f"fabric/{path}"]] += 1
    assert units == {"P": 20, "S": 8}


def test_what_a_model_is_told_to_write_is_well_formed(shared_corpus: Path) -> None:
    """All corrections of the plans of the experiment: each element that begins ends."""
    fragments = 0
    for shape in sorted((shared_corpus / "experiment1" / "fabric").rglob("01.xml")):
        options = RenderOptions(correct=Suggestions())
        text = render(gpsfsm.check([shape]), "llm", options=options)
        for fragment in re.findall(r"   Write instead:\n((?:   .+\n)+)", text):
            etree.fromstring(f"<a>{fragment.replace('…', '')}</a>")
            fragments += 1
    assert fragments > 5


def test_goals_inside_recoveries_are_told(shared_corpus: Path) -> None:
    """The shapes that people marked down because the recovery holds the goal itself."""
    root = shared_corpus / "experiment1"
    with (root / "labels.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["system"] == "fabric"]
    reports = checked(root / "fabric")
    for row in rows:
        report = reports[row["path"].removeprefix("fabric/")]
        rules = {finding.rule for finding in report.findings}
        if row["shape"] == "F008" or row["path"].endswith("gpt-4o/zeroshot/task3/05.xml"):
            assert "GP310" in rules, row["path"]
        elif row["shape"] == "F011":
            assert "GP307" in rules, row["path"]
        if row["human"] == "S":
            assert not rules & {"GP307", "GP310"}, row["path"]


def test_every_raw_answer_gets_a_verdict(shared_corpus: Path) -> None:
    answers = shared_corpus / "experiment1" / "responses.jsonl"
    with answers.open() as lines:
        texts = [_answer(json.loads(line)) for line in lines]
    reports = [gpsfsm.check(text.encode(), from_response=True).plans[0] for text in texts]
    undecided = [report for report in reports if report.verdict is CheckVerdict.UNDECIDED]
    assert not undecided
    accepted = sum(report.verdict is CheckVerdict.ACCEPTED for report in reports)
    assert accepted > 100


def _answer(record: dict[str, object]) -> str:
    return next(
        str(record[name]) for name in ("response", "answer", "text", "output") if name in record
    )


def test_plans_that_people_judged_a_success_have_no_warning(shared_corpus: Path) -> None:
    """95 % of them at default settings, in 12 lines of text or fewer (median)."""
    successes = [report for human, report in _graded(shared_corpus) if human == "S"]
    assert len(successes) == 100
    quiet = [
        report
        for report in successes
        if all(finding.severity is Severity.INFO for finding in report.findings)
    ]
    assert len(quiet) >= 95
    lines = [render(Report((report,))).count("\n") for report in successes]
    assert statistics.median(lines) <= 12


def _graded(shared_corpus: Path) -> list[tuple[str, PlanReport]]:
    root = shared_corpus / "experiment1"
    with (root / "labels.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["system"] == "fabric"]
    reports = checked(root / "fabric")
    return [(row["human"], reports[row["path"].removeprefix("fabric/")]) for row in rows]


@pytest.mark.parametrize("engine", ["paper", "fabric-v1", "fabric-v2"])
def test_the_gate_agrees_with_people(shared_corpus: Path, engine: str) -> None:
    """With the task: all successes may run, but for those that an engine runs otherwise.

    These are eight plans of one shape, a parallel_any that holds the goal and, as its recovery, the
    alternative. The engines start both at once, and then wait for ever (GP703).
    """
    root = shared_corpus / "experiment1"
    with (root / "labels.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["system"] == "fabric"]
    accepted: Counter[str] = Counter()
    unlike = 0
    verdicts: dict[tuple[str, bytes], Verdict] = {}
    for row in rows:
        text = (root / row["path"]).read_bytes()
        key = row["task"], text
        if key not in verdicts:
            task = load_task(str(figures.TASKS / f"task{row['task']}.yaml"))
            check = replace(check_options(engine=engine), task=task, trees=False)
            verdicts[key] = gate_text(text, row["path"], GateOptions(check=check))
        accepted[row["human"]] += verdicts[key].accepted
        if row["human"] == "S" and not verdicts[key].accepted:
            assert "GP703" in {each.rule for each in verdicts[key].findings}
            unlike += 1
    assert unlike == (0 if engine == "paper" else 8)
    assert accepted["S"] == 100 - unlike
    assert accepted["P"] == accepted["F"] == accepted["?"] == 0


def test_the_gate_accepts_no_planted_defect(shared_corpus: Path) -> None:
    """One defect each in plans that were a success; all their runs are played to judge them.

    In every 36th of these plans; CASES=all takes every 12th.
    """
    answers = figures.read_experiment(str(shared_corpus / "experiment1"))
    graded = [each for each in answers if each.human is Grade.SUCCESS]
    tasks = {
        number: load_task(str(figures.TASKS / f"task{number}.yaml")) for number in figures.STEPS
    }
    judged = [
        (one, figures.gate(one.text, tasks[one.task], "paper"))
        for one in figures.mutants(graded[:: 12 if ALL else 36])
    ]
    unsafe = [verdict for one, verdict in judged if one.unsafe]
    safe = [verdict for one, verdict in judged if one.same]
    assert len(unsafe) > (100 if ALL else 30)
    assert len(safe) > (5 if ALL else 1)
    assert not any(verdict.accepted for verdict in unsafe)
    assert sum(verdict.accepted for verdict in safe) > 0.95 * len(safe)
    assert all(verdict.reason.exit_code != 2 for _, verdict in judged)
