from __future__ import annotations

import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.api import check
from gpsfsm.model.finding import Confidence, Finding, Related, Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.report import Frequency, PlanReport, Report, Verdict
from gpsfsm.model.story import remark
from gpsfsm.report import RenderOptions, render
from tests.report.samples import BROKEN, CLEAN, DANGLING, GIVES_UP, MISSING

ANSI = re.compile(r"\x1b\[[0-9;]*m")


def text(*plans: PlanReport, **options: bool | int) -> str:
    return render(Report(plans), options=RenderOptions(**options))  # type: ignore[arg-type]


def with_finding(finding: Finding) -> PlanReport:
    return replace(GIVES_UP, findings=(finding,), notes=())


def test_a_finding_shows_its_line_and_a_caret_under_the_place() -> None:
    lines = text(with_finding(DANGLING), verbose=True).splitlines()
    assert lines[:5] == [
        "plans/patrol.xml:3:5: warning GP302 dangling-failure: "
        "if WaypointRunner fails, nothing takes over and the plan gives up",
        "   |",
        ' 3 |     <Runner interface="nav2_capabilities/WaypointRunner" '
        'provider="nav2" x="1.0" y="2.0"/>',
        "   |     ^^^^^^^",
        "   | (element /Plan/Control[1]/Runner[1])",
    ]


def test_the_frame_is_as_wide_as_the_line_number() -> None:
    far = replace(DANGLING, location=Location(101, 2, ""), scenario=None, length=3)
    plan = replace(with_finding(far), source="\n" * 100 + "<Plan/>")
    assert text(plan).splitlines()[1:3] == [" 101 | <Plan/>", "     |  ^^^"]
    assert text(plan, verbose=True).splitlines()[1:3] == ["     |", " 101 | <Plan/>"]


@pytest.mark.parametrize("line", [0, 99])
def test_a_place_outside_the_text_has_no_excerpt(line: int) -> None:
    output = text(with_finding(replace(DANGLING, location=Location(line, 1))))
    assert "^" not in output
    assert output.startswith("plans/patrol.xml:99:1: " if line else "plans/patrol.xml: warning")


def test_what_is_said_of_the_whole_input_has_no_place() -> None:
    assert text(MISSING, quiet=True) == (
        "/absolute/missing.xml: error GP901 unreadable-input: no such file\n"
    )
    readable = text(replace(MISSING, source="<Plan/>\n"))
    assert readable.startswith("/absolute/missing.xml: error GP901")
    assert "<Plan/>" not in readable


def test_what_keeps_a_plan_from_being_decided_can_have_a_place() -> None:
    for location in (Location(1, 1, "/Plan"), Location(1, 7), Location(2, 1)):
        finding = replace(MISSING.findings[0], rule="GP103", location=location)
        shown = text(replace(MISSING, source="<Plan>\n</Plan>", findings=(finding,)))
        assert f":{location.line}:{location.column}: error GP103" in shown
        assert "^" in shown


def test_at_most_ten_related_places() -> None:
    related = tuple(Related(Location(n, 1), f"place {n}") for n in range(1, 14))
    output = text(with_finding(replace(DANGLING, related=related)), verbose=True)
    assert "= also: plans/patrol.xml:10:1 place 10\n   = and 3 more\n" in output
    assert "place 11" not in output
    few = with_finding(replace(DANGLING, related=related[:10]))
    assert "more" not in text(few, verbose=True)


def test_the_short_form_counts_related_places() -> None:
    related = tuple(Related(Location(n, 1), f"place {n}") for n in range(1, 4))
    one = with_finding(replace(DANGLING, related=related[:1]))
    assert text(one).splitlines()[0].endswith("the plan gives up (+1 place)")
    several = replace(DANGLING, related=related, confidence=Confidence.HEURISTIC)
    output = text(with_finding(several))
    assert output.splitlines()[0].endswith("the plan gives up (heuristic, +3 places)")
    assert "place 2" not in output


INFO = replace(DANGLING, severity=Severity.INFO, scenario=None)
ERROR = replace(DANGLING, severity=Severity.ERROR, scenario=None)


def test_the_worst_findings_come_first_and_infos_take_one_line() -> None:
    plan = replace(with_finding(DANGLING), findings=(INFO, DANGLING, ERROR, INFO))
    lines = text(plan).splitlines()
    assert [line.split(": ")[1].split()[0] for line in lines if " GP302 " in line] == [
        "error",
        "warning",
        "info",
        "info",
    ]
    first = next(number for number, line in enumerate(lines) if " info " in line)
    assert lines[first - 1] == lines[first + 2] == ""
    quiet = text(plan, quiet=True, verbose=True)
    assert [line.split(": ")[1].split()[0] for line in quiet.splitlines()][:2] == [
        "info",
        "warning",
    ]


def test_one_scenario_is_shown_that_of_the_first_of_the_worst_findings() -> None:
    other = replace(DANGLING, location=replace(DANGLING.location, line=5))
    plan = replace(with_finding(DANGLING), findings=(INFO, replace(INFO), DANGLING, other))
    assert text(plan).count("scenario") == 1
    assert (
        text(plan).index(":3:5: warning") < text(plan).index("scenario") < text(plan).index(":5:5")
    )
    assert text(plan, verbose=True).count("scenario") == 2
    # an error without a scenario: that of a warning would be another story
    assert "scenario" not in text(replace(plan, findings=(ERROR, DANGLING)))
    alone = text(with_finding(replace(DANGLING, severity=Severity.INFO)))
    assert "scenario" in alone
    assert "hint" in alone
    assert "^" not in alone
    assert "--verbose" not in alone


def test_what_the_short_form_leaves_out_is_mentioned() -> None:
    assert "--verbose" not in text(with_finding(ERROR))
    assert "(more with --verbose)" in text(with_finding(INFO))
    assert "--verbose" not in text(with_finding(INFO), verbose=True)


FINDINGS = st.builds(
    lambda severity, line, message: replace(
        DANGLING,
        severity=severity,
        location=Location(line, 1, ""),
        scenario=DANGLING.scenario if message else None,
    ),
    st.sampled_from(Severity),
    st.integers(1, 9),
    st.booleans(),
)


@given(st.lists(FINDINGS, max_size=8))
def test_the_order_is_by_severity_then_as_in_the_report(findings: list[Finding]) -> None:
    plan = replace(with_finding(DANGLING), findings=tuple(findings))
    for verbose in (False, True):
        heads = re.findall(r"^plans/patrol.xml:(\d):1: (\w+)", text(plan, verbose=verbose), re.M)
        expected = [
            (str(each.location.line), severity.value)
            for severity in Severity
            for each in findings
            if each.severity is severity
        ]
        assert heads == expected
    worst = [each for each in findings if each.severity.value == (heads or [("", "")])[0][1]]
    assert text(plan).count("scenario") == any(each.scenario for each in worst)


def test_a_long_story_is_cut_and_its_numbers_line_up() -> None:
    assert DANGLING.scenario is not None
    scenario = replace(
        DANGLING.scenario, sentences=tuple(remark(f"step {n}") for n in range(1, 61))
    )
    output = text(with_finding(replace(DANGLING, scenario=scenario)))
    assert "\n      9. step 9\n     10. step 10\n" in output
    assert "\n     50. step 50\n         and 10 more\n" in output


def test_a_scenario_without_story_lists_its_outcomes() -> None:
    assert DANGLING.scenario is not None
    bare = replace(DANGLING, scenario=replace(DANGLING.scenario, sentences=()))
    assert "\n     1. /Plan/Control[1]/Runner[1]: FAILED\n" in text(with_finding(bare))


def test_summaries_and_total() -> None:
    output = text(GIVES_UP, BROKEN, MISSING, CLEAN)
    for line in (
        "plans/patrol.xml: accepted; 3 runner instances; sometimes completes, sometimes gives up, "
        "never stuck; fewest failures to give up: 1; 1 finding suppressed",
        "plans/über plan.xml: rejected; the text could not be analysed",
        "/absolute/missing.xml: undecided",
        "-: accepted; 0 runner instances; always completes, never gives up, "
        "unknown whether it is stuck",
        "4 plans: 2 accepted, 1 rejected, 1 undecided; 2 errors, 4 warnings (more with --verbose)",
    ):
        assert line in output.splitlines()


@pytest.mark.parametrize("frequency", Frequency)
def test_every_frequency_has_its_words(frequency: Frequency) -> None:
    assert CLEAN.facts is not None
    facts = replace(CLEAN.facts, completes=frequency, gives_up=frequency, stuck=frequency)
    message = text(replace(CLEAN, facts=facts)).splitlines()[0]
    assert message.count(frequency.value) == 3


def test_nothing_to_check_is_said() -> None:
    assert text() == "no plan was checked\n"
    assert text(CLEAN).endswith("\n\n1 plan: 1 accepted; no findings\n")
    assert text(quiet=True) == ""


def test_plans_without_findings_make_a_list() -> None:
    assert text(CLEAN, CLEAN).count("\n\n") == 1
    assert "1 finding suppressed\n\nplans/über" in text(GIVES_UP, BROKEN)


def test_quiet_is_one_line_per_finding() -> None:
    output = text(GIVES_UP, BROKEN, CLEAN, quiet=True)
    assert len(output.splitlines()) == 5
    assert all(re.match(r"plans/.*:\d+:\d+: \w+ GP\d+ ", line) for line in output.splitlines())


def test_statistics_count_each_rule_over_all_plans() -> None:
    output = text(GIVES_UP, GIVES_UP, BROKEN, statistics=True)
    assert "      2           0  warning   GP302 dangling-failure\n" in output
    assert "      1           2  warning   GP111 packed-coordinates\n" in output
    assert "suppressed  severity" not in text(CLEAN, statistics=True)


def test_colours_change_nothing_but_colours() -> None:
    plain, colored = text(GIVES_UP, MISSING), text(GIVES_UP, MISSING, color=True)
    assert "\x1b" not in plain
    assert "\x1b[1;33mwarning\x1b[0m" in colored
    assert ANSI.sub("", colored) == plain


def test_a_narrow_terminal_clips_the_source() -> None:
    lines = text(GIVES_UP, width=50).splitlines()
    shown = [line for line in lines if re.match(r" \d+ \| ", line)]
    assert len(shown) == 3
    assert all(len(line) <= 50 for line in shown)


def test_many_plans_are_no_problem() -> None:
    plans = tuple(replace(GIVES_UP, path=f"{n}.xml") for n in range(300))
    assert "300 plans: 300 accepted; 900 warnings (more with --verbose)\n" in text(*plans)


def test_a_verdict_that_no_finding_explains_is_still_told() -> None:
    hidden = replace(GIVES_UP, verdict=Verdict.REJECTED, findings=(), notes=())
    assert "plans/patrol.xml: rejected; 3 runner instances" in text(hidden)


@pytest.mark.parametrize(
    ("plan", "summary"),
    [
        ("<Plan/>", "accepted; 0 runner instances, nothing runs: it completes at once"),
        (
            '<Plan><Control type="recovery"><Runner interface="a/Go" provider="a/Go"/></Control>'
            "</Plan>",
            "rejected; 1 runner instance, nothing runs: it completes at once",
        ),
    ],
)
def test_a_plan_in_which_nothing_runs_is_not_praised(plan: str, summary: str) -> None:
    (checked,) = check(plan).plans
    last = text(checked).splitlines()
    assert any(summary in line for line in last)
    assert not any("always completes" in line for line in last)


def test_what_a_node_of_ones_own_does_is_left_open() -> None:
    tree = (
        '<root BTCPP_format="4"><BehaviorTree ID="Main">\n<Sequence><Go/>\n'
        "<Dance><Spin/><Jump/></Dance>{}</Sequence></BehaviorTree></root>"
    )
    (checked,) = check(tree.format("<Sing><A/><B/></Sing>")).plans
    assert checked.verdict is Verdict.ACCEPTED
    (finding,) = (each for each in checked.findings if each.rule == "GP816")
    assert finding.message == (
        "the automaton allows more than this tree can do: Dance at line 3 (its behaviour is "
        "unknown) and Sing at line 3 (its behaviour is unknown)"
    )
    declared = tree.replace("<Dance><Spin/><Jump/></Dance>", "<Dance/>").replace(
        "</root>", '<TreeNodesModel><Action ID="Dance"/><Action ID="Go"/></TreeNodesModel></root>'
    )
    (checked,) = check(declared.format("")).plans
    assert checked.verdict is Verdict.ACCEPTED
    assert not any(each.rule == "GP816" for each in checked.findings)


def test_a_verdict_without_a_proof_says_so_and_names_the_limit() -> None:
    loop = '{"nodes": [{"id": "s", "kind": "start"}, {"id": "a", "kind": "runner", '
    loop += '"interface": "a/B"}, {"id": "e", "kind": "complete"}], "edges": ['
    loop += '{"source": "s", "target": "a", "event": "SUCCEEDED"}, '
    loop += '{"source": "a", "target": "e", "event": "SUCCEEDED"}, '
    loop += '{"source": "a", "target": "a", "event": "FAILED"}]}'
    last = render(check(loop, rlimit=100)).splitlines()[-3]
    assert last.endswith("; not proved by z3, search only: over --rlimit")
    last = render(check(loop)).splitlines()[-3]
    assert last.endswith("; proved by z3")
