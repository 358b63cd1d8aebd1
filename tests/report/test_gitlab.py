"""GitLab's code quality report: the fields that GitLab asks for, and no plan in silence."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

from gpsfsm.model.plan import Location
from gpsfsm.model.report import Report
from gpsfsm.report import render
from tests.report.samples import BROKEN, CLEAN, DANGLING, GIVES_UP, MISSING, SAMPLES

SEVERITIES = {"info", "minor", "major", "critical", "blocker"}


def entries(report: Report) -> list[dict[str, Any]]:
    document: list[dict[str, Any]] = json.loads(render(report, "gitlab"))
    return document


def test_every_entry_has_what_gitlab_asks_for() -> None:
    actual = [each for sample in SAMPLES.values() for each in entries(sample)]
    assert actual
    for each in actual:
        assert set(each) == {"description", "check_name", "fingerprint", "severity", "location"}
        assert each["severity"] in SEVERITIES
        assert each["description"]
        assert each["location"]["lines"]["begin"] >= 1
        assert set(each["location"]) == {"path", "lines"}


def test_no_findings_are_an_empty_list() -> None:
    assert entries(Report()) == entries(Report((CLEAN,))) == []


def test_a_plan_that_is_refused_is_never_passed_over() -> None:
    for plan, message in ((MISSING, "is undecided"), (BROKEN, "is rejected")):
        (only,) = entries(Report((replace(plan, findings=()),)))
        assert (only["severity"], message in only["description"]) == ("critical", True)


def test_a_fingerprint_follows_the_element_and_no_two_are_equal() -> None:
    moved = replace(DANGLING, location=replace(DANGLING.location, line=30))
    (before,), (after,) = (
        entries(Report((replace(GIVES_UP, findings=(each,)),))) for each in (DANGLING, moved)
    )
    assert before["fingerprint"] == after["fingerprint"]
    assert before["location"] != after["location"]
    twice = entries(Report((replace(GIVES_UP, findings=(DANGLING, DANGLING)),)))
    assert len({each["fingerprint"] for each in twice}) == 2


def test_a_path_is_relative_to_the_repository() -> None:
    plan = replace(GIVES_UP, path="./a.xml", findings=(replace(DANGLING, location=Location(0, 0)),))
    (only,) = entries(Report((plan,)))
    assert only["location"] == {"path": "a.xml", "lines": {"begin": 1}}
