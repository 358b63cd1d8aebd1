"""Odd texts under an engine: a verdict or a finding with the right place, never a defect."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.model.report import PlanReport, Report, Verdict
from gpsfsm.report import render
from gpsfsm.syntax import Limits
from tests.engines.test_facts import GO, MAP, both

if TYPE_CHECKING:
    from gpsfsm.model.finding import Finding

FORMATS = ("text", "json", "sarif", "github", "junit", "llm")


def check(text: str | bytes, engine: str = "fabric-v2", **options: object) -> PlanReport:
    return check_text(text, "plan.xml", CheckOptions(engine=engine, **options))  # type: ignore[arg-type]


def only(report: PlanReport, rule: str) -> Finding:
    (finding,) = [each for each in report.findings if each.rule == rule]
    return finding


def deep(levels: int) -> str:
    opened, closed = '<Control type="recovery">', "</Control>"
    return f"<Plan>{opened * levels}{GO}{closed * levels}</Plan>"


@both
@pytest.mark.parametrize(
    "text",
    [
        b"\xef\xbb\xbf<Plan>" + GO.encode() + b"</Plan>",
        f"<Plan>{GO}</Plan>".encode("utf-16"),
        b'<Plan><Runner interface="a/\xe9" provider="a" t="\xff"/></Plan>',
        f"<Plan><![CDATA[x]]>{GO}</Plan>",
        "<!-- a --><!-- b -->",
        '<Plan><Runner interface="a/&#65;&ltx" provider="a" t="&text"/></Plan>',
        f"<Plan>{GO}</Plan><Plan>{GO}{GO}</Plan>",
        f'<Plan><Runner interface="a" provider="a">{GO}</Runner></Plan>',
        '<Plan><Runner interface="" provider=""/></Plan>',
        f"<Plan>{GO}</Plan>\0<junk",
        bytes(range(256)) * 10,
        "",
        "hello",
        '<Plan><Runner interface="a/\ud800" provider="a"/></Plan>',
        deep(150),
        deep(5000),
        f"<Plan>{GO * 1000}</Plan>",
        f"<Plan>{MAP * 40}</Plan>",
    ],
    ids=lambda text: repr(text[:40]),
)
def test_odd_texts(engine: str, text: str | bytes) -> None:
    report = check(text, engine)
    rules = {finding.rule for finding in report.findings}
    assert "GP903" not in rules
    if report.facts is None:
        assert rules & {"GP701", "GP702", "GP103", "GP104"}
        assert report.verdict is not Verdict.ACCEPTED
    else:
        assert report.facts.engine is not None
        assert report.facts.engine.name == engine
    for name in FORMATS:
        assert render(Report((report,)), name)


def test_a_text_that_is_too_large_for_the_engines_parser() -> None:
    """Where gpsfsm's own does not get so far: it reads no bytes that are no UTF-8."""
    limits = Limits(max_elements=110)
    report = check(b"<Plan>" + GO.encode() * 1500 + b"\xff</Plan>", limits=limits)
    assert report.verdict is Verdict.UNDECIDED
    assert report.facts is None
    assert "fabric-v2 reads more elements in this text" in only(report, "GP103").message


def test_the_engine_reads_the_bytes() -> None:
    """It knows no encoding but its own."""
    text = f'<?xml version="1.0" encoding="latin-1"?><Plan>{GO}</Plan>'
    assert check(text.encode("latin-1")).facts is not None
    assert check(f"<Plan>{GO}</Plan>".encode("utf-16")).facts is None
    assert only(check(f"<Plan>{GO}</Plan>".encode("utf-16")), "GP701").severity


def test_a_plan_in_an_answer_keeps_its_lines() -> None:
    text = f'Sure!\r\n\n<Plan>\n{GO}\n<Control type="sequential"/>\n</Plan>\nBye.'
    finding = only(check(text, from_response=True), "GP701")
    assert (finding.location.line, finding.location.column) == (5, 1)
    assert "Unmatched interface" in finding.message
    assert "XML_ERROR_PARSING_TEXT" in only(check(text), "GP701").message


def test_a_runner_without_a_name_is_said_to_be_one() -> None:
    finding = only(check(f'<Plan>{GO}<Runner interface="" provider="x"/></Plan>'), "GP701")
    assert "the interface of this runner is empty" in finding.message
    assert "Unmatched interface:  provider: x combination" in finding.message
    assert finding.location.column == 7 + len(GO)


@both
def test_a_behaviour_tree_is_no_plan(engine: str) -> None:
    tree = '<root BTCPP_format="4"><BehaviorTree><Go/></BehaviorTree></root>'
    report = check(tree, engine)
    assert report.verdict is Verdict.UNDECIDED
    assert only(report, "GP908").message.startswith("--engine has no effect on a behaviour tree")
