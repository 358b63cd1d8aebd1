"""Verdicts: what they depend on and what they do not."""

from __future__ import annotations

from typing import Any

import pytest

import gpsfsm
from gpsfsm.analysis.decisions import Analysis, reachability
from gpsfsm.errors import AssumptionError, UsageError
from gpsfsm.model.report import Verdict

WAYPOINT = "nav2_capabilities/WaypointRunner"
GO = f'<Runner interface="{WAYPOINT}" provider="{WAYPOINT}" x="1" y="2"/>'
DEAD = f'<Control type="recovery">{GO}</Control>'


def only(text: str, **options: Any) -> gpsfsm.PlanReport:
    (plan,) = gpsfsm.check(text, **options).plans
    return plan


def codes(report: gpsfsm.PlanReport) -> list[str]:
    return [finding.rule for finding in report.findings]


def test_warnings_accept_and_errors_reject() -> None:
    assert only(f"<Plan>{GO}</Plan>").verdict is Verdict.ACCEPTED
    assert only(f"<Plan>{DEAD}{GO}</Plan>").verdict is Verdict.REJECTED


def test_the_verdict_does_not_depend_on_what_is_shown() -> None:
    text = f"<Plan>{DEAD}{GO}</Plan>"
    shown = only(text, ignore=["GP307"])
    assert shown.verdict is Verdict.REJECTED
    assert "GP307" not in codes(shown)
    suppressed = only(f"<Plan><!-- gpsfsm: ignore GP307 because it may -->{DEAD}{GO}</Plan>")
    assert suppressed.verdict is Verdict.REJECTED
    assert "GP307" not in codes(suppressed)
    assert [finding.rule for finding in suppressed.suppressed] == ["GP307"]


def test_a_comment_in_a_tree_holds_for_all_uses_of_a_node() -> None:
    tree = (
        '<root BTCPP_format="4"><BehaviorTree ID="Main"><RetryUntilSuccessful num_attempts="2">'
        "{}<Dock/></RetryUntilSuccessful></BehaviorTree></root>"
    )
    (finding,) = [each for each in only(tree.format("")).findings if each.rule == "GP302"]
    assert finding.location.element.endswith("@2")
    assert codes(only(tree.format("<!-- gpsfsm: ignore GP302 because it may -->"))) == []


def test_a_suppression_that_suppresses_nothing_is_told() -> None:
    report = only(f"<Plan><!-- gpsfsm: ignore GP303 because it may -->{GO}</Plan>")
    assert codes(report) == ["GP905", "GP302"]


def test_what_says_that_there_is_no_verdict_cannot_be_hidden() -> None:
    report = gpsfsm.check("no_such_file.xml", ignore=["ALL"])
    assert report.plans[0].verdict is Verdict.UNDECIDED
    assert codes(report.plans[0]) == ["GP901"]
    assert report.exit_code() == 2
    assert report.exit_code(None) == 2
    assert not report.ok


def test_nothing_checked_is_not_fine() -> None:
    assert not gpsfsm.Report().ok
    assert gpsfsm.Report().exit_code() == 2


def test_contradictory_assumptions_give_no_verdict() -> None:
    both = ["/Plan/Runner[1] fails", "/Plan/Runner[1] succeeds"]
    report = only(f"<Plan>{GO}</Plan>", assume=both)
    assert (report.verdict, report.facts, codes(report)) == (Verdict.UNDECIDED, None, ["GP902"])


def test_an_assumption_that_does_not_parse_is_misuse() -> None:
    with pytest.raises(AssumptionError):
        gpsfsm.check("<Plan/>", assume=["line seven fails"])
    with pytest.raises(UsageError, match="fault model"):
        gpsfsm.check("<Plan/>", faults=["gremlins"])
    with pytest.raises(UsageError, match="solver"):
        gpsfsm.check("<Plan/>", solver="oracle")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="no rule"):
        gpsfsm.check("<Plan/>", select=["GP999"])
    with pytest.raises(UsageError, match="independent outcomes"):
        gpsfsm.check(f"<Plan>{GO}{GO}</Plan>", solver="structural", consistent=True)


def test_backends_that_disagree_are_an_internal_error(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = Analysis(
        "reachability",
        lambda _: (0,),
        reachability.by_solver,
        reachability.facts,
        reachability.questions,
    )
    monkeypatch.setattr(reachability, "ANALYSIS", wrong)
    from gpsfsm.analysis.decisions import analyses

    analyses.cache_clear()
    try:
        report = only(f"<Plan>{GO}</Plan>")
    finally:
        monkeypatch.undo()
        analyses.cache_clear()
    assert (report.verdict, report.facts) == (Verdict.UNDECIDED, None)
    (finding,) = [each for each in report.findings if each.rule == "GP903"]
    assert "disagree on 'reachability'" in finding.message


def test_a_scenario_that_does_not_replay_is_an_internal_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from gpsfsm.analysis.structure import Structure

    monkeypatch.setattr(Structure, "failing", lambda *_, **__: iter(()))
    text = f'<Plan>{GO}<Control type="recovery">{GO}</Control></Plan>'
    report = only(text)
    assert report.verdict is Verdict.UNDECIDED
    assert "a run does not show" in report.findings[-1].message + report.findings[0].message


def test_scenarios_are_limited_and_facts_are_not() -> None:
    both = f'<Control type="parallel_any">{GO}{GO}</Control>'
    report = only(f"<Plan>{both * 4}</Plan>", max_scenarios=2)
    orphans = [finding for finding in report.findings if finding.rule == "GP311"]
    assert [each.scenario is not None for each in orphans] == [True, True, False, False]
    assert report.facts is not None
    assert len(report.facts.orphans) == 8


def test_unknown_is_an_answer_of_its_own() -> None:
    text = f"<Plan>{GO}{GO}{GO}</Plan>"
    report = only(text, consistent=True, rlimit=1)
    assert report.verdict is Verdict.UNDECIDED
    assert report.facts is not None
    assert report.facts.completes == report.facts.gives_up == report.facts.stuck == "unknown"
    assert "GP904" in codes(report)


def test_many_questions_together_have_a_limit_too() -> None:
    """What is known by then stays known, and nobody takes the rest for safe."""
    text = f"<Plan>{GO * 40}</Plan>"
    whole = only(text, consistent=True)
    assert whole.verdict is Verdict.ACCEPTED
    undecided = set()
    for total in (1_000, 60_000, 150_000):
        report = only(text, consistent=True, total_rlimit=total)
        assert report.verdict is Verdict.UNDECIDED
        (limit,) = (each.message for each in report.findings if each.rule == "GP904")
        undecided.add(limit)
        assert report == only(text, consistent=True, total_rlimit=total)
    assert len(undecided) > 1


def test_an_exact_answer_needs_no_second_opinion() -> None:
    for options in ({"rlimit": 1}, {"total_rlimit": 1}):
        report = only(f"<Plan>{GO}</Plan>", **options)
        assert report.verdict is Verdict.ACCEPTED


def test_a_text_that_is_no_path_is_not_taken_for_one() -> None:
    for answer in ("I cannot do that", "", "Sorry.\nNo plan."):
        report = only(answer, from_response=True)
        assert (report.path, report.verdict, codes(report)) == (
            "<text>",
            Verdict.REJECTED,
            ["GP104"],
        )


def test_a_text_where_a_list_belongs_is_misuse() -> None:
    for name in ("assume", "faults", "select", "ignore"):
        with pytest.raises(UsageError, match=f"{name} takes a list"):
            gpsfsm.check("<Plan/>", **{name: "hang"})  # type: ignore[arg-type]


def test_every_unreachable_runner_belongs_to_a_finding() -> None:
    """Also behind an empty control that is cut off first."""
    empty = '<Control type="sequential"/>'
    text = f"<Plan>{GO}{empty}{GO.replace('1', '5')}</Plan>"
    report = only(text, assume=["WaypointRunner(x=1) fails"])
    assert report.facts is not None
    assert report.facts.unreachable == ("/Plan/Runner[2]",)
    (finding,) = [each for each in report.findings if each.rule == "GP301"]
    assert finding.location.element == "/Plan/Runner[2]"


def test_what_is_never_triggered_decides_nothing() -> None:
    text = f'<Plan>{GO}<Control type="recovery">{GO.replace("1", "5")}</Control></Plan>'
    report = only(text, faults=["hang"])
    (stuck,) = [finding for finding in report.findings if finding.rule == "GP306"]
    assert stuck.scenario is not None
    assert stuck.scenario.outcomes == (("/Plan/Runner[1]", "HANG"),)


def test_a_report_can_be_rendered_in_every_format() -> None:
    report = gpsfsm.check(f"<Plan>{GO}</Plan>")
    for name in ("text", "json", "sarif", "github", "junit"):
        assert "GP302" in gpsfsm.render(report, name)
