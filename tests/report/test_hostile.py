"""Whatever a plan holds, no format lets it out of its place."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from gpsfsm.model.finding import Related, Scenario, TraceStep
from gpsfsm.model.report import Report
from gpsfsm.model.story import remark
from gpsfsm.report import RenderOptions, format_names, render
from tests.report.samples import DANGLING, GIVES_UP, MALFORMED

ANY_TEXT = st.text(st.characters(codec=None, exclude_categories=()), max_size=60)
BIDI = set("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


def hostile(text: str) -> Report:
    """A report with ``text`` wherever text can come from outside."""
    assert DANGLING.scenario is not None
    scenario: Scenario = replace(
        DANGLING.scenario,
        outcomes=((text, DANGLING.scenario.outcomes[0][1]),),
        trace=(TraceStep(DANGLING.scenario.trace[0].event, text, 1),),
        sentences=(remark(text),),
    )
    location = replace(DANGLING.location, line=1, element=text)
    finding = replace(
        DANGLING,
        message=text,
        hint=text,
        location=location,
        related=(Related(location, text),),
        scenario=scenario,
    )
    error = replace(MALFORMED, message=text, hint=text)
    plan = replace(
        GIVES_UP, path=text, source=text, notes=(text,), findings=(finding, error), suppressed=()
    )
    return Report((plan,))


@pytest.mark.parametrize("name", format_names())
@given(text=ANY_TEXT)
def test_nothing_controls_a_terminal(name: str, text: str) -> None:
    output = render(hostile(text), name)
    output.encode()
    allowed = {"\n"}
    bad = {c for c in output if ord(c) < 0x20 or 0x7F <= ord(c) < 0xA0 or c in BIDI} - allowed
    assert bad == set()
    assert "\u2028" not in output


@given(ANY_TEXT)
def test_colours_are_ours_alone(text: str) -> None:
    def escapes(shown: str) -> int:
        return render(hostile(shown), options=RenderOptions(color=True)).count("\x1b")

    assert escapes(text) == escapes("x" if text.splitlines() else "")


@given(ANY_TEXT)
def test_the_structure_stays(text: str) -> None:
    report = hostile(text)
    assert len(render(report, "github").splitlines()) == 3
    assert len(render(report, options=RenderOptions(quiet=True)).splitlines()) == 2
    assert len(json.loads(render(report, "json"))["plans"][0]["findings"]) == 2
    assert len(json.loads(render(report, "sarif"))["runs"][0]["results"]) == 2
    root = etree.fromstring(render(report, "junit").encode())
    assert len(root.findall(".//testcase")) == 1


def test_long_texts_are_clipped_for_people() -> None:
    def length(text: str, name: str) -> int:
        without_path = replace(hostile(text).plans[0], path="p")
        return len(render(Report((without_path,)), name))

    for name in ("text", "github", "junit", "sarif"):
        assert length("x" * 1_000_000, name) - length("x", name) < 20_000
