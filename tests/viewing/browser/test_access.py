"""Reports can be used by everybody: axe-core on each view and state of it, and on a phone."""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.api import check_options
from tests.browser_audit import audited
from tests.conftest import REPO
from tests.viewing.browser.reports import document_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from playwright.sync_api import Page

    from tests.viewing.browser.conftest import Open

_EXAMPLES = REPO / "docs" / "examples"
DOOR = (_EXAMPLES / "door_check.xml").read_text(encoding="utf-8")
GUARDED = DOOR.replace('type="parallel_all"', 'type="parallel_any"')
TREE = (_EXAMPLES / "nav2" / "depot.xml").read_text(encoding="utf-8")
MACHINE = (_EXAMPLES / "door.json").read_text(encoding="utf-8")


@cache
def document(name: str) -> dict[str, Any]:
    """What is shown of plans of this name."""
    texts = {
        "one": (DOOR,),
        "bad": ("no plan at all",),
        "several": (DOOR, "no plan at all", GUARDED),
        "diff": (DOOR, GUARDED),
        "tree": (TREE,),
        "machine": (MACHINE,),
    }[name]
    return document_of(*texts, options=check_options(), diff=name == "diff")


def _nothing(_: Page) -> None:
    """The page as it opens."""


def _selected(page: Page) -> None:
    page.locator(".finding-head").first.click()
    page.locator(".finding.selected summary").click()


def _played(page: Page) -> None:
    page.locator(".finding-play").first.click()
    page.get_by_label("To the end").click()


def _stepped(page: Page) -> None:
    page.keyboard.press(".")


def _rows(page: Page) -> None:
    page.get_by_role("tab", name=re.compile("Tree")).click()
    page.locator(".tree .row").nth(3).click()


def _legend(page: Page) -> None:
    page.locator(".graph-legend summary").click()


def _keys(page: Page) -> None:
    page.keyboard.press("?")


def _filtered(page: Page) -> None:
    page.get_by_role("button", name="Errors").click()
    page.get_by_label("Filter plans").fill("rejected")


STATES: list[tuple[str, Callable[[Page], None]]] = [
    *(("one", each) for each in (_nothing, _selected, _played, _rows, _legend, _keys)),
    ("bad", _nothing),
    *(("several", each) for each in (_nothing, _filtered)),
    *(("diff", each) for each in (_nothing, _stepped)),
    *(("tree", each) for each in (_nothing, _rows)),
    *(("machine", each) for each in (_nothing, _played, _rows)),
]


@pytest.mark.parametrize(("name", "do"), STATES, ids=lambda each: getattr(each, "__name__", each))
def test_nothing_keeps_anybody_from_it(name: str, do: Callable[[Page], None], report: Open) -> None:
    with report(document(name), size=(1280, 800)) as open_report:
        do(open_report.page)
        open_report.drawn()
        assert audited(open_report.page) == []


def test_the_search_can_be_read(report: Open) -> None:
    """Its list lies over the panes, so that it does not count as covered."""
    with report(document("one"), size=(1280, 800)) as open_report:
        open_report.press("/")
        open_report.page.keyboard.type("runner")
        open_report.page.locator(".search-hits li").first.wait_for()
        assert audited(open_report.page, fits=False) == []


def test_the_bars_between_panes_say_how_wide_they_are(report: Open) -> None:
    with report(document("one"), size=(1280, 800)) as open_report:
        bar = open_report.page.get_by_role("separator", name="Width of the left pane")
        bar.focus()
        before = int(bar.get_attribute("aria-valuenow") or 0)
        assert 20 <= before <= 35
        open_report.press("ArrowRight", "ArrowRight", "ArrowRight")
        assert int(bar.get_attribute("aria-valuenow") or 0) > before


@pytest.mark.parametrize("name", ["one", "diff", "several"])
@pytest.mark.parametrize("media", [{"forced_colors": "active"}, {"reduced_motion": "reduce"}])
def test_wishes_of_the_system_do_not_break_it(
    name: str, media: dict[str, str], report: Open
) -> None:
    with report(document(name), size=(390, 844), **media) as open_report:
        assert audited(open_report.page, sizes=((390, 844),), themes=("light",)) == []
