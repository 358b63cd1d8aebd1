"""The automaton in a report: moved, zoomed, pointed at and folded with pointer, wheel and keys."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import pytest

from tests.conftest import REPO
from tests.viewing.browser.reports import document_of

if TYPE_CHECKING:
    from tests.viewing.browser.conftest import Open
    from tests.viewing.browser.reports import Report

_GRAPH = "globalThis.gpsfsmPage.stages.plan.made.graph"
_STORE = "globalThis.gpsfsmPage.store"
_VIEW = f"() => ({{ ...{_GRAPH}.camera.pan, zoom: {_GRAPH}.camera.zoom }})"
_ITEM = f"""(node) => {{
  const {{ camera, picture }} = {_GRAPH};
  const {{ box }} = picture().items[picture().itemOf[node]];
  const edge = document.querySelector('.graph-touch').getBoundingClientRect();
  return [edge.x + camera.pan.x + (box.x + box.width / 2) * camera.zoom,
          edge.y + camera.pan.y + (box.y + box.height / 2) * camera.zoom];
}}"""
_CAPTION = f"""(group) => {{
  const {{ camera, picture }} = {_GRAPH};
  const {{ box }} = picture().groups.find((one) => one.group === group);
  const edge = document.querySelector('.graph-touch').getBoundingClientRect();
  return [edge.x + camera.pan.x + (box.x + 12) * camera.zoom,
          edge.y + camera.pan.y + (box.y + 12) * camera.zoom];
}}"""
_FOLDED = f"() => [...{_STORE}.state.collapsed]"


@cache
def tour() -> dict[str, Any]:
    return document_of((REPO / "corpus" / "plans" / "tour_guide.xml").read_text(encoding="utf-8"))


def view(report: Report) -> dict[str, float]:
    report.drawn()
    camera: dict[str, float] = report.page.evaluate(_VIEW)
    return camera


def item(report: Report, node: int) -> tuple[float, float]:
    x, y = report.page.evaluate(_ITEM, node)
    return x, y


def ground(report: Report) -> tuple[float, float]:
    """A place of the pane where nothing is drawn."""
    box = report.page.locator(".graph-touch").bounding_box()
    assert box is not None
    return box["x"] + 4, box["y"] + box["height"] / 2


def test_dragging_moves_the_picture_and_the_wheel_zooms_about_the_pointer(report: Open) -> None:
    with report(tour()) as open_report:
        mouse = open_report.page.mouse
        before = view(open_report)
        x, y = item(open_report, 1)  # what is dragged by is not what moves
        mouse.move(x, y)
        mouse.down()
        mouse.move(x + 30, y + 20)
        mouse.move(x + 60, y + 40)
        mouse.up()
        moved = view(open_report)
        assert moved["x"] - before["x"] == pytest.approx(60)
        assert moved["y"] - before["y"] == pytest.approx(40)
        assert open_report.page.evaluate(f"() => {_STORE}.state.node") == -1
        at = item(open_report, 1)
        mouse.move(*at)
        mouse.wheel(0, -120)
        assert view(open_report)["zoom"] > before["zoom"]
        assert item(open_report, 1) == pytest.approx(at, abs=0.5)


def test_a_click_selects_what_is_pointed_at(report: Open) -> None:
    with report(tour()) as open_report:
        page = open_report.page
        page.mouse.move(*item(open_report, 1))
        open_report.drawn()
        assert page.evaluate(f"() => {_STORE}.state.hoveredNode") == 1
        page.mouse.click(*item(open_report, 1))
        element = page.evaluate(f"() => {_STORE}.state.element")
        assert element == open_report.plan["automaton"]["nodes"][1]["element"]
        assert page.evaluate("document.activeElement.className") == "graph"
        page.mouse.click(*ground(open_report))
        assert page.evaluate(f"() => {_STORE}.state.element") == -1
        assert page.evaluate(f"() => {_STORE}.state.hoveredNode") == -1


def test_a_control_is_folded_by_its_sign_and_stays_where_it_is(report: Open) -> None:
    with report(tour()) as open_report:
        page = open_report.page
        place = page.evaluate(_CAPTION, 0)
        page.mouse.click(*place)
        open_report.drawn()
        assert page.evaluate(_FOLDED) == [0]
        node = open_report.plan["automaton"]["group_of"].index(0)
        page.mouse.click(*item(open_report, node))
        open_report.drawn()
        assert page.evaluate(_FOLDED) == []
        x, y = page.evaluate(_CAPTION, 0)
        page.wait_for_timeout(400)  # so that it is no second click
        page.mouse.dblclick(x + 60, y)
        assert page.evaluate(_FOLDED) == [0]


def test_keys_move_zoom_and_fold(report: Open) -> None:
    with report(tour()) as open_report:
        page = open_report.page
        open_report.press("3")
        before = view(open_report)
        open_report.press("ArrowLeft", "ArrowUp")
        moved = view(open_report)
        assert (moved["x"] - before["x"], moved["y"] - before["y"]) == (60, 60)
        open_report.press("+")
        assert view(open_report)["zoom"] == pytest.approx(1.25 * before["zoom"])
        element = open_report.plan["automaton"]["groups"][0]["element"]
        page.evaluate(f"(element) => {_STORE}.selectElement(element, 'tree')", element)
        open_report.press("Enter")
        assert page.evaluate(_FOLDED) == [0]


def test_after_printing_the_automaton_is_what_it_was(report: Open) -> None:
    """Some browsers tell a page of printing by two events alone."""
    paper = f"() => {_GRAPH}.camera.onPaper"
    with report(tour()) as open_report:
        page = open_report.page
        open_report.press("3", "+", "ArrowLeft")
        before = view(open_report)
        page.evaluate("dispatchEvent(new Event('beforeprint'))")
        assert page.evaluate(paper)
        assert view(open_report)["zoom"] != before["zoom"]
        page.evaluate("dispatchEvent(new Event('afterprint'))")
        assert not page.evaluate(paper)
        assert view(open_report) == pytest.approx(before)


def test_two_fingers_zoom(report: Open) -> None:
    touch = """(steps) => {
      const one = document.querySelector('.graph-touch');
      const edge = one.getBoundingClientRect();
      one.setPointerCapture = () => {};
      for (const [type, pointerId, x, y] of steps) {
        one.dispatchEvent(new PointerEvent(type, {
          pointerId, pointerType: 'touch', clientX: edge.x + x, clientY: edge.y + y,
        }));
      }
    }"""
    with report(tour()) as open_report:
        before = view(open_report)
        open_report.page.evaluate(
            touch,
            [
                ("pointerdown", 1, 100, 200),
                ("pointerdown", 2, 200, 200),
                ("pointermove", 2, 250, 200),
                ("pointermove", 1, 50, 200),
                ("pointerup", 1, 50, 200),
                ("pointerup", 2, 250, 200),
            ],
        )
        assert view(open_report)["zoom"] == pytest.approx(2 * before["zoom"])
        assert open_report.page.evaluate(f"() => {_STORE}.state.element") == -1


def test_the_layered_picture_is_there_for_small_graphs(report: Open) -> None:
    with report(tour()) as open_report:
        page = open_report.page
        button = page.get_by_label("Layout: by structure, or layered")
        button.click()
        open_report.drawn()
        assert button.get_attribute("aria-pressed") == "true"
        assert page.evaluate(f"() => {_GRAPH}.picture().groups.length") == 0
        page.mouse.click(*item(open_report, 1))
        assert page.evaluate(f"() => {_STORE}.state.node") == 1


_MAP = ".minimap"
_RUNNER = '<Runner interface="a/A" provider="a/A"/>'


def large() -> dict[str, Any]:
    part = f'<Control type="parallel_all" name="both">{_RUNNER * 3}</Control>{_RUNNER}'
    return document_of(f"<Plan>{part * 75}</Plan>")


def test_the_overview_moves_the_view_by_pointer_and_by_keys(report: Open) -> None:
    with report(large()) as open_report:
        page = open_report.page
        open_report.press("f")
        assert not page.locator(_MAP).is_visible()  # all of it is in view
        for _ in range(8):
            page.get_by_label("Zoom in (+)").click()
        open_report.drawn()
        assert page.locator(_MAP).is_visible()
        box = page.locator(".minimap-canvas").bounding_box()
        assert box is not None
        page.mouse.move(box["x"] + 10, box["y"] + 10)
        page.mouse.down()
        near = view(open_report)
        page.mouse.move(box["x"] + box["width"] - 10, box["y"] + box["height"] - 10)
        page.mouse.up()
        far = view(open_report)
        assert far["x"] < near["x"]
        assert far["y"] < near["y"]
        assert far["zoom"] == near["zoom"]
        frame = page.locator(".minimap-frame").bounding_box()
        assert frame is not None
        assert frame["x"] > box["x"] + box["width"] / 2
        page.locator(_MAP).focus()
        open_report.press("ArrowLeft")
        assert view(open_report)["x"] > far["x"]
        open_report.press("Home")
        assert view(open_report)["x"] > 0


def test_small_controls_are_blocks_that_count_their_runners(report: Open) -> None:
    with report(large()) as open_report:
        open_report.press("f")
        picture, zoom = f"{_GRAPH}.picture()", f"{_GRAPH}.camera.zoom"
        assert open_report.page.evaluate(f"() => {zoom}") < 0.3
        blocks = open_report.page.evaluate(
            f"() => globalThis.gpsfsmPage.stages.plan.made.graph.blocks({picture}, {zoom})"
        )
        assert len(blocks) == 75
        assert {block["runners"] for block in blocks} == {3}


def flat() -> dict[str, Any]:
    """Sixty small controls and what stands between them, one after the other."""
    recovery = f'<Control type="recovery">{_RUNNER}</Control>'
    room = '<Control type="parallel_all" name="room {}">' + 2 * _RUNNER + "</Control>"
    rooms = (f"{room.format(n)}{recovery}{_RUNNER}{recovery}" for n in range(60))
    return document_of("\n".join(["<Plan>", *rooms, "</Plan>"]))


def test_a_flat_plan_opens_at_its_beginning_and_its_overview_can_be_read(report: Open) -> None:
    with report(flat(), size=(1280, 800)) as open_report:
        assert view(open_report)["zoom"] >= 0.7
        x, y = item(open_report, 0)
        pane = open_report.page.locator(".graph").bounding_box()
        assert pane is not None
        assert pane["x"] < x < pane["x"] + pane["width"]
        assert pane["y"] < y < pane["y"] + pane["height"] / 2
        open_report.press("f")
        open_report.settled()
        zoom = view(open_report)["zoom"]
        blocks = open_report.page.evaluate(f"() => {_GRAPH}.blocks({_GRAPH}.picture(), {zoom})")
        assert 4 < len(blocks) < 60
        boxes = [each["box"] for each in blocks]
        large = [box for box in boxes if box["width"] * zoom > 50 and box["height"] * zoom > 32]
        assert len(large) >= 0.8 * len(blocks)  # where a column ends one may be small
        for place, one in enumerate(boxes):
            for other in boxes[:place]:
                apart = (
                    one["x"] >= other["x"] + other["width"]
                    or other["x"] >= one["x"] + one["width"]
                    or one["y"] >= other["y"] + other["height"]
                    or other["y"] >= one["y"] + one["height"]
                )
                assert apart
        assert "room 0" in blocks[0]["label"]
        assert "room 1" in blocks[0]["last"]["label"]
        assert 250 < sum(block["runners"] for block in blocks) <= 300


@pytest.mark.parametrize("size", [(1280, 800), (1920, 1080), (390, 844)])
def test_a_picture_opens_whole_only_if_it_can_be_read(size: tuple[int, int], report: Open) -> None:
    with report(tour(), size=size) as open_report:
        assert view(open_report)["zoom"] >= 0.7


_COVERED = f"""() => {{
  const {{ camera, picture }} = {_GRAPH};
  const node = {_STORE}.state.node;
  const {{ box }} = picture().items[picture().itemOf[node]];
  const pane = document.querySelector('.graph-touch').getBoundingClientRect();
  const left = pane.x + camera.pan.x + box.x * camera.zoom;
  const top = pane.y + camera.pan.y + box.y * camera.zoom;
  const [right, bottom] = [left + box.width * camera.zoom, top + box.height * camera.zoom];
  const above = [...document.querySelectorAll('.minimap, .graph-legend, .graph-tools > *')];
  return {{
    outside: left < pane.left || right > pane.right || top < pane.top || bottom > pane.bottom,
    covered: above.filter((one) => one.checkVisibility({{ visibilityProperty: true }}))
      .map((one) => [one.className, one.getBoundingClientRect()])
      .filter(([, each]) => left < each.right && right > each.left
        && top < each.bottom && bottom > each.top)
      .map(([name]) => name),
    sentences: [...document.querySelectorAll('.story li.current')].map((line) => {{
      const {{ x, bottom }} = line.getBoundingClientRect();
      return document.elementFromPoint(x + 30, bottom - 4)?.closest('li') === line;
    }}),
  }};
}}"""


def test_what_happens_in_a_step_is_in_view_and_nothing_covers_it(report: Open) -> None:
    with report(tour(), size=(1280, 800)) as open_report:
        open_report.page.locator(".finding", has_text="GP303").locator(".finding-play").click()
        open_report.page.get_by_label("To the start").click()
        sentences = 0
        steps = open_report.step()[1]
        assert steps > 10
        for _ in range(steps):
            open_report.press(".")
            open_report.settled()
            drawn = open_report.page.evaluate(_COVERED)
            assert not drawn["outside"]
            assert drawn["covered"] == []
            assert all(drawn["sentences"])
            sentences += len(drawn["sentences"])
        assert sentences >= 10  # in the list and in the bar
        assert "give up" in open_report.page.evaluate(
            f"() => {_GRAPH}.picture().items[{_GRAPH}.picture().itemOf[{_STORE}.state.node]].lines"
        )
