"""What is said about assumptions that do not parse or do not fit the plan."""

from __future__ import annotations

import pytest

import gpsfsm
from gpsfsm.model.report import Verdict
from gpsfsm.report import render
from tests.analysis.assumptions.support import NAV, PLAN, plan_of, refusal

SYNTAX_ERRORS = {
    "line 7 fials implies line 9 succeeds": """\
expected what happens ('succeeds', 'fails', 'hangs' or 'does not start'), found 'fials'
    line 7 fials implies line 9 succeeds
           ^
did you mean 'fails'?
for example: line 7 fails implies line 9 succeeds""",
    "never fails:": """\
expected what to select, such as 'line 7', '/Plan/Runner[2]' or 'SpeechRunner', found the end
    never fails:
                ^
for example: never fails: SpeechRunner""",
    "line 7 fails\n\tline 9 fails": """\
expected a word such as 'and' or 'implies', or the end, found 'line'
    line 7 fails  line 9 fails
                  ^
for example: line 7 fails implies line 9 succeeds""",
    "line x fails": """\
expected a line number such as 7 or 7:12, found 'x'
    line x fails
         ^
for example: line 7 fails implies line 9 succeeds""",
    "if line 7 fails line 9 fails": """\
expected 'then', or a word such as 'and' or 'implies', found 'line'
    if line 7 fails line 9 fails
                    ^
for example: if line 7 fails then line 9 succeeds""",
    "line 7 fails and": """\
expected a claim such as 'line 7 fails', found the end
    line 7 fails and
                    ^
for example: line 7 fails implies line 9 succeeds""",
    '"Speech fails': """\
this quote is never closed
    "Speech fails
    ^""",
    "not /Plan/Runner[0] fails": """\
an element path looks like /Plan/Control[1]/Runner[2], counting from 1
    not /Plan/Runner[0] fails
        ^""",
    "any line 7 agree": """\
'agree' applies to all instances, not to 'any'
    any line 7 agree
        ^""",
    "  ": """\
the assumption is empty
for example: line 7 fails implies line 9 succeeds""",
}


@pytest.mark.parametrize("text", SYNTAX_ERRORS)
def test_syntax_error(text: str) -> None:
    assert str(refusal(text)) == SYNTAX_ERRORS[text]


BINDING_ERRORS = {
    "line 5 fails": """\
'line 5' selects 2 runner instances; write 'any line 5' (at least one of them) or 'all line 5' \
(each of them), or select one: 'line 5:5', 'line 5:60'
    line 5 fails
    ^""",
    "line 2 fails implies WaypointRunner fails": """\
'WaypointRunner' selects 2 runner instances; write 'any WaypointRunner' (at least one of them) or \
'all WaypointRunner' (each of them), or select one: 'line 2:3', 'line 5:5'
    line 2 fails implies WaypointRunner fails
                         ^""",
    "never fails: line 9": """\
line 9 contains no runner; name a line that contains a runner, nearest first: 5, 4, 2
    never fails: line 9
                 ^""",
    "never fails: line 3": """\
line 3 contains no runner; to select the runners inside, write /Plan/Control[1]
    never fails: line 3
                 ^""",
    "line 5:7 fails": """\
no runner starts at 5:7; write where a start tag begins: 5:5, 5:60
    line 5:7 fails
    ^""",
    "/Plan/Control[3] fails": """\
there is no /Plan/Control[3]; /Plan contains Runner[1], Control[1], Control[2]
    /Plan/Control[3] fails
    ^""",
    "never fails: /Plan/Control[2]": """\
there is no runner inside /Plan/Control[2]; name a runner, or a control that contains one
    never fails: /Plan/Control[2]
                 ^""",
}


@pytest.mark.parametrize("text", BINDING_ERRORS)
def test_binding_error(text: str) -> None:
    assert str(refusal(text, PLAN)) == BINDING_ERRORS[text]


def test_the_excerpt_of_a_long_text_is_short() -> None:
    lines = str(refusal("line 2 fails and " * 300 + "line 2 oops\x1b[31m")).splitlines()
    assert all(len(line) < 120 and line.isprintable() for line in lines)
    assert lines[1][lines[2].index("^") :].startswith("oops")


# --- the same in one line ---

SUMMARIES = {
    "line 5 fails": "'line 5' selects 2 runner instances",
    "never fails:  line 9": "line 9 contains no runner",
    "never fails:\nline 3": "line 3 contains no runner",
    "line 5:7 fails": "no runner starts at 5:7",
    "/Plan/Control[3] fails": "there is no /Plan/Control[3]",
    "never fails: /Plan/Control[2]": "there is no runner inside /Plan/Control[2]",
}


@pytest.mark.parametrize("text", SUMMARIES)
def test_the_summary_names_the_assumption_and_the_hint_a_remedy(text: str) -> None:
    error = refusal(text, PLAN)
    written = text.replace("\n", " ")
    assert error.summary == f"the assumption '{written}' cannot be used: {SUMMARIES[text]}"
    assert str(error).splitlines()[0] == f"{SUMMARIES[text]}; {error.hint}"


def test_the_summary_of_a_syntax_error() -> None:
    error = refusal("line 7 hungs")
    assert error.summary.startswith("the assumption 'line 7 hungs' cannot be used: expected what")
    assert error.hint == "did you mean 'hangs'? for example: line 7 fails implies line 9 succeeds"
    assert refusal(" ").summary == "the assumption is empty"
    assert refusal("x" * 10_001).summary == "an assumption has at most 10000 characters"


@pytest.mark.parametrize("name", ["a\nb\x1b[31m", "n" * 5_000])
def test_the_summary_of_a_hostile_selector_is_one_short_line(name: str) -> None:
    plan = plan_of((1, NAV, 2, 3, {"name": name}), (1, NAV, 3, 3, {"name": name}))
    error = refusal(f'name "{name}" fails', plan)
    assert "selects 2 runner instances" in error.summary
    for said in (error.summary, error.hint, *str(error).splitlines()):
        assert said.isprintable()
        assert len(said) < 500


TWO = """\
<Plan>
  <Control type="sequential">
    <Runner interface="a/GoRunner" provider="a/Go" x="1"/>
    <Runner interface="a/GoRunner" provider="a/Go" x="2"/>
  </Control>
</Plan>
"""


@pytest.mark.parametrize(
    ("text", "message", "hint"),
    [
        (
            "never fails: line 1",
            "line 1 contains no runner",
            "to select the runners inside, write /Plan",
        ),
        (
            "line 9 fails implies line 4 succeeds",
            "line 9 contains no runner",
            "name a line that contains a runner, nearest first: 4, 3",
        ),
        (
            "GoRunner fails",
            "'GoRunner' selects 2 runner instances",
            "write 'any GoRunner' (at least one of them) or 'all GoRunner' (each of them),"
            " or select one: 'line 3:5', 'line 4:5'",
        ),
    ],
)
def test_an_assumption_that_does_not_fit_is_a_finding(text: str, message: str, hint: str) -> None:
    report = gpsfsm.check(TWO, assume=[text])
    (plan,) = report.plans
    (finding,) = [each for each in plan.findings if each.rule == "GP907"]
    assert plan.verdict is Verdict.UNDECIDED
    assert finding.message == f"the assumption '{text}' cannot be used: {message}"
    assert finding.hint == hint
    shown = render(report)
    assert f": error GP907 unusable-assumption: {finding.message}\n" in shown
    assert f"hint: {hint}\n" in shown
    assert "\\x0a" not in shown
