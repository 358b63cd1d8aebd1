"""The summary is Markdown in which text from plans is text."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

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
OURS = {
    *("heading", "inline", "text", "table", "thead", "tbody", "tr", "th", "td"),
    *("bullet_list", "list_item", "paragraph", "strong", "softbreak"),
}


def kinds(text: str) -> set[str]:
    """What a reader of Markdown finds in a text."""
    reader = pytest.importorskip("markdown_it").MarkdownIt("commonmark").enable("table")
    found = reader.parse(text)
    inner = [child for token in found for child in token.children or ()]
    ends = ("_open", "_close")
    names = (token.type for token in [*found, *inner])
    return {name.removesuffix(ends[0]).removesuffix(ends[1]) for name in names}


@given(ANY_TEXT | MARKUP)
def test_text_from_a_plan_is_text(text: str) -> None:
    plain, odd = (render(hostile(each), "markdown") for each in ("x", text))
    assert kinds(odd) <= OURS
    assert len(odd.splitlines()) <= len(plain.splitlines())
    rows = [line for line in odd.splitlines() if line.startswith("|")]
    assert len(rows) == 3
    assert len(render(hostile(text * 1_000), "markdown")) < 50_000


def test_the_table_tells_every_plan_and_the_list_the_worst_first() -> None:
    lines = render(SAMPLES["mixed"], "markdown").splitlines()
    assert lines[0] == "### gpsfsm: 4 plans: 2 accepted, 1 rejected, 1 not decided; " + (
        "2 errors, 4 warnings"
    )
    assert lines[4:8] == [
        "| plans/patrol.xml | accepted | 0 | 3 |",
        "| plans/über plan.xml | **rejected** | 1 | 1 |",
        "| /absolute/missing.xml | **not decided** | 1 | 0 |",
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
