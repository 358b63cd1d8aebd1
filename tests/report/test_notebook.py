"""What notebooks show: what ``_repr_svg_`` and ``_repr_html_`` give, or else the text."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import pytest
from hypothesis import given, settings
from lxml import etree, html

import gpsfsm
from gpsfsm.model import showing
from gpsfsm.model.report import PlanReport, Report
from gpsfsm.picture import automaton_to_svg
from tests.cases import many
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
    (actual,) = [each for each in root.find_class("finding") if "GP302" in each.text_content()]
    assert "GP302 dangling-failure, line 2: " in actual.text_content()
    assert actual.findtext("pre") == f"{RUNNER}\n^^^^^^^"
    assert "nothing handles this failure" in actual.findtext("details/ol/li[2]")
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
@settings(max_examples=many(40))
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
    quoted = quoteattr(name)
    source = (
        f'<Plan><Control type="sequential" name={quoted}>'
        f"<Runner interface={quoted} provider={quoted} x={quoted}/></Control></Plan>"
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


TASK = "interface: GoRunner\nplaces: {A: {x: 1}}\nsteps: [{do: A}]\n"
EVIL = '<img src=x onerror="alert(1)">'


class Printer:
    """Collects the text that IPython shows on a terminal."""

    def __init__(self) -> None:
        self.shown = ""

    def text(self, words: str) -> None:
        self.shown += words


def pretty(value: object) -> str:
    printer = Printer()
    value._repr_pretty_(printer, False)  # type: ignore[attr-defined]
    return printer.shown


def test_results_show_themselves_and_nothing_of_a_text_is_markup(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = Path(f"{EVIL}.xml")
    go = f'<Runner interface="a/Go" provider="a/Go" text={quoteattr(EVIL)}/>'
    text = f'<Plan><Control type="recovery" name={quoteattr(EVIL)}>{go}{go}</Control></Plan>'
    file.write_text(text, encoding="utf-8")
    report = gpsfsm.check(file)
    values = [
        *(report, report.plans[0], *report.findings),
        gpsfsm.fix(file, unsafe=True),
        gpsfsm.fuzz(file, runs=3),
        gpsfsm.grade(file, TASK),
        gpsfsm.grade(file, TASK, by="folder"),
    ]
    assert len(values) > 6
    for value in values:
        root = html.fragment_fromstring(value._repr_html_())  # type: ignore[attr-defined]
        assert tags(root) <= OURS | {"table", "tr", "th", "td"}
        assert pretty(value)
        if not isinstance(value, gpsfsm.Fixed):
            assert str(value) == pretty(value)
    assert str(report.findings[0]).startswith("line 1, column 7: error GP307 recovery-without")
    assert "img src=x" in values[-2]._repr_html_()  # type: ignore[attr-defined]


def test_a_table_of_grades_has_its_rows_and_totals() -> None:
    good = '<Plan><Runner interface="demo/GoRunner" provider="demo/GoRunner" x="1"/></Plan>'
    table = gpsfsm.grade(good, TASK)
    root = html.fragment_fromstring(table._repr_html_())
    assert [cell.text for cell in root.iter("td")][:2] == ["<text>", "success"]
    assert root.find(".//pre").text == "1 answer: 1 success, 0 partial, 0 failed"
    assert pretty(table).endswith("1 answer: 1 success, 0 partial, 0 failed")


def test_what_was_repaired_shows_the_lines_that_differ() -> None:
    fixed = gpsfsm.fix('<Plan><Runner interface="a/Go" provider=a/Go></Plan>')
    root = html.fragment_fromstring(fixed._repr_html_())
    lines = root.find(".//pre").text.splitlines()
    assert lines[-1] == '+<Plan><Runner interface="a/Go" provider="a/Go"/></Plan>'
    assert len(list(root.find("ol"))) == len(fixed.applied) > 0
    assert pretty(fixed).splitlines() == lines
    assert "nothing repaired" in gpsfsm.fix("<Plan/>")._repr_html_()


def test_a_campaign_shows_findings_with_their_lines_and_properties() -> None:
    go = '<Runner interface="nav2_capabilities/WaypointRunner" provider="n/N" x="1" y="2"/>'
    both = f'<Plan>\n<Control type="parallel_any">\n{go}\n{go}\n</Control>\n</Plan>'
    root = html.fragment_fromstring(gpsfsm.fuzz(both, runs=30)._repr_html_())
    shown = [each.text for each in root.iter("pre")]
    assert any(text.startswith(go[:20]) for text in shown)
    assert "held: replays, the journal of every run" in shown[-1]
    assert "broken (" in shown[-1]
