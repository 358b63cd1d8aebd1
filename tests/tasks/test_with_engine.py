"""Tasks are decided by the semantics of the paper; with an engine the report says so."""

from __future__ import annotations

from dataclasses import replace

from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.model.story import ENGINES, PAPER_ENGINE
from gpsfsm.tasks.load import read_task

TASK = read_task(b"interface: GoRunner\nplaces: {A: {x: 1}, B: {x: 2}}\nsteps: [{do: A}, {do: B}]")
RUNNER = '<Runner interface="demo/GoRunner" provider="demo/GoRunner" x="{}"/>'
PLAN = "<Plan>{}</Plan>".format


def test_a_report_on_an_engine_says_how_the_task_was_decided() -> None:
    paper = CheckOptions(task=TASK)
    wrong = PLAN(RUNNER.format(1))
    for engine in ENGINES:
        report = check_text(wrong, "a.xml", replace(paper, engine=engine))
        assert "GP601" in {finding.rule for finding in report.findings}
        notes = [note for note in report.notes if "decided by the semantics of the paper" in note]
        assert len(notes) == (engine != PAPER_ENGINE)
        silent = check_text(wrong, "a.xml", CheckOptions(engine=engine))
        assert not any("the task" in note for note in silent.notes)


def test_where_an_engine_leaves_a_task_that_the_plan_fulfils_a_finding_tells_that_it_differs() -> (
    None
):
    """The engine starts what a parallel_any guards at once; the paper waits for the failure."""
    right = PLAN(
        RUNNER.format(1)
        + f'<Control type="parallel_any">{RUNNER.format(2)}<Control type="recovery">'
        + RUNNER.format(3)
        + "</Control></Control>"
    )
    task = read_task(
        b"interface: GoRunner\nplaces: {A: {x: 1}, B: {x: 2}, C: {x: 3}}\n"
        b"steps: [{do: A}, {do: B, else: C}]"
    )
    for engine in ENGINES:
        report = check_text(right, "a.xml", CheckOptions(task=task, engine=engine))
        rules = {finding.rule for finding in report.findings}
        assert not any(rule.startswith("GP6") for rule in rules)
        assert any(rule.startswith("GP7") for rule in rules) == (engine != PAPER_ENGINE)
