"""What fits: on narrow screens, in the boxes of the automaton, and of pictures that are large."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import pytest
from lxml import etree

from tests.conftest import REPO
from tests.viewing.browser.reports import document_of

if TYPE_CHECKING:
    from tests.viewing.browser.conftest import Open
    from tests.viewing.browser.reports import Report

DOOR, MACHINE = "docs/examples/door_check.xml", "docs/examples/door.json"
NAMES_FROM = 0.36
READABLE = 0.7
"""A larger part than this of 12 pixels can be read."""
"""The zoom from which names are drawn."""
REACTIVE = """<root BTCPP_format="4"><BehaviorTree ID="Go"><RecoveryNode number_of_retries="4">
<ReactiveSequence><IsGoal/><IsSafe/><IsCharged/><IsFree/><FollowPath/></ReactiveSequence>
<Sequence><ClearLocalCostmap/><ClearGlobalCostmap/><Spin/><Wait/></Sequence>
</RecoveryNode></BehaviorTree></root>"""
RUNNER = "<Runner interface='n/Go' provider='n/Go' x='1' y='2'/>"
_CAMERAS = """() => [...document.querySelectorAll('.graph-touch')]
  .filter((touch) => touch.checkVisibility())
  .map((touch) => touch.gpsfsmGraph.camera)"""
_ZOOMS = f"() => ({_CAMERAS})().map((camera) => camera.zoom)"
_WHOLE = f"""() => {{
  const [camera] = ({_CAMERAS})();
  const {{ left, top, right, bottom }} = camera.viewNow();
  const {{ width, height }} = camera.picture;
  return left <= 0 && top <= 0 && right >= width && bottom >= height;
}}"""
_HIDDEN = """(selector) => {
  const around = document.documentElement.clientWidth;
  const shown = [...document.querySelectorAll(selector)].filter((one) => one.checkVisibility());
  return shown.filter((one) => {
    const pane = one.closest('.pane, .compare-pane, .stage').getBoundingClientRect();
    const { left, right } = one.getBoundingClientRect();
    return left < pane.left || right > Math.min(pane.right, around);
  }).map((one) => one.textContent);
}"""
_SIGN = """(node) => {
  const { picture, camera, screen } = document.querySelector('.graph-touch').gpsfsmGraph;
  const { box } = picture.items[picture.itemOf[node]];
  const { zoom, pan } = camera;
  const canvas = screen.layers.top;
  const ratio = canvas.width / canvas.clientWidth;
  const [x, y] = [(box.x - 12) * zoom + pan.x, (box.y - 5) * zoom + pan.y];
  return [...canvas.getContext('2d').getImageData(x * ratio, y * ratio, 1, 1).data];
}"""


@cache
def of(*files: str, diff: bool = False) -> dict[str, Any]:
    texts = [(REPO / file).read_text(encoding="utf-8") for file in files]
    return document_of(*texts, diff=diff)


def zooms(report: Report) -> list[float]:
    report.settled()
    zooms: list[float] = report.page.evaluate(_ZOOMS)
    return zooms


@pytest.mark.parametrize("size", [(1440, 900), (1240, 800), (1024, 768), (390, 844)])
def test_all_buttons_are_in_their_panes_and_coordinates_are_seen(
    size: tuple[int, int], report: Open
) -> None:
    with report(of(DOOR), size=size) as opened:
        assert opened.page.evaluate(_HIDDEN, ".graph-tools > *, .pane-head .copies > *") == []
        lines = opened.page.locator(".line", has_text="WaypointRunner")
        lines.first.wait_for()
        seen = opened.page.evaluate(
            """() => [...document.querySelectorAll('.line')]
              .filter((line) => line.textContent.includes('WaypointRunner'))
              .flatMap((line) => [...line.querySelectorAll('.xml-value:not(.folded)')].slice(-2))
              .map((one) => one.getBoundingClientRect().right)"""
        )
        room = opened.page.locator(".source").bounding_box()
        assert room is not None
        assert len(seen) == 6
        assert max(seen) <= room["x"] + room["width"]


def test_a_line_that_a_finding_chooses_keeps_its_coordinates_in_view(report: Open) -> None:
    with report(of(DOOR), size=(1240, 800)) as opened:
        opened.select("GP307")
        opened.page.locator(".finding.selected .place", has_text="line 3").click()
        opened.page.locator(".line.current[data-line='3']").wait_for()
        line = opened.page.locator(".line.current")
        assert "x=" in line.inner_text()
        folded = "(line) => getComputedStyle(line.querySelector('.folded')).fontSize"
        assert line.evaluate(folded) == "0px"
        line.locator(".line-text").click()  # here it is wanted as it is
        assert opened.page.locator(".line.current").evaluate(folded) != "0px"


COMPACT = """{"nodes": [
  {"id": "go", "kind": "start"},
  {"index": 1, "kind": "runner", "name": "/machine/éa", "origin": "/machine/éa", "need": 0, \
"interface": "nav2_capabilities/WaypointRunner", "provider": "nav2_capabilities/WaypointRunner", \
"parameters": {"id": 7, "x": -4.25, "y": 0.5, "say": "}\\"{"}},
  {"id": "end", "kind": "complete"}], "edges": []}
"""


@pytest.mark.parametrize("size", [(1440, 900), (1280, 800), (1024, 768)])
def test_coordinates_and_targets_of_a_machine_are_seen(size: tuple[int, int], report: Open) -> None:
    machine = (REPO / "docs/examples/door.json").read_text(encoding="utf-8")
    with report(document_of(machine), size=size) as opened:
        room = opened.page.locator(".source").bounding_box()
        assert room is not None
        for part in ('"y": 0.5', '"May I pass?"', '"watch", "SUCCEEDED", "drive", "stop"'):
            words = part.split(": ")[-1].split(", ")
            line = opened.page.locator(".line", has_text=words[-1]).filter(has_text=words[0])
            ends = line.first.locator("span:not(.folded)", has_text=words[-1]).last.bounding_box()
            assert ends is not None
            assert ends["width"] > 0
            assert ends["x"] + ends["width"] <= room["x"] + room["width"]
        shown = opened.page.locator(".line[data-line='4'] .line-text").inner_text()
        assert shown.startswith("  {"), "its mark begins there"
        rows = opened.page.locator(".line .line-text").all_text_contents()
        assert rows == machine.splitlines(), "what is copied"


def test_of_a_line_of_json_that_is_left_out_which_says_nothing_new(report: Open) -> None:
    seen = """(line) => [...line.querySelectorAll('.line-text span')]
        .filter((one) => !one.classList.contains('folded'))
        .map((one) => one.textContent).join('')"""
    with report(document_of(COMPACT)) as opened:
        line = opened.page.locator(".line[data-line='3']")
        assert line.evaluate(seen) == (
            '  {"/machine/éa", WaypointRunner, {"id": 7, "x": -4.25, "y": 0.5, "say": "}\\"{"}},'
        )
        assert line.locator(".first").count() == 1
        values = line.locator(".xml-value:not(.folded)").all_text_contents()
        assert values[-4:] == ["7", "-4.25", "0.5", '"}\\"{"']
        line.locator(".line-text").click(position={"x": 40, "y": 8})
        folded = "(line) => getComputedStyle(line.querySelector('.folded')).fontSize"
        assert opened.page.locator(".line.current").evaluate(folded) != "0px"


WORDY = """<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>
<ControllerSelector selected_controller="{selected_controller}" default_controller="FollowPath"/>
<ComputePathToPose goal="{goal}" path="{path}" planner_id="{selected_planner}"/>
<Wait mmmmmmmm="wwwwwwwwwwww" WWWWWWWW="MMMMMMMMM=====@@@@@"/>
</Sequence></BehaviorTree></root>"""


def test_the_lines_of_a_node_keep_off_its_border(report: Open) -> None:
    widths = """() => {
      const { picture } = document.querySelector('.graph-touch').gpsfsmGraph;
      const pen = document.createElement('canvas').getContext('2d');
      return picture.items.filter((item) => item.kind === 'runner').flatMap((item) =>
        item.lines.map((line, number) => {
          pen.font = `${number ? '' : '600 '}12px 'DejaVu Sans'`;
          return [line, item.box.width - pen.measureText(line).width];
        }));
    }"""
    with report(document_of(WORDY)) as opened:
        rooms = opened.page.evaluate(widths)
        assert len(rooms) >= 9
        assert [line for line, room in rooms if room < 8] == []


def test_on_paper_the_automaton_has_the_width_of_the_sheet(report: Open) -> None:
    drawn = """() => {
      const { box, picture, zoom } = document.querySelector('.graph-touch').gpsfsmGraph.camera;
      const { width, height } = box.getBoundingClientRect();
      return [picture.width * zoom / width, picture.height * zoom / height];
    }"""
    with report(of(DOOR), size=(794, 1123)) as opened:
        page = opened.page
        page.evaluate("dispatchEvent(new Event('beforeprint'))")
        page.emulate_media(media="print")
        opened.settled()
        across, along = page.evaluate(drawn)
        assert across > 0.9
        assert along > 0.9
        page.evaluate("dispatchEvent(new Event('afterprint'))")
        page.emulate_media(media="screen")


def test_on_paper_a_long_name_is_no_wider_than_the_sheet(report: Open) -> None:
    document = of(DOOR)
    named = document["plans"][0] | {"name": f"/plans/{'of_the_house_' * 20}.xml"}
    with report(document | {"plans": [named]}, size=(794, 1123)) as opened:
        opened.page.emulate_media(media="print")
        opened.drawn()
        assert opened.page.evaluate("document.documentElement.scrollWidth") <= 794
        opened.page.emulate_media(media="screen")


def test_the_timelines_of_a_comparison_have_one_scale(report: Open) -> None:
    text = (REPO / DOOR).read_text(encoding="utf-8")
    longer = text.replace("</Plan>", "<Runner interface='n/Go' provider='n/Go' x='9'/></Plan>")
    with report(document_of(text, longer, diff=True)) as opened:
        page = opened.page
        for _ in range(2):
            lines = [one.bounding_box() for one in page.locator(".timeline-now").all()]
            rows = [one.bounding_box() for one in page.locator(".timeline-rows").all()]
            assert None not in (*lines, *rows)
            from_left = [
                line["x"] - row["x"]
                for line, row in zip(lines, rows, strict=True)
                if line is not None and row is not None
            ]
            assert abs(from_left[0] - from_left[1]) < 2
            assert len({row["height"] for row in rows if row is not None}) == 1
            opened.press(",")
        graphs = [one.bounding_box() for one in page.locator(".compare-pane .graph").all()]
        assert len({graph["height"] for graph in graphs if graph is not None}) == 1


@pytest.mark.parametrize("size", [(1440, 900), (1100, 800), (390, 844)])
def test_a_picture_opens_clear_of_the_buttons_above_it(size: tuple[int, int], report: Open) -> None:
    rooms = "".join(
        f"<Control type='sequential' name='r{n}'>{10 * RUNNER}</Control>" for n in range(30)
    )
    covered = f"""() => {{
      const [camera] = ({_CAMERAS})();
      const {{ left, top }} = camera.box.getBoundingClientRect();
      const {{ zoom, pan }} = camera;
      const tools = [...document.querySelectorAll('.graph-tools > *')]
        .map((one) => one.getBoundingClientRect());
      return [...camera.picture.items, ...camera.picture.groups].filter(({{ box }}) => {{
        const [x, y] = [left + box.x * zoom + pan.x, top + box.y * zoom + pan.y];
        return tools.some((one) => x < one.right && x + box.width * zoom > one.left
          && y < one.bottom && y + box.height * zoom > one.top);
      }}).length;
    }}"""
    for text in (f"<Plan>{rooms}</Plan>", f"<Plan>{6 * RUNNER}</Plan>"):
        with report(document_of(text), size=size) as opened:
            opened.drawn()
            assert opened.page.evaluate(covered) == 0


def test_no_sample_of_the_legend_is_cut_off(report: Open) -> None:
    cut = """() => [...document.querySelectorAll('.legend-sample')].filter((one) => {
      const { width, height } = one;
      const copy = Object.assign(document.createElement('canvas'), { width, height });
      const pen = copy.getContext('2d', { willReadFrequently: true });
      pen.drawImage(one, 0, 0);
      const sides = [[0, 0, width, 1], [0, height - 1, width, 1], [0, 0, 1, height],
        [width - 1, 0, 1, height]];
      return sides.some((side) => pen.getImageData(...side).data.some(Boolean));
    }).map((one) => one.parentElement.dataset.mark)"""
    with report(of(DOOR)) as opened:
        opened.page.locator(".graph-legend summary").click()
        opened.drawn()
        assert opened.page.locator(".legend-sample").count() > 20
        assert opened.page.evaluate(cut) == []


def test_between_phone_and_desk_the_text_is_below_the_automaton(report: Open) -> None:
    with report(of(DOOR), size=(1024, 768)) as opened:
        graph, text = (opened.page.locator(each).bounding_box() for each in (".graph", ".source"))
        assert graph is not None
        assert text is not None
        assert text["y"] >= graph["y"] + graph["height"]
        assert graph["width"] > 700
        assert min(zooms(opened)) >= READABLE  # it opens whole only if it can be read then
        opened.open_play("GP303")
        assert opened.page.locator(".line.current").first.is_visible()
        assert min(zooms(opened)) > NAMES_FROM


@pytest.mark.parametrize("size", [(1440, 900), (1024, 768), (390, 844)])
def test_both_sides_of_a_comparison_have_one_size_that_can_be_read(
    size: tuple[int, int], report: Open
) -> None:
    for files in (
        (DOOR, "docs/examples/two_looks.xml"),
        ("docs/examples/visit.xml", "docs/examples/visit_once.xml"),
    ):
        with report(of(*files, diff=True), size=size) as opened:
            one, other = zooms(opened)
            assert one == pytest.approx(other)
            assert one > NAMES_FROM


def test_a_machine_that_is_too_large_opens_at_its_beginning(report: Open) -> None:
    document = document_of(REACTIVE)
    nodes = document["plans"][0]["automaton"]["nodes"]
    assert len(nodes) > 30
    with report(document, size=(1000, 600)) as opened:
        assert zooms(opened)[0] > NAMES_FROM
        view = opened.page.evaluate(f"() => ({_CAMERAS})()[0].viewNow()")
        x, y, width, height = nodes[0]["box"]
        assert view["left"] < x
        assert x + width < view["right"]
        assert view["top"] < y
        assert y + height < view["bottom"]


def test_what_stops_is_drawn_for_what_is_selected(report: Open) -> None:
    document = document_of(REACTIVE)
    edges = document["plans"][0]["automaton"]["edges"]
    bare = [each for each in edges if not each["route"]]
    assert len(bare) > len(edges) / 2
    assert all(each["stops"] for each in bare)
    with report(document) as opened:
        page = opened.page
        picture = "document.querySelector('.graph-touch').gpsfsmGraph.picture"
        drawn = page.evaluate(f"() => {picture}.edges.filter(({{ route }}) => route.length).length")
        assert drawn <= len(edges) - len(bare)
        node = bare[0]["source"]
        page.evaluate("(node) => gpsfsmPage.store.selectNode(node, 'tree')", node)
        near = page.evaluate(
            f"""() => {{
              const {{ near }} = document.querySelector('.graph-touch').gpsfsmGraph.pointers();
              return [...near].map((at) => {picture}.edges[at])
                .filter(({{ route }}) => !route.length).map(({{ full }}) => full.length);
            }}"""
        )
        assert near
        assert set(near) == {2}
        page.get_by_text("Legend", exact=True).click()
        page.get_by_text("stops what it leads to; drawn for what is selected").wait_for()


def test_a_play_of_a_large_plan_is_followed_where_names_can_be_read(report: Open) -> None:
    go = '<Runner interface="a/Go" provider="a/Go" x="{}" y="{}"/>'
    rooms = "".join(
        f'<Control type="parallel_all" name="room_{room}">'
        f"{''.join(go.format(room, place) for place in range(6))}</Control>"
        for room in range(50)
    )
    with report(document_of(f"<Plan>{rooms}</Plan>")) as opened:
        assert zooms(opened)[0] < NAMES_FROM
        opened.page.locator(".finding-play").first.click()
        opened.page.evaluate(
            "() => document.querySelector('.graph-touch').gpsfsmGraph.camera.zoomBy(0.9)"
        )
        opened.press(".", ".")
        assert zooms(opened)[0] > NAMES_FROM


def test_names_stay_in_their_boxes(report: Open) -> None:
    wide = "%" * 24  # wider in most fonts than is assumed
    text = f'<Plan><Runner interface="a/{wide}" provider="a/{wide}" text="{wide}"/></Plan>'
    document = document_of(text)
    width = max(node["box"][2] for node in document["plans"][0]["automaton"]["nodes"])
    with report(document) as opened:
        with opened.page.expect_download() as download:
            opened.page.get_by_role("button", name="as SVG,").click()
        root: Any = etree.fromstring(
            download.value.path().read_bytes(), etree.XMLParser(resolve_entities=False)
        )
        lengths = [float(each.get("textLength")) for each in root.iter() if each.get("textLength")]
        assert lengths
        assert max(lengths) < width


def test_brackets_hide_no_sign(report: Open) -> None:
    with report(of(DOOR)) as opened:
        opened.open_play("GP303")
        opened.press(".", ".", ".")
        page = opened.page
        opened.settled()
        node = page.evaluate("() => gpsfsmPage.store.state.node")
        state = page.evaluate("(node) => gpsfsmPage.store.state.states.get(node).state", node)
        assert state == "failed"
        red, green, blue, opaque = page.evaluate(_SIGN, node)
        assert opaque == 255
        assert red > green + 100
        assert red > blue + 100


def test_the_end_is_told_in_the_words_of_what_ends(report: Open) -> None:
    ends = {DOOR: "the plan gives up", MACHINE: "the machine is stuck: it waits for ever"}
    for file, words in ends.items():
        with report(of(file)) as opened:
            opened.page.locator(".finding-play").first.click()
            assert words in opened.text(".timeline-outcome")
    with report(document_of(REACTIVE)) as opened:
        opened.page.locator(".finding-play").first.click()
        assert "the tree" in opened.text(".timeline-outcome")


def test_a_few_findings_are_told_in_full(report: Open) -> None:
    with report(of(MACHINE)) as opened:
        messages = opened.texts(".finding-message")
        assert len(messages) == len(set(messages)) == 4
        cut = "(all) => all.filter((one) => one.scrollHeight > one.clientHeight + 1).length"
        assert opened.page.locator(".finding-message").evaluate_all(cut) == 0


def test_where_there_is_no_automaton_there_are_no_buttons_for_it(report: Open) -> None:
    with report(document_of("<Plan>\n<Control")) as opened:
        opened.page.get_by_text("No automaton").wait_for()
        assert not opened.page.locator(".graph-tools button:visible, .graph-legend:visible").count()


def test_the_folder_of_several_plans_is_told_once(report: Open) -> None:
    document = of(DOOR, MACHINE)
    names = ["/home/robot/plans/a/door.xml", "/home/robot/plans/b/door.json"]
    for plan, name in zip(document["plans"], names, strict=True):
        plan["name"] = name
    with report(document, size=(390, 844)) as opened:
        assert opened.texts(".summary .plan-link") == ["a/door.xml", "b/door.json"]
        assert "in /home/robot/plans/" in opened.text(".summary-totals")
        words = opened.page.locator(".summary-filter")
        box = words.bounding_box()
        assert box is not None
        assert box["width"] > 300
        words.fill("robot/plans/b")
        assert opened.texts(".summary .plan-link") == ["b/door.json"]


def test_a_whole_path_and_a_relative_one_have_no_folder_in_common(report: Open) -> None:
    document = of(DOOR, MACHINE)
    names = ["/home/robot/door.xml", "plans/door.json"]
    for plan, name in zip(document["plans"], names, strict=True):
        plan["name"] = name
    with report(document) as opened:
        assert opened.texts(".summary .plan-link") == names
        assert " in " not in opened.text(".summary-totals")


def test_what_is_searched_for_comes_before_what_only_resembles_it(report: Open) -> None:
    say = '<Runner interface="a/Say" provider="a/Say" text="Room {} is done."/>'
    rooms = "".join(
        f'<Control type="sequential" name="room_{room}">{say.format(room) * 3}</Control>'
        for room in range(1, 9)
    )
    with report(document_of(f"<Plan>{rooms}</Plan>")) as opened:
        opened.press("/")
        opened.page.keyboard.type("room 3")
        opened.page.locator(".search-hits li").first.wait_for()
        hits = opened.texts(".search-hits li")
        assert len(hits) > 4
        assert all("room_3" in each or "Room 3" in each for each in hits[:4])


def test_what_is_played_is_not_below_the_buttons(report: Open) -> None:
    with report(of(DOOR), size=(1024, 768)) as opened:
        opened.open_play("GP303")
        lowest = opened.page.locator(".graph-tools").bounding_box()
        graph = opened.page.locator(".graph").bounding_box()
        assert lowest is not None
        assert graph is not None
        for _ in range(7):
            opened.press(".")
            opened.settled()
            top = opened.page.evaluate(
                """() => {
                  const pane = document.querySelector('.graph-touch').gpsfsmGraph;
                  const { zoom, pan } = pane.camera;
                  return (pane.selectedBox()?.y ?? 1e4) * zoom + pan.y;
                }"""
            )
            assert graph["y"] + top >= lowest["y"] + lowest["height"]
