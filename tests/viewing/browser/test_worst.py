"""The worst plans: whatever is in a text, the page shows it, and nothing of it is ever markup."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest

from gpsfsm.api import check_options
from tests.cli.support import runner
from tests.viewing.browser.reports import document_of

if TYPE_CHECKING:
    from tests.viewing.browser.conftest import Open

GO = '<Runner interface="a/Go" provider="a/Go" x="{}"/>'
EVIL = (
    "</script><script>window.pwned = 1</script>",
    "<img src=x onerror='window.pwned = 1'>",
    "--><svg onload='window.pwned = 1'>",
    "javascript:window.pwned = 1",
    "{{constructor.constructor('window.pwned = 1')()}}",
    "__proto__",
)
UNRULY = "\u202eesrever\u202c \u0000 \u2028 \u200f\ufeff é😀 \ud800"


def escaped(text: str) -> str:
    escaped = text.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    return escaped.replace("\u0000", "").replace("\ud800", "")


def named(names: tuple[str, ...]) -> str:
    """A plan with these names everywhere."""
    rows = [
        f'<Control type="sequential" name="{escaped(name)}">'
        f'<Runner interface="{escaped(name)}" provider="p/{escaped(name)}" name="{escaped(name)}" '
        f'text="{escaped(name)}"/></Control>'
        for name in names
    ]
    return f'<Plan name="{escaped(names[0])}">{"".join(rows)}</Plan>'


def wide(count: int, each: int = 100) -> str:
    rows = [GO.format(number) for number in range(count)]
    groups = [
        f'<Control type="sequential" name="g{first}">\n{chr(10).join(rows[first : first + each])}\n'
        "</Control>"
        for first in range(0, count, each)
    ]
    return "<Plan>\n" + "\n".join(groups) + "\n</Plan>"


WORST = {
    "invalid": "<Plan>\n<Runner interface='a/b' x=1 provider=>\n<Control type='dance'>\n</Plan",
    "empty": "",
    "prose": "Sure! First I would drive to the door, then I would knock.",
    "names of markup": named(EVIL),
    "unruly characters": named((UNRULY,)),
    "deep": "<Plan>\n"
    + '<Control type="sequential">\n' * 60
    + GO.format(1)
    + "\n</Control>" * 60
    + "\n</Plan>",
    "huge attribute": f"<Plan>{GO.format('x' * 300_000)}</Plan>",
    "undecodable": b"<Plan>\xff\xfe\x00</Plan>",
    "two thousand mistakes": "<Plan>\n" + "<Runer/>\n" * 2000 + "</Plan>",
}


@pytest.mark.parametrize("name", WORST)
def test_the_page_shows_what_there_is(name: str, report: Open) -> None:
    text = WORST[name]
    document = document_of(text)
    with report(document) as open_report:
        page = open_report.page
        assert page.locator(".top").is_visible()
        count = len([each for each in open_report.plan["findings"] if not each["suppressed"]])
        assert open_report.text("[role=tab]") == f"Findings {count}"
        assert page.locator(".finding").count() == min(count, 200) or not count
        for selector in (".tree", ".source", ".graph", ".findings"):
            assert page.locator(selector).count() == 1
        if open_report.plan["source"] and open_report.plan["source"].strip():
            assert page.locator(".source .line").count() > 0
        open_report.press("n", "n", "p", "f", "2", "ArrowDown", "Enter", "1", "o", ".", ",", "t")
        assert page.evaluate("window.pwned") is None
        assert (
            page.locator("#app img, #app script, #app iframe, #app link, #app style").count() == 0
        )
        assert page.locator(".page-error").count() == 0


def test_names_of_markup_are_read_as_they_are(report: Open) -> None:
    with report(document_of(WORST["names of markup"])) as open_report:
        open_report.press("2")
        shown = " ".join(open_report.texts(".tree .row"))
        for name in EVIL[:3]:
            assert name in shown
        assert "&lt;/script>&lt;script>" in open_report.text(".source")  # as it is written


def test_signs_of_direction_are_seen_and_do_not_act(report: Open) -> None:
    with report(document_of(WORST["unruly characters"])) as open_report:
        open_report.press("2")
        for selector in (".tree", ".source", ".finding-list"):
            shown = open_report.text(selector)
            assert not re.search("[\u202a-\u202e\u2066-\u2069\u200f\ufeff]", shown), selector
        assert "U+202E" in open_report.text(".source")


def test_a_plan_that_an_engine_refuses(report: Open) -> None:
    text = '<Plan><Control type="recovery"/></Plan>'
    document = document_of(text, options=check_options(engine="fabric-v1"))
    with report(document) as open_report:
        assert open_report.page.locator(".finding").count() == len(open_report.plan["findings"])
        open_report.press("n", "o", ".", "f")


def test_thousands_of_runners_open_folded(report: Open) -> None:
    document = document_of(wide(3_000), options=check_options(select=["GP1"]))
    assert len(document["plans"][0]["automaton"]["nodes"]) > 3_000
    with report(document) as open_report:
        page = open_report.page
        open_report.press("2")
        rows = page.locator(".tree .row").count()
        assert 0 < rows < 200  # only those in view are in the page
        open_report.press("End")
        assert "x=2999" in open_report.text(".tree .row.selected")
        page.get_by_label("Search").fill("x=1500")
        page.get_by_label("Search").press("Enter")
        open_report.drawn()
        assert "x=1500" in open_report.text(".tree .row.selected")
        assert 'x="1500"' in " ".join(open_report.texts(".source .line"))


def test_hundreds_of_findings_come_in_pages(report: Open) -> None:
    plan = f"<Plan>\n{(runner(x='far') + chr(10)) * 250}</Plan>"
    document = document_of(plan, options=check_options(select=["GP205"]))
    findings = document["plans"][0]["findings"]
    shown = [place for place, each in enumerate(findings) if not each["suppressed"]]
    assert len(shown) > 200
    with report(document) as open_report:
        page = open_report.page
        assert page.locator(".finding").count() == 200
        page.get_by_role("button", name="later →").click()
        page.locator(f'.finding[data-finding="{shown[200]}"]').wait_for()
        first = page.locator(".finding").first
        assert first.get_attribute("data-finding") == str(shown[200])
        open_report.press("p")  # the last one, from none
        selected = page.locator(".finding.selected")
        assert selected.get_attribute("data-finding") == str(shown[-1])
        open_report.press("n")  # around the end
        assert selected.get_attribute("data-finding") == str(shown[0])
