"""The summary is Markdown in which text from plans is text."""

from __future__ import annotations

from dataclasses import replace
from xml.sax.saxutils import escape

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gpsfsm
from gpsfsm.model.report import Report
from gpsfsm.report import render
from tests.report.samples import BROKEN, CLEAN, DANGLING, SAMPLES
from tests.report.test_hostile import ANY_TEXT, hostile

MARKUP = st.lists(
    st.sampled_from(
        [
            *("a", " ", "\n", "|", "`", "**x**", "_x_", "[x](http://e.org)", "<b>", "<!--", "-->"),
            *("&lt;", "# h", "- i", "1. i", "~~~", "\\", "![x](y)", "http://e.org", "www.e.org"),
            *("<http://e.org>", "[x]: y", "---", "> q", "\\|", "]", "*", ":x:", "@a", "$x$"),
        ]
    ),
    max_size=12,
).map("".join)
RUNNER = '<Runner interface="a/GoRunner" provider="b/Go"/>'
EMPTY = '<Control type="sequential"/>'
LONG = f'<Control type="sequential" name="{"{" * 60}">' + (
    f'<Runner interface="{"{" * 60}" provider="b/Go" a="{"{" * 60}" b="{"{" * 60}"/></Control>'
)
OURS = {
    *("heading", "inline", "text", "table", "thead", "tbody", "tr", "th", "td"),
    *("bullet_list", "list_item", "paragraph", "strong", "softbreak"),
}


def kinds(text: str) -> set[str]:
    """What a reader of Markdown finds in a text."""
    reader = pytest.importorskip("markdown_it").MarkdownIt("commonmark").enable("table")
    parsed = reader.parse(text)
    inner = [child for token in parsed for child in token.children or ()]
    ends = ("_open", "_close")
    names = (token.type for token in [*parsed, *inner])
    return {name.removesuffix(ends[0]).removesuffix(ends[1]) for name in names}


@given(ANY_TEXT | MARKUP)
def test_text_from_a_plan_is_text(text: str) -> None:
    plain, odd = (render(hostile(each), "markdown") for each in ("x", text))
    assert kinds(odd) <= OURS
    assert len(odd.splitlines()) <= len(plain.splitlines())
    rows = [line for line in odd.splitlines() if line.startswith("|")]
    assert len(rows) == 3
    assert len(render(hostile(text * 1_000), "markdown")) < 50_000


@given(MARKUP | ANY_TEXT.map(lambda text: text.replace("\x00", "")))
def test_pictures_of_hostile_plans_stay_in_their_fence(text: str) -> None:
    escaped = escape(text, {'"': "&quot;", "\n": " "})
    named = f'<Plan><Runner interface="{escaped}" provider="{escaped}" x="{escaped}"/></Plan>'
    plan = replace(hostile("x").plans[0], source=named, facts=None)
    rendered = render(Report((plan,)), "markdown")
    assert kinds(rendered) <= OURS | {"fence"}
    assert rendered.count("```") in (0, 2)  # none for what is no XML


def test_plans_with_findings_are_drawn_and_what_they_are_about_is_marked() -> None:
    text = render(SAMPLES["mixed"], "markdown")
    drawn = text.split("```")
    assert len(drawn) == 3
    assert drawn[0].endswith("\nplans/patrol.xml:\n\n")
    assert drawn[1].startswith("mermaid\nflowchart TD\n")
    assert 'n1["WaypointRunner<br/>x=1.0, y=2.0<br/>line 3<br/>GP302"]' in drawn[1]
    assert '"parallel_all (line 4): GP303"' in drawn[1]
    assert "\n  class n1,c3,n2 found\n" in drawn[1]


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("<Plan>" + RUNNER * 61 + "</Plan>", "it has 65 nodes, which is more than 60"),
        ("<Plan>" + EMPTY * 61 + "</Plan>", "it has 61 controls, which is more than 60"),
        ("<Plan>" + " " * 200_000 + "</Plan>", "its text is longer than 200,000 characters"),
        ("<Plan>" + LONG * 55 + "</Plan>", "its labels are too long for Mermaid"),
    ],
)
def test_large_plans_are_not_drawn_and_that_is_told(source: str, words: str) -> None:
    plan = replace(hostile("x").plans[0], source=source, facts=None)
    text = render(Report((plan,)), "markdown")
    assert "```" not in text
    assert f"\nNo picture of x: {words}.\n" in text


def test_what_an_engine_makes_of_a_plan_is_drawn() -> None:
    source = f"<Plan>{RUNNER * 2}</Plan>"
    report = gpsfsm.check(source, engine="fabric-v2", tolerate=1)
    assert "FAILED: nothing" in render(report, "markdown")


def test_only_the_first_ten_are_drawn() -> None:
    plan = replace(hostile("x").plans[0], source=f"<Plan>{RUNNER}</Plan>", facts=None)
    text = render(Report((plan,) * 12), "markdown")
    assert text.count("```mermaid") == 10
    assert text.endswith("\nand 2 more plans that could be drawn\n")


def test_the_table_tells_every_plan_and_the_list_the_worst_first() -> None:
    lines = render(SAMPLES["mixed"], "markdown").splitlines()
    assert lines[0] == "### gpsfsm: 4 plans: 2 accepted, 1 rejected, 1 undecided; " + (
        "2 errors, 4 warnings"
    )
    assert lines[4:8] == [
        "| plans/patrol.xml | accepted | 0 | 3 |",
        "| plans/über plan.xml | **rejected** | 1 | 1 |",
        "| /absolute/missing.xml | **undecided** | 1 | 0 |",
        "| - | accepted | 0 | 0 |",
    ]
    listed = [line.split()[1].strip("*") for line in lines if line.startswith("- ")]
    assert listed == ["error"] * 2 + ["warning"] * 4


def test_nothing_at_all_is_told_as_such() -> None:
    assert render(Report(), "markdown") == "### gpsfsm: no plan was checked\n\n"


def test_long_reports_are_cut_and_say_so() -> None:
    many = Report((replace(CLEAN, findings=(DANGLING,) * 51), *(BROKEN,) * 500))
    text = render(many, "markdown")
    assert "and 1 more plan\n" in text
    assert f"and {51 + 2 * 500 - 50} more findings\n" in text
    assert text.count("\n- ") == 50
