from __future__ import annotations

import re
from dataclasses import replace

import pytest

from gpsfsm.model.finding import Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.report import Report, Verdict
from gpsfsm.report import render
from tests.report.samples import CLEAN, DANGLING, GIVES_UP, MISSING, SAMPLES

COMMAND = re.compile(r"::(?P<name>error|warning|notice) (?P<properties>[^:]*)::(?P<message>.*)")


def commands(report: Report) -> list[re.Match[str]]:
    *lines, total = render(report, "github").splitlines()
    assert not total.startswith("::")
    matches = [COMMAND.fullmatch(line) for line in lines]
    assert None not in matches
    return [match for match in matches if match is not None]


def test_the_most_severe_come_first() -> None:
    names = [match["name"] for match in commands(SAMPLES["mixed"])]
    assert names == ["error"] * 2 + ["warning"] * 4


def test_one_command() -> None:
    plan = replace(GIVES_UP, findings=(DANGLING,))
    assert render(Report((plan,)), "github").splitlines()[0] == (
        "::warning file=plans/patrol.xml,line=3,col=5,endColumn=12,"
        "title=GP302 dangling-failure::if WaypointRunner fails, nothing takes over "
        "and the plan gives up%0Ahint: put a recovery control right after it"
    )


def test_what_has_a_meaning_in_commands_is_escaped() -> None:
    finding = replace(DANGLING, message="100%\n::error::x\r", hint="", severity=Severity.INFO)
    plan = replace(GIVES_UP, path="a,b:c%d\n.xml", findings=(finding,))
    assert render(Report((plan,)), "github").splitlines()[0] == (
        r"::notice file=a%2Cb%3Ac%25d\x0a.xml,line=3,col=5,endColumn=12,"
        r"title=GP302 dangling-failure::100%25\x0a::error::x\x0d"
    )


def test_no_line_without_a_line() -> None:
    finding = replace(DANGLING, location=Location(0, 0))
    (command,) = commands(Report((replace(GIVES_UP, findings=(finding,)),)))
    assert command["properties"] == "file=plans/patrol.xml,title=GP302 dangling-failure"


def test_what_is_said_of_the_whole_input_has_no_line() -> None:
    (command,) = commands(Report((MISSING,)))
    assert command["properties"] == "file=/absolute/missing.xml,title=GP901 unreadable-input"


@pytest.mark.parametrize("findings", [(), (DANGLING,)])
def test_a_plan_that_was_not_decided_is_never_silent(findings: tuple[()]) -> None:
    plan = replace(CLEAN, verdict=Verdict.UNDECIDED, findings=findings)
    assert commands(Report((plan,)))[0]["name"] == "error"


def test_nothing_found() -> None:
    assert render(SAMPLES["accepted"], "github") == "1 plan: 1 accepted; no findings\n"
