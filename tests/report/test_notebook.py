"""What notebooks show: what ``_repr_svg_`` and ``_repr_html_`` give, or else the text."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import pytest
from hypothesis import given, settings
from lxml import etree, html

import gpsfsm
from gpsfsm.model import showing
from gpsfsm.model.report import PlanReport, Report
from gpsfsm.picture import automaton_to_svg
from tests.report.samples import BROKEN, CLEAN, GIVES_UP, SAMPLES
from tests.report.test_hostile import ANY_TEXT, hostile

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.plan import Plan

RUNNER = '<Runner interface="nav2_capabilities/WaypointRunner" provider="n/N" x="1" y="2"/>'
OURS = {
    *("div", "style", "h4", "p", "b", "pre", "details", "summary", "ol", "li"),
    *("svg", "title", "defs", "marker", "path", "rect", "circle", "g", "text"),
}


def plan_of(text: str) -> Plan:
    plan = gpsfsm.parse(text).plan
    assert plan is not None
    return plan


def html_of(report: Report | PlanReport) -> html.HtmlElement:
    text = report._repr_html_()
    assert text is not None
    return html.fragment_fromstring(text)


def tags(root: html.HtmlElement) -> set[str]:
    return {str(each.tag) for each in root.iter()}


def test_plans_and_automata_show_their_picture() -> None:
    plan = plan_of(f"<Plan>{RUNNER * 3}</Plan>")
    automaton = gpsfsm.compile_plan(plan).automaton
    assert plan._repr_svg_() == automaton._repr_svg_() == automaton_to_svg(automaton)


def test_what_nobody_could_look_at_is_printed() -> None:
    assert plan_of(f"<Plan>{RUNNER * 2_001}</Plan>")._repr_svg_() is None


def test_a_report_of_one_plan_shows_findings_and_picture() -> None:
    root = html_of(gpsfsm.check(f"<Plan>\n{RUNNER}\n</Plan>"))
    assert root.findtext("p/b") == "accepted"
    (found,) = [each for each in root.find_class("finding") if "GP302" in each.text_content()]
    assert "GP302 dangling-failure, line 2: " in found.text_content()
    assert found.findtext("pre") == f"{RUNNER}\n^^^^^^^"
    assert "nothing handles this failure" in found.findtext("details/ol/li[2]")
    assert len(root.findall(".//svg")) == 1


def test_the_worst_findings_come_first() -> None:
    root = html_of(replace(BROKEN, findings=BROKEN.findings[::-1]))
    classes = [each.get("class") for each in root.find_class("finding")]
    assert classes == ["finding error", "finding warning"]


def test_a_report_of_several_plans_tells_all_of_them() -> None:
    root = html_of(SAMPLES["mixed"])
    headings = [each.text for each in root.findall("h4")]
    assert headings == ["plans/patrol.xml", "plans/über plan.xml", "/absolute/missing.xml", "-"]
    assert root.findtext("p/b").startswith("4 plans: 2 accepted")
    assert not root.findall(".//svg")


def test_what_a_comment_suppresses_is_told_with_its_reason() -> None:
    comment = "<!-- gpsfsm: ignore GP302 because of <b>me</b> -->"
    report = gpsfsm.check(f'<Plan>{comment}<Runner interface="a/Go" provider="a/Go"/></Plan>')
    shown = report.plans[0]._repr_html_()
    assert shown is not None
    assert "suppressed info GP302" in shown
    assert "(comment: of &lt;b&gt;me&lt;/b&gt;)" in shown


def test_what_is_no_plan_is_told_without_a_picture() -> None:
    root = html_of(BROKEN)
    assert root.findtext("p/b") == "rejected"
    assert not root.findall(".//svg")
    assert len(html_of(CLEAN).findall(".//svg")) == 1


def test_large_plans_are_told_without_a_picture() -> None:
    large = replace(CLEAN, source=f"<Plan>{RUNNER * 200}</Plan>")
    assert "No picture: the plan has more than 200 nodes." in html_of(large).text_content()
    huge = replace(CLEAN, source=f"<Plan>{' ' * 200_000}</Plan>")
    assert not html_of(huge).findall(".//svg")


def test_long_reports_are_cut_and_say_so() -> None:
    many = replace(GIVES_UP, findings=GIVES_UP.findings * 40)
    assert "and 20 more findings" in html_of(many).text_content()
    assert "and 2 more plans" in html_of(Report((CLEAN,) * 52)).text_content()


def test_an_engine_s_automaton_is_drawn() -> None:
    root = html_of(gpsfsm.check(f"<Plan>{RUNNER}</Plan>", engine="fabric-v2"))
    assert "FAILED: nothing" in [each.text for each in root.findall(".//svg/text")]


@given(ANY_TEXT)
@settings(max_examples=40)
def test_text_from_outside_is_text(text: str) -> None:
    assert tags(html_of(hostile(text))) <= OURS


@pytest.mark.parametrize(
    "name",
    [
        "<script>alert(1)</script>",
        "</pre><img src=x onerror=alert(1)>",
        '" onload="alert(1)',
        "&lt;",
    ],
)
def test_names_of_markup_are_text(name: str) -> None:
    told = quoteattr(name)
    source = (
        f'<Plan><Control type="sequential" name={told}>'
        f"<Runner interface={told} provider={told} x={told}/></Control></Plan>"
    )
    root = html_of(gpsfsm.check(source))
    assert tags(root) <= OURS
    assert not [key for each in root.iter() for key in each.attrib if key.startswith("on")]
    svg = plan_of(source)._repr_svg_()
    assert svg is not None
    assert name in "".join(etree.fromstring(svg.encode()).itertext())


def test_nothing_of_it_is_loaded_before_it_is_needed() -> None:
    code = "import gpsfsm, sys; print({'gpsfsm.report', 'gpsfsm.picture'} & {*sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_without_anybody_who_shows_it_an_object_is_printed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(showing, "_SHOWS", {})
    automaton: Automaton = gpsfsm.compile_plan(plan_of("<Plan/>")).automaton
    assert automaton._repr_svg_() is None
