"""Links: a report shows what stands behind the ``#`` of its address, wherever it is opened."""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, Any

import pytest

from tests.browser_support import opened
from tests.conftest import REPO
from tests.viewing.browser.reports import Report, document_of

if TYPE_CHECKING:
    from playwright.sync_api import Browser

    from tests.viewing.browser.conftest import Open

NOTICE = ".page-notice"
_SHOWN = """() => {
  const { store, view } = globalThis.gpsfsmPage;
  const { plan, finding, element, node, line, frame, playing, play, severities } = store.state;
  const states = [...store.state.states].map(([number, { state }]) => [number, state]).sort();
  return { view, plan, finding, element, node, line, frame, playing, severities, states,
    play: store.plan.plays.indexOf(play), taken: [...store.state.taken].sort() };
}"""
_WRITTEN = "(hash) => location.hash === hash"


@cache
def door_check() -> str:
    return (REPO / "docs" / "examples" / "door_check.xml").read_text(encoding="utf-8")


@cache
def one() -> dict[str, Any]:
    return document_of(door_check())


@cache
def several(*, diff: bool = False) -> dict[str, Any]:
    return document_of(
        door_check(), door_check().replace("parallel_all", "parallel_any"), diff=diff
    )


def shown(report: Report) -> Any:
    report.drawn()
    return report.page.evaluate(_SHOWN)


def waits_for(report: Report, fragment: str) -> None:
    report.page.wait_for_function(_WRITTEN, arg=fragment)


def test_a_step_of_a_scenario_is_the_same_in_another_browser(
    browser: Browser, report: Open
) -> None:
    with report(one()) as opened_report:
        opened_report.open_play("GP303")
        for step in range(1, opened_report.step()[1] + 1):
            opened_report.press(".")
            waits_for(opened_report, f"#finding=GP303:6:5&step={step}")
            opened_report.settled()  # the other panes follow a step after a moment
            before = shown(opened_report)
            with opened(browser, opened_report.page.url) as page:
                again = Report(page, opened_report.document)
                again.settled()
                assert shown(again) == before
                assert again.step()[0] == step
                assert again.sentence() == opened_report.sentence()
                assert not page.locator(NOTICE).count()


def test_every_finding_has_a_link_of_its_own(report: Open) -> None:
    twice = '<Plan><Runner interface="a/B" provider="$x" y="$z"/></Plan>'
    for text in (door_check(), twice):
        with report(document_of(text)) as opened_report:
            links = opened_report.page.evaluate(
                """() => {
                  const { store } = globalThis.gpsfsmPage;
                  return store.plan.findings.map((_, number) => store.link(number));
                }"""
            )
            assert len(links) == len(set(links)) == len(opened_report.plan["findings"])
            for number, link in enumerate(links):
                opened_report.page.goto(link)
                assert shown(opened_report)["finding"] == number
                assert opened_report.page.locator(
                    f'.finding.selected[data-finding="{number}"]'
                ).count()
                assert not opened_report.page.locator(NOTICE).count()


ODD = """<Plan><Control type="sequential" name="a/b?c#d&amp;e=f">
<Runner interface="é/ü" provider="é/ü"/>
<Runner interface="a/Go" provider="a/Go"/></Control></Plan>"""


@pytest.mark.parametrize("file", ["door_check.xml", "door.json", "grasp.xml", "odd"])
def test_every_element_has_a_link_of_its_own(file: str, browser: Browser, report: Open) -> None:
    folder = REPO / "docs" / "examples"
    document = document_of(ODD if file == "odd" else (folder / file).read_text(encoding="utf-8"))
    with report(document) as opened_report:
        page, links = opened_report.page, set()
        opened_report.press("2")
        count = len(opened_report.plan["elements"])
        for _ in range(count):
            before = page.url
            page.keyboard.press("ArrowDown")
            page.wait_for_function("(before) => location.href !== before", arg=before)
            links.add(page.url)
        assert len(links) == count
        assert re.search(r"#element=/[\w/.%]+$", page.url)
        before = shown(opened_report)
        assert before["element"] == count - 1
        page.reload()
        assert shown(opened_report) == before
        with opened(browser, page.url) as other:
            assert shown(Report(other, document)) == before
            assert not other.locator(NOTICE).count()


def test_an_element_beside_a_finding_is_in_the_link_and_goes_with_it(report: Open) -> None:
    with report(one()) as opened_report:
        start = opened_report.page.url
        opened_report.select("GP307")
        waits_for(opened_report, "#finding=GP307:2:5")
        opened_report.page.locator(".line[data-line='10'] .line-text").click()
        waits_for(opened_report, "#finding=GP307:2:5&element=/Plan/Runner.1")
        opened_report.page.reload()
        assert (shown(opened_report)["finding"], shown(opened_report)["line"]) == (0, 10)
        link = opened_report.page.evaluate("() => gpsfsmPage.store.link(0)")
        assert link == f"{start}#finding=GP307:2:5"
        opened_report.page.go_back()
        opened_report.drawn()
        assert shown(opened_report)["element"] == -1
        assert opened_report.page.url == start


def test_back_and_forward_go_from_finding_to_finding_and_not_from_step_to_step(
    report: Open,
) -> None:
    with report(one()) as opened_report:
        start = opened_report.page.url
        opened_report.select("GP307")
        assert opened_report.page.url == f"{start}#finding=GP307:2:5"
        opened_report.open_play("GP303")
        opened_report.press(".", ".")
        waits_for(opened_report, "#finding=GP303:6:5&step=2")
        opened_report.page.go_back()
        waits_for(opened_report, "#finding=GP307:2:5")
        assert (shown(opened_report)["finding"], shown(opened_report)["play"]) == (0, -1)
        opened_report.page.go_back()
        assert opened_report.page.url == start
        assert shown(opened_report)["finding"] == -1
        opened_report.page.go_forward()
        opened_report.page.go_forward()
        waits_for(opened_report, "#finding=GP303:6:5&step=2")
        assert opened_report.step()[0] == 2


def test_plans_and_views(browser: Browser, report: Open) -> None:
    with report(several()) as opened_report:
        assert "#" not in opened_report.page.url
        opened_report.page.locator(".plan-link").nth(1).click()
        waits_for(opened_report, "#plan=2")
        opened_report.select("GP307")
        waits_for(opened_report, "#plan=2&finding=GP307:2:5")
        before = shown(opened_report)
        assert (before["view"], before["plan"], before["finding"]) == ("plan", 1, 0)
        with opened(browser, opened_report.page.url) as page:
            assert shown(Report(page, opened_report.document)) == before
        opened_report.page.go_back()
        opened_report.page.go_back()
        assert shown(opened_report)["view"] == "summary"


def test_a_step_of_a_comparison(browser: Browser, report: Open) -> None:
    sentences = ".compare-said .play-now"
    with report(several(diff=True)) as opened_report:
        opening, _ = opened_report.step()
        assert opening > 0
        opened_report.page.get_by_label("To the start").click()
        waits_for(opened_report, "#step=0")
        opened_report.press(".", ".", ".")
        waits_for(opened_report, "#step=3")
        before = (opened_report.texts(sentences), opened_report.text(".play-place"))
        with opened(browser, opened_report.page.url) as page:
            again = Report(page, opened_report.document)
            again.drawn()
            assert (again.texts(sentences), again.text(".play-place")) == before
        opened_report.page.locator(".compare-side .plan-link").first.click()
        waits_for(opened_report, "#plan=1")
        opened_report.page.go_back()
        assert shown(opened_report)["view"] == "compare"


def test_a_link_to_what_is_hidden_shows_it(report: Open) -> None:
    text = door_check().replace("<Plan", "<!-- gpsfsm: ignore GP303 because so -->\n<Plan", 1)
    with report(document_of(text)) as opened_report:
        number = next(
            at for at, one in enumerate(opened_report.plan["findings"]) if one["suppressed"]
        )
        opened_report.page.goto(opened_report.page.url + "#finding=GP303:7:5")
        assert shown(opened_report)["finding"] == number
        assert opened_report.page.locator(".finding.selected.suppressed").count()


@pytest.mark.parametrize(
    "fragment",
    [
        "#finding=<img src=x onerror=alert(1)>",
        "#finding=%3Cscript%3Ealert(1)%3C/script%3E",
        "#finding=GP303:6:5:99",
        "#finding=GP303:6:5&step=99999",
        "#finding=GP307:2:5&step=1",
        "#finding=GP999:1:1",
        "#element=/Plan/Runner.9",
        "#element=Plan",
        "#element=/__proto__",
        "#element=/<img src=x onerror=alert(1)>",
        "#element=/" + "%2e" * 1_000,
        "#draft=abc",
        "#plan=99",
        "#plan=0",
        "#plan=-1",
        "#plan=1e9",
        "#plan=1&plan=1",
        "#play=task&step=1",
        "#step=3",
        "#view=compare",
        "#view=summary",
        "#view=__proto__",
        "#__proto__=1",
        "#constructor=1",
        "#run=1",
        "#&&&===",
        "#%",
        "#\u202e\u0007\u00e9",
        "#finding=" + "a" * 100_000,
    ],
)
def test_a_hostile_link_is_left_out_with_a_notice(fragment: str, report: Open) -> None:
    with report(one()) as opened_report:
        page = opened_report.page
        before = page.evaluate("document.body.querySelectorAll('script, img, iframe').length")
        page.evaluate("(hash) => { location.hash = hash }", fragment)
        page.locator(NOTICE).wait_for()
        opened_report.drawn()
        assert page.locator(NOTICE).count() == 1
        words = page.locator(NOTICE).inner_text()
        assert words.splitlines()[0] == (
            "The link points to something that is not here. That part of it was ignored."
        )
        counted = "document.body.querySelectorAll('script, img, iframe').length"
        assert page.evaluate(counted) == before
        assert page.locator(".finding-head").count()  # it can be worked with
        opened_report.select("GP302")
        assert re.search(r"#finding=GP302:\d+:\d+$", page.url)
        page.locator(NOTICE).get_by_role("button", name="Close").click()
        assert not page.locator(NOTICE).count()


def test_a_part_that_fits_is_shown_all_the_same(report: Open) -> None:
    with report(several()) as opened_report:
        opened_report.page.goto(opened_report.page.url + "#plan=2&evil=1")
        opened_report.page.locator(NOTICE).wait_for()
        assert (shown(opened_report)["view"], shown(opened_report)["plan"]) == ("plan", 1)
        assert opened_report.page.url.endswith("#plan=2")
