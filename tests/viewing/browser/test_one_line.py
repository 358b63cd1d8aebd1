"""The text of a plan that is written on one line."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from tests.viewing.browser.reports import document_of

if TYPE_CHECKING:
    from tests.viewing.browser.conftest import Open


def one_line(units: int) -> str:
    runner = 'interface="nav2_capabilities/WaypointRunner" provider="nav2_capabilities/{}" x="{}"'
    go = f"<Runner {runner}/>"
    inner = "".join(
        f'<Control type="sequential">{go.format("WaypointRunner", unit)}</Control>'
        for unit in range(units)
    )
    return f"<Plan><!-- <a><b> -->{inner}{go.format('Other', -1)}</Plan>"


def test_a_plan_on_one_line_has_a_row_for_each_tag(report: Open) -> None:
    text = one_line(60)
    with report(document_of(text)) as opened:
        page = opened.page
        rows = page.locator(".source .line")
        assert rows.nth(0).text_content() == "1<Plan><!-- <a><b> -->"
        assert rows.nth(1).text_content() == '<Control type="sequential">'
        assert rows.nth(3).text_content() == "</Control>"
        indents = [rows.nth(row).locator("code").evaluate(_INDENT) for row in range(4)]
        assert indents[0] < indents[1] < indents[2]
        assert indents[3] == indents[1]
        opened.select("GP202")
        column = text.index(' provider="nav2_capabilities/Other"') + 2
        head = opened.text(".finding.selected .finding-line")
        assert head == f"line 1:{column}"
        current = page.locator(".source .line.current")
        assert current.count() == 1
        assert 'x="-1"' in (current.text_content() or "")
        assert current.locator(".badge").count() == 1
        marked = current.locator(".mark").first.get_attribute("data-column")
        assert marked == str(column)
        for _ in range(2):
            page.locator(".source").press("ArrowUp")
        opened.drawn()
        assert current.locator("code").text_content() == re.findall("<[^>]*>", text)[-4]
        current.locator(".xml-name").first.click()
        opened.drawn()
        assert 'x="59"' in opened.text(".source .line.selected")


def test_what_is_chosen_elsewhere_is_shown_though_a_finding_is_open(report: Open) -> None:
    with report(document_of(one_line(20))) as opened:
        opened.select("GP202")
        current = opened.page.locator(".source .line.current")
        assert 'x="-1"' in (current.text_content() or "")
        opened.page.get_by_role("tab", name=re.compile("Tree")).click()
        opened.page.locator(".tree .row", has_text="x=3").first.click()
        opened.drawn()
        assert current.count() == 1
        assert 'x="3"' in (current.text_content() or "")


_INDENT = "(code) => parseFloat(getComputedStyle(code).marginLeft)"
