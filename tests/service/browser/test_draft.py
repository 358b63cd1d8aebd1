"""The live page: what one writes is checked while one writes it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.browser_support import shown_text
from tests.conftest import REPO
from tests.service.browser.live import plan, speech, waypoint
from tests.service.support import Service

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tests.service.browser.conftest import Open

GOOD = plan(waypoint(2, 5), speech("Here I am."))
BROKEN = plan(waypoint(2, 5), "<Runner")
HOSTILE = plan(
    f'<Control type="sequential" name="&lt;img src=x onerror=alert(1)&gt;">'
    f"{speech('&lt;/script&gt;&lt;script&gt;alert(1)&lt;/script&gt;')}</Control>"
)


@pytest.fixture(scope="module")
def service() -> Iterator[Service]:
    """Without a journal: it checks, and runs nothing."""
    with Service("--workers", "1") as server:
        yield server


def test_findings_come_and_go_as_one_types(service: Service, live: Open) -> None:
    with live(service.address) as page:
        page.write(BROKEN)
        assert page.status.inner_text().startswith("✗")
        page.page.locator(".editor-sign.error").wait_for()
        assert "line" in shown_text(page.page.locator(".finding.error").first)
        page.write(GOOD)
        page.page.locator(".draft-status.good").wait_for()
        page.page.locator(".editor-sign.error").first.wait_for(state="detached")
        page.page.locator(".finding.error").first.wait_for(state="detached")
        page.page.locator(".draft-stage .graph").wait_for()
        page.editor.fill("")
        page.page.locator(".stage-empty").wait_for()
        page.page.locator(".finding").first.wait_for(state="detached")


_ROWS = """() => {
  const area = document.querySelector('.editor-text');
  const top = (one) => Math.round(one.getBoundingClientRect().top);
  return {
    cut: area.scrollWidth > area.clientWidth,
    lines: [...document.querySelectorAll('.editor-copy > div')]
      .map((one) => [top(one), one.offsetHeight]),
    numbers: document.querySelector('.editor-numbers').textContent.split('\\n'),
    first: top(document.querySelector('.editor-numbers')),
    high: area.scrollHeight - 12,
    sign: top(document.querySelector('.editor-sign')) - 3,
    underline: top(document.querySelector('.editor-underline')),
  };
}"""


def test_long_lines_of_the_editor_are_wrapped_beside_their_numbers(
    service: Service, live: Open
) -> None:
    text = plan(waypoint(1, 2), "<Runner/>", "", speech("x" * 200))
    with live(service.address) as page:
        page.write(text)
        page.page.locator(".editor-sign.error").wait_for()
        rows = page.page.evaluate(_ROWS)
        assert not rows["cut"]  # x and y are in view
        heights = [height for _, height in rows["lines"]]
        assert len(heights) == text.count("\n") + 1
        assert heights[0] == heights[2] == heights[3] == 20
        assert heights[1] >= 60
        assert sum(heights) == pytest.approx(rows["high"], abs=1)  # as the text itself
        for line, (top, _) in enumerate(rows["lines"], start=1):
            if str(line) in rows["numbers"]:
                row = rows["numbers"].index(str(line))
                assert top == pytest.approx(rows["first"] + 20 * row, abs=1)
        assert rows["sign"] == pytest.approx(rows["lines"][2][0], abs=1)
        assert rows["underline"] == pytest.approx(rows["lines"][2][0], abs=2)
        page.editor.click()
        page.page.keyboard.press("Control+End")
        page.page.keyboard.type("\n<!-- one more -->")
        lines = page.page.locator(".editor-copy > div")
        lines.nth(text.count("\n") + 1).wait_for(state="attached")
        assert lines.count() == text.count("\n") + 2


def test_only_the_last_text_counts(service: Service, live: Open) -> None:
    with live(service.address) as page:
        page.editor.click()
        page.page.keyboard.type("<Plan><Runner/>", delay=5)
        page.page.keyboard.type("</Plan>", delay=5)
        page.page.locator(".draft-status.bad").wait_for()
        for text in (BROKEN, GOOD, BROKEN, GOOD):
            page.editor.fill(text)
        page.page.locator(".draft-status.good").wait_for()
        page.tab("Text").click()
        page.page.locator(".details-panel.text .source").wait_for()
        page.page.locator(".details-panel.text").filter(has_text="Here I am.").wait_for()


def test_a_finding_leads_to_its_place_and_its_scenario_is_played(
    service: Service, live: Open
) -> None:
    with live(service.address) as page:
        page.write(GOOD)
        page.page.locator(".finding-head").first.click()
        selected = "area => area.value.slice(area.selectionStart, area.selectionEnd)"
        assert "Runner" in page.editor.evaluate(selected)
        page.page.locator(".finding-play").first.click()
        page.page.locator(".draft-player .playbar").wait_for()
        page.page.get_by_label("To the end").click()
        page.page.locator(".play-head").filter(has_text="gave up").wait_for()


def test_what_is_chosen_in_a_pane_is_shown_in_the_others(service: Service, live: Open) -> None:
    with live(service.address) as page:
        page.write(GOOD)
        page.tab("Tree").click()
        page.page.get_by_role("treeitem").nth(2).click()
        page.page.locator(".editor-band.chosen").wait_for()
        page.editor.click()
        page.page.keyboard.press("Control+Home")
        page.page.keyboard.press("ArrowDown")
        row = page.page.locator("[role=treeitem][aria-selected=true]")
        row.filter(has_text="WaypointRunner").wait_for()


def test_a_text_stays_text(service: Service, live: Open) -> None:
    with live(service.address) as page:
        page.write(HOSTILE)
        page.tab("Tree").click()
        page.page.get_by_role("treeitem").filter(has_text="<img src=x").wait_for()
        assert page.page.locator("#gpsfsm-live img").count() == 0
        assert page.page.evaluate("document.scripts.length") == 1


def test_a_file_is_dropped(service: Service, live: Open) -> None:
    with live(service.address) as page:
        drop = """(body, text) => {
            const files = new DataTransfer();
            files.items.add(new File([text], "from_disk.xml"));
            for (const kind of ["dragenter", "dragover", "drop"]) {
                body.dispatchEvent(new DragEvent(kind, { dataTransfer: files, bubbles: true }));
            }
        }"""
        body = page.page.locator(".editor-body")
        body.evaluate(drop, GOOD)
        page.page.locator(".draft-status.good").wait_for()
        assert page.editor.input_value() == GOOD
        assert page.page.get_by_label("Name of the plan").input_value() == "from_disk.xml"
        body.evaluate(drop, "x" * (2 << 20))
        page.toasts.filter(has_text="too long").wait_for()
        assert page.editor.input_value() == GOOD


def test_it_says_what_this_service_does_not_do(service: Service, live: Open) -> None:
    with live(service.address) as page:
        page.write(GOOD)
        run = page.button("Run")
        assert run.is_disabled()
        assert "--journal" in (run.get_attribute("title") or "")
        assert page.button("Write a plan").is_disabled()
        page.tab("Runs").click()
        page.page.locator(".left-panel.runs").filter(has_text="--journal").wait_for()
        page.page.reload()
        page.page.locator(".draft-status.good").wait_for()
        assert page.editor.input_value() == GOOD  # nothing that was written is lost


_OVERLAPS = """() => {
  const labels = [...document.querySelectorAll('.map-label')];
  const figures = [...document.querySelectorAll('.map-person circle')];
  const boxes = [...labels, ...figures]
    .map((one) => [one.textContent, one.getBoundingClientRect()]);
  return boxes.flatMap(([name, one], place) => boxes.slice(0, place)
    .filter(([, other]) => one.left < other.right - 1 && other.left < one.right - 1
      && one.top < other.bottom - 3 && other.top < one.bottom - 3)
    .map(([other]) => `${other} / ${name}`));
}"""


@pytest.mark.parametrize("size", [(1280, 800), (390, 844)])
def test_no_label_of_the_map_covers_another(
    size: tuple[int, int], live: Open, tmp_path: Path
) -> None:
    world = str(REPO / "corpus" / "worlds" / "home.yaml")
    journal = str(tmp_path / "queue.db")
    with (
        Service("--workers", "1", "--journal", journal, "--world", world) as service,
        live(service.address, size=size) as page,
    ):
        page.page.get_by_label("World", exact=True).select_option("home")
        page.page.locator(".map-person").first.wait_for()
        assert page.page.locator(".map-label").count() > 5
        assert page.page.evaluate(_OVERLAPS) == []
