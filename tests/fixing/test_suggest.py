from __future__ import annotations

from typing import TYPE_CHECKING

from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.fixing import suggest
from gpsfsm.fixing.suggest import Suggestions
from gpsfsm.model.finding import Severity
from tests.cli.support import ACCEPTED, BROKEN, REJECTED, run, runner

if TYPE_CHECKING:
    import pytest

TWO = f"""<Plan>
  <Control type="recovery">
    {runner(x="1")}
    {runner(x="2")}
  </Control>
  <Control type="recovery">
    {runner(x="3")}
    {runner(x="4")}
  </Control>
</Plan>
"""


def suggested(text: str, rule: str) -> list[list[str]]:
    """The lines for each finding of a rule, without their indentation."""
    report = check_text(text, "plan.xml", CheckOptions())
    correct = Suggestions()
    return [
        [line.strip() for line in correct(report, finding)]
        for finding in report.findings
        if finding.rule == rule
    ]


def test_a_safe_fix() -> None:
    assert suggested(ACCEPTED.replace('y="2"', "y=2"), "GP101") == [[runner()]]


def test_an_unsafe_fix_is_good_advice_too() -> None:
    assert suggested(REJECTED, "GP307") == [[runner()]]


def test_fixes_that_help_only_together_and_each_with_its_own_lines() -> None:
    opened = '<Control type="recovery">'
    assert suggested(TWO, "GP307") == [
        [runner(x="1"), opened, runner(x="2")],
        [runner(x="3"), opened, runner(x="4")],
    ]


def test_none_where_none_is_known() -> None:
    assert suggested("I cannot do that.", "GP104") == [[]]


def test_lines_that_would_be_wrong_themselves_are_not_suggested() -> None:
    tags = "<Plan>", "<Fallback>", "<Sequence>", "<Fly/>", "</Sequence>", "</Fallback>", "</Plan>"
    for lines in suggested("\n".join(tags), "GP105"):
        assert not any("Fly" in line for line in lines)


def test_long_plans_and_many_findings_get_none(monkeypatch: pytest.MonkeyPatch) -> None:
    unquoted = ACCEPTED.replace('y="2"', "y=2")
    assert suggested(unquoted + " " * 20_000, "GP101") == [[]]
    monkeypatch.setattr(suggest, "_MAX_CHECKS", 1)
    assert [bool(lines) for lines in suggested(TWO, "GP307")] == [True, False]


def test_they_are_shown_to_models() -> None:
    done = run("check", "-", "--format", "llm", stdin=REJECTED.encode())
    assert f"   Write instead:\n     {runner()}\n".encode() in done.stdout


PARTS = ["<Plan>", "</Plan>", "<Sequence>", "</Sequence>", ACCEPTED, REJECTED, BROKEN, TWO, "<"]


@given(st.lists(st.sampled_from([*PARTS, runner(), "\r\n", "\n", '"', "x"]), max_size=6))
def test_whatever_the_text_lines_hold_no_wrong_runner(parts: list[str]) -> None:
    report = check_text("".join(parts), "plan.xml", CheckOptions())
    correct = Suggestions()
    for finding in report.findings:
        lines = "\n".join(correct(report, finding))
        findings = check_text(f"<Plan>\n{lines}\n</Plan>", "lines", CheckOptions()).findings
        assert not [
            each
            for each in findings
            if each.severity is Severity.ERROR and each.rule.startswith("GP2")
        ]
