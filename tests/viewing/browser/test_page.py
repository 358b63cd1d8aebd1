"""The report as a page: findings, links between panes, keys, themes, print, small screens."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.api import check_options
from tests.browser_support import opened, shown_text, shown_texts
from tests.conftest import REPO
from tests.viewing.browser.reports import document_of

if TYPE_CHECKING:
    from pathlib import Path

    from playwright.sync_api import Browser

    from tests.viewing.browser.conftest import Open
    from tests.viewing.browser.reports import Report

SELECTED = ".finding.selected"


@cache
def door_check() -> dict[str, Any]:
    text = (REPO / "docs" / "examples" / "door_check.xml").read_text(encoding="utf-8")
    suppressed = text.replace(
        "<Plan", "<!-- gpsfsm: ignore GP302 because we accept that -->\n<Plan", 1
    )
    return document_of(suppressed)


def place_of(document: dict[str, Any], rule: str) -> int:
    return next(
        place
        for place, finding in enumerate(document["plans"][0]["findings"])
        if finding["rule"] == rule
    )


def shown_rules(report: Report) -> list[str]:
    return report.texts(".finding .rule-code")


@pytest.mark.parametrize(
    "script",
    [
        "console.error('no')",
        "setTimeout(() => { throw new Error('no') })",
        "fetch('http://127.0.0.1:9/')",
    ],
)
def test_complaints_of_a_page_fail_a_test(browser: Browser, tmp_path: Path, script: str) -> None:
    file = tmp_path / "bad.html"
    file.write_text(f"<!doctype html><link rel=icon href=data:,><script>{script}</script>")
    with pytest.raises(AssertionError), opened(browser, file.as_uri()) as page:
        page.wait_for_timeout(200)


def test_a_page_knows_nothing_of_the_one_before(browser: Browser, tmp_path: Path) -> None:
    file = tmp_path / "page.html"
    file.write_text("<!doctype html><link rel=icon href=data:,><p id=p>p</p>")
    seen = """() => [
      innerWidth, sessionStorage.length, localStorage.length, history.state, document.cookie,
      matchMedia('print').matches, matchMedia('(prefers-color-scheme: dark)').matches,
      matchMedia('(prefers-reduced-motion: reduce)').matches,
      matchMedia('(forced-colors: active)').matches, !!document.querySelector('p:hover'),
    ]"""
    changed = {"theme": "dark", "reduced_motion": "reduce", "forced_colors": "active"}
    with opened(browser, file.as_uri(), size=(500, 500), **changed) as page:
        page.emulate_media(media="print")
        page.evaluate(
            """() => addEventListener('pagehide', () => {
              sessionStorage.setItem('a', 'b'); localStorage.setItem('a', 'b');
            })"""
        )
        page.reload()
        page.locator("p").hover()
        page.evaluate("history.replaceState('state', '')")
        assert page.evaluate(seen) == [500, 1, 1, "state", "", True, True, True, True, True]
    with opened(browser, file.as_uri()) as again:
        assert again is page
        assert again.evaluate(seen) == [1440, 0, 0, None, "", *[False] * 5]


def test_text_that_no_frame_has_drawn_yet_is_waited_for(browser: Browser, tmp_path: Path) -> None:
    file = tmp_path / "rows.html"
    file.write_text(
        "<!doctype html><link rel=icon href=data:,>"
        "<style>p { content-visibility: auto; contain-intrinsic-size: auto 99px }</style>"
    )
    add = """() => {
      const made = Array.from({ length: 50 }, (_, number) => document.createElement('p'));
      made.forEach((row, number) => row.append(`row ${number}`));
      document.body.replaceChildren(...made);
      const spans = made.map((row) => row.appendChild(document.createElement('span')));
      spans.forEach((span, number) => span.append(`text ${number}`));
      return spans.map((span) => span.innerText);
    }"""
    with opened(browser, file.as_uri()) as page:
        assert set(page.evaluate(add)) == {""}  # this is what makes an early reader fail
        page.evaluate(add)
        assert shown_text(page.locator("span").last) == "text 49"
        page.evaluate(add)
        assert shown_texts(page.locator("span")) == [f"text {number}" for number in range(50)]


def test_the_policy_of_a_report_stops_scripts(report: Open) -> None:
    violations = ["Content Security Policy", "http://127.0.0.1:9/x.png"]
    with report(door_check(), allowed=violations) as open_report:
        ran = open_report.page.evaluate(
            """() => {
              const script = document.createElement('script');
              script.textContent = 'window.pwned = 1';
              document.body.append(script);
              const image = document.createElement('img');
              image.src = 'http://127.0.0.1:9/x.png';
              document.body.append(image);
              return window.pwned;
            }"""
        )
        assert ran is None


def test_findings_are_filtered_and_counted(report: Open) -> None:
    document = door_check()
    findings = document["plans"][0]["findings"]
    with report(document) as open_report:
        page = open_report.page
        shown = [each["rule"] for each in findings if not each["suppressed"]]
        assert shown_rules(open_report) == shown
        for name in ("error", "warning", "info", "suppressed"):
            of_name = [
                each
                for each in findings
                if (("suppressed" if each["suppressed"] else each["severity"]) == name)
            ]
            assert open_report.text(f".filter.{name} .filter-count") == str(len(of_name))
        page.locator(".filter.warning").click()
        assert set(shown_rules(open_report)) == {
            each["rule"]
            for each in findings
            if each["severity"] != "warning" and not each["suppressed"]
        }
        assert page.locator(".filter.warning").get_attribute("aria-pressed") == "false"
        assert page.evaluate("document.activeElement.className").startswith("filter warning")
        page.locator(".filter.suppressed").click()
        assert page.locator(".finding.suppressed").count() > 0
        page.locator(".filter.error").click()
        page.locator(".filter.info").click()
        page.locator(".filter.suppressed").click()
        assert "The filters above hide all findings" in open_report.text(".findings-more")


def test_a_finding_explains_itself(report: Open) -> None:
    document = door_check()
    place = place_of(document, "GP303")
    finding = document["plans"][0]["findings"][place]
    with report(document) as open_report:
        page = open_report.page
        open_report.select("GP303")
        shown = open_report.text(SELECTED)
        for words in (
            finding["message"],
            finding["hint"],
            *(each["message"] for each in finding["related"]),
        ):
            assert words in shown
        page.locator(f"{SELECTED} summary").click()
        rule = document["rules"]["GP303"]
        assert rule["why"] in open_report.text(SELECTED)
        assert "gpsfsm explain GP303" in open_report.text(SELECTED)
        # a related place leads there, in the text as well
        related = finding["related"][0]
        page.locator(f"{SELECTED} .place").first.click()
        open_report.drawn()
        assert str(related["line"]) in open_report.text(".source .line.selected").split()


def test_a_selection_is_shown_in_tree_and_text(report: Open) -> None:
    with report(door_check()) as open_report:
        page = open_report.page
        open_report.press("2")
        row = page.locator(".tree .row", has_text="SpeechRunner").first
        row.click()
        open_report.drawn()
        element = open_report.plan["elements"][int(row.get_attribute("data-element") or -1)]
        lines = open_report.texts(".source .line.selected")
        assert str(element["line"]) in lines[0].split()
        page.locator(".source .line", has_text="parallel_all").first.click()
        open_report.drawn()
        assert "parallel_all" in open_report.text(".tree .row.selected")


def test_keys_alone(report: Open) -> None:
    document = door_check()
    findings = document["plans"][0]["findings"]
    shown = [place for place, each in enumerate(findings) if not each["suppressed"]]
    with report(document) as open_report:
        page = open_report.page

        def selected() -> int:
            return int(page.locator(SELECTED).get_attribute("data-finding") or -1)

        open_report.press("n")
        assert selected() == shown[0]
        open_report.press("p")
        assert selected() == shown[-1]
        while findings[selected()]["play"] < 0:
            open_report.press("n")
        open_report.press("o")
        assert page.locator(".playbar").is_visible()
        assert open_report.step()[0] == 0
        open_report.press(".", ".")
        assert open_report.step()[0] == 2
        open_report.press(",")
        assert open_report.step()[0] == 1
        open_report.press("Space")
        assert page.get_by_role("button", name="Pause").count() == 1
        open_report.press("Space")
        assert page.get_by_role("button", name="Pause").count() == 0
        open_report.press("/")
        page.keyboard.type("speech")
        page.keyboard.press("Enter")
        open_report.drawn()
        open_report.press("Escape", "2", "Home", "ArrowDown")
        assert page.evaluate("document.activeElement.getAttribute('role')") == "tree"
        assert page.locator(".tree .row.selected").get_attribute("data-element") == "1"
        open_report.press("ArrowLeft")
        assert page.locator(".tree .row.selected").get_attribute("aria-expanded") == "false"
        open_report.press("?")
        assert page.locator("dialog.help").is_visible()
        page.keyboard.press("Escape")
        assert not page.locator("dialog.help").is_visible()


def test_tab_reaches_everything_and_focus_is_seen(report: Open) -> None:
    with report(door_check()) as open_report:
        page = open_report.page
        reached, invisible = set(), []
        for _ in range(80):
            page.keyboard.press("Tab")
            focused = page.evaluate(
                """() => {
                  const one = document.activeElement;
                  const style = getComputedStyle(one);
                  const pane = one.closest('.findings, .tree, .graph, .source, .top, .splitter');
                  const name = one.tagName + '.' + one.className;
                  return [pane ? pane.className.split(' ')[0] : '', name,
                          style.outlineStyle, parseFloat(style.outlineWidth)];
                }"""
            )
            reached.add(focused[0])
            if (
                focused[2] == "none"
                and "splitter" not in focused[1]
                and not focused[1].startswith("BODY")
            ):
                invisible.append(focused[1])
        assert reached >= {"findings", "graph", "source", "top"}
        assert invisible == []


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_theme_follows_the_system_until_it_is_chosen(theme: str, report: Open) -> None:
    ground = "() => getComputedStyle(document.body).backgroundColor"
    with report(door_check(), theme=theme) as open_report:
        page = open_report.page

        def brightness() -> int:
            color = page.evaluate(ground)
            return sum(int(part) for part in color[4:-1].split(","))

        before = brightness()
        assert (before > 600) == (theme == "light")
        seen = set()
        for _ in range(3):
            open_report.press("t")
            seen.add(brightness() > 600)
        assert seen == {True, False}


def test_print_holds_findings_stories_and_text(report: Open) -> None:
    document = door_check()
    with report(document) as open_report:
        page = open_report.page
        page.emulate_media(media="print")
        page.evaluate("dispatchEvent(new Event('beforeprint'))")
        for finding in document["plans"][0]["findings"]:
            if finding["suppressed"]:
                continue
            item = page.locator(".finding", has_text=finding["message"]).first
            assert item.locator(".finding-message").is_visible()
            assert not finding["hint"] or item.get_by_text(finding["hint"]).is_visible()
        assert page.locator(".scenario .story li").first.is_visible()
        assert not page.locator(".filters").is_visible()
        rows = page.locator(".tree .row")
        assert rows.count() == len(document["plans"][0]["elements"])
        assert rows.first.is_visible()
        pages = page.pdf()
        assert pages.startswith(b"%PDF")


_CUT = """() => [...document.querySelectorAll('#app *')].filter((one) => {
  if (!one.checkVisibility() || one.closest('.graph, select, button, .unseen')) return false;
  const { overflowX, overflowY } = getComputedStyle(one);
  const cut = (overflow, inner, outer) => overflow !== 'visible' && inner > outer + 1;
  return cut(overflowX, one.scrollWidth, one.clientWidth) ||
    cut(overflowY, one.scrollHeight, one.clientHeight);
}).map((one) => one.className)"""
_GROUND = "getComputedStyle(document.body).backgroundColor"
_INK = """(canvas) => {
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  let [dark, light] = [0, 0];
  for (let at = 0; at < data.length; at += 4) {
    if (data[at + 3] < 200) continue;
    const sum = data[at] + data[at + 1] + data[at + 2];
    if (sum < 200) dark += 1;
    else if (sum > 600) light += 1;
  }
  return [dark, light];
}"""


def large() -> dict[str, Any]:
    """A plan whose text and tree are much longer than a window, with a hundred findings."""
    name = "nav2_capabilities/WaypointRunner"
    runner = f"<Runner interface='{name}' provider='{name}' x='{{}}' y='0'/>\n"
    group = "<Control type='parallel_all'>\n{}</Control>\n"
    groups = [group.format("".join(runner.format(n) for n in range(10))) for _ in range(30)]
    return document_of(f"<Plan>{''.join(groups)}</Plan>")


@pytest.mark.parametrize("several", [False, True])
def test_printing_is_no_failure(several: bool, report: Open) -> None:
    """Rows that are made because their pane has grown would make it grow again."""
    document = large()
    if several:
        text = document["plans"][0]["source"]
        document = document_of(text, text.replace("parallel_all", "parallel_any"), diff=True)
    with report(document, size=(1280, 800)) as open_report:
        page = open_report.page
        page.evaluate("() => { globalThis.failures = []; }")
        page.evaluate("addEventListener('error', (event) => failures.push(event.message))")
        for _ in range(2):
            assert page.pdf(format="A4").count(b"/Type /Page\n") >= (2 if several else 10)
            page.emulate_media(media="print")
            open_report.drawn()
            page.emulate_media(media="null")
            open_report.drawn()
        assert page.evaluate("failures") == []
        assert page.locator(".page-error").count() == 0


def test_a_size_that_is_observed_late_is_told_nobody(report: Open) -> None:
    tell = """(message) => dispatchEvent(new ErrorEvent('error', { message }))"""
    with report(door_check()) as open_report:
        page = open_report.page
        page.evaluate(tell, "ResizeObserver loop completed with undelivered notifications.")
        assert page.locator(".page-error").count() == 0
        page.evaluate(tell, "Uncaught Error: x")
        assert open_report.text(".page-error") == "An error in this page: Uncaught Error: x"


def test_paper_holds_all_of_it(report: Open) -> None:
    document = large()
    with report(document, size=(794, 1123), theme="dark") as open_report:
        page = open_report.page
        view = """() => {
          const { pan, zoom } = document.querySelector('.graph-touch').gpsfsmGraph.camera;
          return [pan.x, pan.y, zoom];
        }"""
        page.get_by_role("button", name="Zoom in").click()
        before = page.evaluate(view)
        page.evaluate("dispatchEvent(new Event('beforeprint'))")
        page.emulate_media(media="print", color_scheme="dark")
        open_report.drawn()
        assert page.evaluate(_CUT) == []
        lines = document["plans"][0]["source"].splitlines()
        assert page.locator(".source .line").count() == len(lines)
        assert page.locator(".tree .row").count() == len(document["plans"][0]["elements"])
        shown = [each for each in document["plans"][0]["findings"] if not each["suppressed"]]
        assert page.locator(".finding-head:visible").count() == len(shown) > 40
        assert page.locator(".finding .finding-body:visible").count() == 40
        canvases = page.locator(".graph-canvas:visible")
        assert canvases.count() == 1  # one that is cleared hides those below it on paper
        assert page.evaluate(_GROUND) == "rgb(255, 255, 255)"
        page.evaluate("dispatchEvent(new Event('afterprint'))")
        page.emulate_media(media="null", color_scheme="dark")
        open_report.drawn()
        assert page.evaluate(view) == pytest.approx(before)
        assert page.locator(".graph-canvas:visible").count() == 3


def test_the_automaton_is_printed_in_ink(report: Open) -> None:
    with report(door_check(), size=(794, 1123), theme="dark") as open_report:
        page = open_report.page
        page.emulate_media(media="print", color_scheme="dark")
        open_report.drawn()
        dark, light = page.locator(".graph-canvas:visible").evaluate(_INK)
        assert dark > 500  # letters and lines
        assert light > 5 * dark  # and grounds


def test_paper_is_light(report: Open) -> None:
    ink = "() => getComputedStyle(document.body).color.match(/[0-9]+/g).map(Number)"
    with report(door_check(), theme="dark") as open_report:
        page = open_report.page
        open_report.press("t", "t")
        assert sum(page.evaluate(ink)) > 600
        page.evaluate("dispatchEvent(new Event('beforeprint'))")
        assert sum(page.evaluate(ink)) < 200
        page.evaluate("dispatchEvent(new Event('afterprint'))")
        assert sum(page.evaluate(ink)) > 600


def test_less_motion(report: Open) -> None:
    with report(door_check(), reduced_motion="reduce") as open_report:
        moving = open_report.page.evaluate(
            """() => [...document.querySelectorAll('*')].filter((one) => {
              const style = getComputedStyle(one);
              return style.animationName !== 'none' || parseFloat(style.transitionDuration) > 0;
            }).length"""
        )
        assert moving == 0
        open_report.open_play("GP303")
        open_report.press(".", ".")
        assert open_report.step()[0] == 2


@pytest.mark.parametrize("size", [(480, 800), (800, 900), (1000, 700), (2560, 1400)])
def test_no_screen_is_too_small(size: tuple[int, int], report: Open) -> None:
    with report(door_check(), size=size) as open_report:
        page = open_report.page
        across = page.evaluate("document.documentElement.scrollWidth")
        assert across <= size[0]
        open_report.open_play("GP303")
        open_report.press("1", ".")
        for selector in (".findings", ".graph", ".source", ".playbar"):
            box = page.locator(selector).bounding_box()
            assert box is not None
            assert box["width"] >= min(200, size[0] / 3)
            assert box["height"] >= 60
            assert box["x"] + box["width"] <= size[0] + 1


def test_several_plans_are_sorted_filtered_and_opened(report: Open) -> None:
    texts = [
        "<Plan><Runner interface='a/Go' provider='a/Go'/></Plan>",
        "no plan at all",
        (REPO / "docs" / "examples" / "door_check.xml").read_text(encoding="utf-8"),
    ]
    document = document_of(*texts, options=check_options())
    with report(document) as open_report:
        page = open_report.page

        def names() -> list[str]:
            return open_report.texts(".summary-table .plan-link")

        assert names() == ["plan0.xml", "plan1.xml", "plan2.xml"]
        verdicts = open_report.texts(".summary-table .verdict")
        assert [words.split()[-1] for words in verdicts] == ["accepted", "rejected", "rejected"]
        page.get_by_role("button", name="Errors").click()
        counts = [
            len([each for each in plan["findings"] if each["severity"] == "error"])
            for plan in document["plans"]
        ]
        order = sorted(range(3), key=lambda place: -counts[place])
        assert names() == [f"plan{place}.xml" for place in order]
        page.get_by_role("button", name="Errors").click()
        assert names() == [
            f"plan{place}.xml" for place in sorted(range(3), key=lambda p: counts[p])
        ]
        assert open_report.text("th[aria-sort=ascending]").split()[0] == "Errors"
        page.get_by_label("Filter plans").fill("ACCEPTED")
        assert names() == ["plan0.xml"]
        page.get_by_label("Filter plans").fill("plan2")
        page.locator(".summary-table .plan-link").press("Enter")
        open_report.drawn()
        assert page.locator(".plan-chooser").input_value() == "2"
        assert "GP307" in shown_rules(open_report)
        open_report.press("[")
        assert page.locator(".plan-chooser").input_value() == "1"
        assert page.locator(".finding").count() == len(document["plans"][1]["findings"])


def test_what_is_chosen_is_seen_where_the_system_chooses_the_colours(report: Open) -> None:
    style = "(one) => getComputedStyle(one)"
    with report(door_check(), forced_colors="active") as open_report:
        page = open_report.page
        open_report.select("GP303")
        for selector in (SELECTED, ".source .line.selected"):
            drawn = page.locator(selector).first.evaluate(f"one => ({style})(one).outlineStyle")
            assert drawn == "solid", selector
        related = page.locator(".source .line.is-related").first
        assert related.evaluate(f"one => ({style})(one).outlineStyle") == "dashed"
        color = f"one => ({style})(one).borderBottomColor"
        tabs = {
            page.locator(f'.tabs [aria-selected="{chosen}"]').first.evaluate(color)
            for chosen in ("true", "false")
        }
        assert len(tabs) == 2


TOUR = (REPO / "corpus" / "plans" / "tour_guide.xml").read_text(encoding="utf-8")


def test_findings_come_worst_first(report: Open) -> None:
    with report(document_of(TOUR)) as open_report:
        severities = open_report.page.eval_on_selector_all(
            ".finding", "all => all.map((one) => one.classList[1])"
        )
    order = ["error", "warning", "info"]
    assert set(severities) == set(order), "the plan has some of each"
    assert severities == sorted(severities, key=order.index)


def test_the_text_shows_the_parameters_of_runners(report: Open) -> None:
    """Without scrolling; what is left out is copied, and shown in the line that is chosen."""
    within = """() => {
      const pane = document.querySelector('.source').getBoundingClientRect();
      return [...document.querySelectorAll('.source .line')].flatMap((line) => {
        const name = [...line.querySelectorAll('.xml-name')].find((one) => one.textContent === 'y');
        const value = name?.nextElementSibling.nextElementSibling;
        return value ? [value.getBoundingClientRect().right < pane.right] : [];
      });
    }"""
    line = TOUR.split("\n")[7]
    assert 'interface="nav2_capabilities/WaypointRunner"' in line
    with report(document_of(TOUR)) as open_report:
        open_report.page.set_viewport_size({"width": 1280, "height": 900})
        open_report.drawn()
        seen = open_report.page.evaluate(within)
        assert len(seen) == TOUR.count(' y="')
        assert all(seen)
        row = open_report.page.locator('.source [data-line="8"] .line-text')
        assert row.text_content() == line, "what is copied"
        folded = row.bounding_box()
        row.click(position={"x": 60, "y": 8})
        open_report.drawn()
        whole = row.bounding_box()
    assert folded is not None
    assert whole is not None
    assert whole["width"] > folded["width"] + 100


def test_a_long_path_shows_its_end(report: Open) -> None:
    document = document_of(TOUR)
    document["plans"][0]["name"] = "/robots/" + "very/long/" * 20 + "tour_guide.xml"
    inside = """() => {
      const box = document.querySelector('.plan-name').getBoundingClientRect();
      const text = document.querySelector('.plan-name bdi').firstChild;
      const range = document.createRange();
      range.setStart(text, text.length - 'tour_guide.xml'.length);
      range.setEnd(text, text.length);
      const end = range.getBoundingClientRect();
      return end.width > 50 && end.left >= box.left && end.right <= box.right + 1;
    }"""
    with report(document) as open_report:
        assert open_report.page.evaluate(inside)
