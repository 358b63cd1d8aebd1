"""Findings that another rule tells as well: shown only to those who do not see that rule."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

import gpsfsm
from gpsfsm.capabilities.library import Capabilities
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.checking.selection import Selection
from gpsfsm.model.capability import Input, Output, ValueType
from tests.analysis.rules import prompting
from tests.analysis.rules.prompting import ASK, DRIVE, FILL, FILL_B, FLUSH_B, FOLLOW, LONE, READ
from tests.analysis.rules.support import library, plan, provider, runner

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.capabilities.library import Library
    from gpsfsm.model.report import PlanReport

BUFFERS = ("GP411", "GP412", "GP413", "GP414")
PLAN_A = runner("model/Plan", 'uuid="a"')


def checked(
    *steps: str,
    select: Sequence[str] = (),
    ignore: Sequence[str] = (),
    described: Library = prompting.LIBRARY,
) -> PlanReport:
    options = CheckOptions(
        selection=Selection.of(select, ignore), capabilities=Capabilities(described)
    )
    return check_text(plan(*steps), "plan.xml", options)


def shown(
    *steps: str,
    select: Sequence[str] = BUFFERS,
    ignore: Sequence[str] = (),
    described: Library = prompting.LIBRARY,
) -> list[tuple[str, int]]:
    findings = checked(*steps, select=select, ignore=ignore, described=described).findings
    return [(finding.rule, finding.location.line) for finding in findings]


def test_what_mixed_buffers_tell_is_there_without_that_rule() -> None:
    steps = FILL, FLUSH_B
    assert shown(*steps) == [("GP413", 3)]
    assert shown(*steps, ignore=["GP413"]) == [("GP411", 2), ("GP412", 3)]
    assert shown(*steps, select=["GP411"]) == [("GP411", 2)]
    assert shown(*steps, select=["GP412"]) == [("GP412", 3)]


@pytest.mark.parametrize("step", [ASK, PLAN_A, runner("model/Plan", 'uuid="a" flush="false"')])
@pytest.mark.parametrize("taker", [FOLLOW, READ])
def test_what_an_empty_answer_tells_is_there_without_that_rule(step: str, taker: str) -> None:
    assert shown(step, taker) == [("GP414", 2)]
    assert shown(step, taker, ignore=["GP414"]) == [("GP411", 2)]
    assert shown(step, taker, select=["GP411"]) == [("GP411", 2)]


def test_only_the_same_prompts_count() -> None:
    """One mixed buffer does not hide what is wrong with another one."""
    assert shown(FILL, LONE, DRIVE, FILL) == [("GP413", 3), ("GP411", 5)]
    assert shown(FILL, LONE, FILL_B, DRIVE) == [("GP413", 3), ("GP411", 4)]
    assert shown(FILL, LONE, DRIVE, FILL, ignore=["GP413"]) == [("GP411", 2), ("GP411", 5)]
    assert shown(FILL, FLUSH_B, FLUSH_B) == [("GP413", 3), ("GP412", 4)]
    assert shown(FILL, PLAN_A, FOLLOW, FILL) == [("GP411", 2), ("GP414", 3)]


def test_each_fill_is_told_by_the_next_flush_without_a_fill() -> None:
    assert shown(FILL, LONE, FILL, LONE) == [("GP413", 3), ("GP413", 5)]
    allowed = "<!-- gpsfsm: ignore GP413 because it may -->\n" + LONE
    assert shown(FILL, allowed, FILL, LONE) == [("GP411", 2), ("GP413", 6)]
    assert shown(FILL, LONE, FILL, allowed) == [("GP413", 3), ("GP411", 4)]


def test_a_comment_takes_only_what_it_names() -> None:
    allowed = "<!-- gpsfsm: ignore GP413 because it may -->\n" + FLUSH_B
    assert shown(FILL, allowed) == [("GP411", 2), ("GP412", 4)]
    silent = "<!-- gpsfsm: ignore GP411 because it may -->\n" + FILL
    report = checked(silent, FLUSH_B, select=[*BUFFERS, "GP905"])
    assert [finding.rule for finding in report.findings] == ["GP413"]


def test_what_is_told_elsewhere_does_not_count_as_suppressed() -> None:
    for select in (["GP302"], ["GP413"], ["GP411"]):
        report = checked(FILL, FLUSH_B, select=select)
        rules = [finding.rule for finding in (*report.findings, *report.suppressed)]
        assert rules.count("GP413") == 1
        assert rules.count("GP411") == (select == ["GP411"])


TEXT = ValueType.STRING
KEEP = runner("mind/Keep", 'text="hello"')
WANTED = runner("mind/Keep", 'text="$text"')
NEEDS = library(
    provider("eye/Glance", outputs=(Output("text", TEXT, optional=True),)),
    provider("mind/Keep", inputs=(Input("text", TEXT, required=True),)),
    provider(
        "eye/Peek", outputs=(Output("a", TEXT, optional=True), Output("text", TEXT, optional=True))
    ),
    provider(
        "mind/Both", inputs=(Input("a", TEXT, required=True), Input("text", TEXT, required=True))
    ),
    provider("mind/Two", inputs=(Input("a", required=True), Input("text", TEXT))),
    provider("base/Drive"),
)
GLANCE, BASE = runner("eye/Glance"), runner("base/Drive")
VALUES = ("GP207", "GP401", "GP403")


def test_a_literal_that_does_not_count_is_told_once() -> None:
    assert shown(GLANCE, KEEP, select=VALUES, described=NEEDS) == [("GP401", 3)]
    assert shown(GLANCE, KEEP, select=["GP403"], described=NEEDS) == [("GP403", 3)]
    both = runner("mind/Both", 'text="hello" a="b"')
    assert shown(runner("eye/Peek"), both, select=VALUES, described=NEEDS) == [("GP401", 3)]
    assert shown(runner("eye/Peek"), both, select=["GP403"], described=NEEDS) == [("GP403", 3)]


def test_a_placeholder_where_what_the_plan_writes_does_not_count() -> None:
    for before in (BASE, GLANCE):
        assert shown(before, WANTED, select=VALUES, described=NEEDS) == [("GP401", 3)]
        assert shown(before, WANTED, select=["GP207"], described=NEEDS) == []
    assert shown(runner("lift/Go"), WANTED, select=VALUES, described=NEEDS) == []


def test_another_value_of_the_same_runner_is_told() -> None:
    two = runner("mind/Two", 'text="$text"')
    assert shown(BASE, two, select=VALUES, described=NEEDS) == [("GP401", 3), ("GP207", 3)]
    two = runner("mind/Two", 'text="hello"')
    assert shown(GLANCE, two, select=VALUES, described=NEEDS) == [("GP401", 3), ("GP403", 3)]


def test_a_lost_placeholder_is_still_found_without_the_rule_that_tells_more() -> None:
    text = (
        '<Plan><Runner interface="perception_capabilities/TranscribeRunner" '
        'provider="perception_capabilities/TranscribeRunner"/>'
        '<Runner interface="nav2_capabilities/WaypointRunner" '
        'provider="nav2_capabilities/WaypointRunner" x="1.0" y="2.0"/>'
        '<Runner interface="perception_capabilities/SpeechRunner" '
        'provider="perception_capabilities/SpeechRunner" text="$text"/></Plan>'
    )
    shown = [each.rule for each in gpsfsm.check(text, select=["GP2", "GP4"]).plans[0].findings]
    assert (shown.count("GP402"), shown.count("GP207")) == (1, 0)
    alone = gpsfsm.check(text, select=["GP2"]).plans[0].findings
    assert [each.rule for each in alone] == ["GP207"]
