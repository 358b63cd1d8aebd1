from __future__ import annotations

from dataclasses import replace

from gpsfsm.api import check
from gpsfsm.model.finding import Confidence, Finding, Severity
from gpsfsm.model.report import PlanReport, Report, Verdict
from gpsfsm.model.story import remark
from gpsfsm.report import RenderOptions, render
from tests.report.samples import CLEAN, DANGLING, GIVES_UP, SAMPLES

MISREAD = """<Plan>
  <Runner interface="nav2_capabilities/WaypointRunner" provider="nav2_capabilities/WaypointRunner"
          x="one" y="2"/>
  <Control type="fallback"><Runner interface="std_capabilities/WaitRunner"/></Control>
</Plan>
"""


def advice(plan: PlanReport, **options: object) -> str:
    return render(Report((plan,)), "llm", options=RenderOptions(**options))  # type: ignore[arg-type]


def test_what_why_and_how() -> None:
    text = advice(check(MISREAD).plans[0])
    first = text.splitlines()[0]
    assert first.startswith("Your plan was rejected: ")
    assert first.endswith("Correct it and answer with the whole plan.")
    assert '\n   You wrote: <Control type="fallback"><Runner interface=' in text
    assert "\n   Why: " in text
    assert "\n   Do: " in text


def test_what_can_happen_is_told_as_a_story() -> None:
    report = check(
        '<Plan>\n<Runner interface="a/B" provider="a/B"/>\n'
        '<Runner interface="a/C" provider="a/C"/>\n</Plan>',
        tolerate=1,
    )
    text = advice(report.plans[0])
    assert "   What can happen: B at line 2 fails; nothing handles this failure" in text


def test_errors_come_before_warnings_and_infos_are_left_out() -> None:
    error = replace(DANGLING, severity=Severity.ERROR, message="the worst")
    info = replace(DANGLING, severity=Severity.INFO, message="by the way")
    plan = replace(GIVES_UP, verdict=Verdict.REJECTED, findings=(info, DANGLING, error))
    text = advice(plan)
    assert "1 error, 1 warning" in text
    assert text.index("the worst") < text.index(DANGLING.message)
    assert "by the way" not in text


def test_a_reason_is_given_once_per_rule_and_few_findings_of_each() -> None:
    plan = replace(GIVES_UP, findings=(DANGLING,) * 7)
    text = advice(plan)
    assert text.count("   Why: ") == 1
    assert text.count("GP302") == 4
    assert text.endswith("There are 3 more like these.\n")


def test_a_long_story_keeps_its_end() -> None:
    scenario = DANGLING.scenario
    assert scenario is not None
    story = tuple(remark(f"step {number}") for number in range(1, 31))
    finding = replace(DANGLING, scenario=replace(scenario, sentences=story))
    text = advice(replace(GIVES_UP, findings=(finding,)))
    assert "What can happen: (18 steps before); step 19; " in text
    assert "step 30." in text


def test_corrected_lines_are_shown_where_they_are_known() -> None:
    def correct(plan: PlanReport, finding: Finding) -> tuple[str, ...]:
        assert plan.path == GIVES_UP.path
        return ("<Runner", '  x="1"/>\x1b[31m') if finding is DANGLING else ()

    text = advice(replace(GIVES_UP, findings=(DANGLING, replace(DANGLING))), correct=correct)
    assert text.count('   Write instead:\n   <Runner\n     x="1"/>\\x1b[31m') == 1


def test_a_guess_is_called_one() -> None:
    finding = replace(DANGLING, confidence=Confidence.HEURISTIC)
    assert "1. Warning (a guess at what you intend) GP302" in advice(
        replace(GIVES_UP, findings=(finding,))
    )


def test_nothing_to_say() -> None:
    assert advice(CLEAN) == "The plan is accepted.\n"
    assert advice(replace(CLEAN, verdict=Verdict.UNDECIDED)).startswith(
        "Your plan is undecided: the check could not be"
    )
    assert render(Report(()), "llm") == "There is no plan.\n"


def test_several_plans_have_their_names() -> None:
    plans = SAMPLES["mixed"].plans
    text = render(SAMPLES["mixed"], "llm")
    assert [line for line in text.splitlines() if line.startswith("# ")] == [
        f"# {plan.path}" for plan in plans
    ]
