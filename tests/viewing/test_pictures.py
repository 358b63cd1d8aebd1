"""The page draws where Python has put everything, and closes gaps where something is folded."""

from __future__ import annotations

import json
import random
import shutil
import subprocess
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.checking import CheckOptions
from gpsfsm.picture.cells import failing_joins
from gpsfsm.picture.layout import layout
from gpsfsm.picture.routing import Router
from gpsfsm.viewing.picture import automaton_data
from gpsfsm.viewing.plans import see
from tests.cases import many
from tests.conftest import REPO
from tests.viewing.support import in_node

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.model.automaton import Automaton

WEB = REPO / "gpsfsm" / "viewing" / "web"
FILES = [
    *sorted((REPO / "corpus" / "plans").glob("*.xml")),
    *sorted((REPO / "corpus" / "missions").glob("*.xml")),
    *sorted((REPO / "corpus" / "trees").glob("*.xml")),
]
ENGINE_FILES = sorted((REPO / "corpus" / "engines").glob("*.xml"))
_RUNNER = '<Runner interface="a/A" provider="a/A"/>'
_CONTROLS = ("sequential", "recovery", "parallel_any", "parallel_all")
NEAR = 0.2
"""Python rounds boxes to tenths."""

Picture = dict[str, Any]

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="there is no node")


def random_plan(seed: int) -> str:
    """A plan of some fifty elements; some are wide, some are deep."""
    generator = random.Random(seed)  # noqa: S311  (no secret)

    def inside(depth: int) -> Iterator[str]:
        for _ in range(generator.choice((1, 2, 3, 8))):
            if depth and generator.random() < 0.55:
                kind = generator.choice(_CONTROLS)
                yield f'<Control type="{kind}">{"".join(inside(depth - 1))}</Control>'
            else:
                yield _RUNNER

    return f"<Plan>{''.join(inside(4))}</Plan>"


def automata() -> Iterator[Automaton]:
    texts = [(file.read_text(encoding="utf-8"), "paper") for file in FILES]
    texts += [(file.read_text(encoding="utf-8"), "fabric-v2") for file in ENGINE_FILES]
    texts += [(random_plan(seed), "paper") for seed in range(many(30))]
    texts += [(f"<Plan>{_RUNNER * 120}</Plan>", "paper")]
    texts += [(f'<Plan><Control type="parallel_all">{_RUNNER * 40}</Control></Plan>', "paper")]
    texts += [(f"<Plan>{_RUNNER * 2_600}</Plan>", "paper")]  # its rows are divided
    for text, engine in texts:
        seen = see(text, "plan.xml", CheckOptions(engine=engine))
        if seen.compiled is not None:
            yield seen.compiled.automaton


@pytest.fixture(scope="module")
def pictures() -> list[tuple[Automaton, list[Picture]]]:
    """Per automaton: all unfolded, all folded, two random folds, and the layered picture."""
    generator = random.Random(7)  # noqa: S311  (no secret)
    drawn = list(automata())
    cases = []
    for automaton in drawn:
        data = json.loads(json.dumps(automaton_data(automaton)))
        groups = range(len(data["groups"]))
        folds = [[group for group in groups if generator.random() < share] for share in (0.2, 0.6)]
        cases.append({"automaton": data, "folds": folds})
    return list(zip(drawn, in_node("pictures.mjs", cases), strict=True))


def test_what_is_unfolded_stands_where_python_puts_it(
    pictures: list[tuple[Automaton, list[Picture]]],
) -> None:
    for automaton, (unfolded, *_) in pictures:
        places = layout(automaton, parts=True)
        drawn = {item["node"]: item["box"] for item in unfolded["items"]}
        assert set(drawn) == {node for node, box in enumerate(places.nodes) if box.width}
        for node, box in drawn.items():
            assert_same_box(box, places.nodes[node])
        assert len(unfolded["groups"]) == len(places.groups)
        for group in unfolded["groups"]:
            assert_same_box(group["box"], places.groups[group["group"]].box)


def assert_same_box(drawn: dict[str, float], box: Any) -> None:
    for name in ("x", "y", "width", "height"):
        assert drawn[name] == pytest.approx(getattr(box, name), abs=NEAR), name


def test_edges_take_the_routes_that_python_finds(
    pictures: list[tuple[Automaton, list[Picture]]],
) -> None:
    for automaton, (unfolded, *_) in pictures:
        router = Router(layout(automaton, parts=True), failing_joins(automaton))
        for number, (source, event, target) in enumerate(automaton.edges):
            drawn = unfolded["edgeOf"][number] if number < len(unfolded["edgeOf"]) else None
            if drawn is None:
                continue  # to what is not drawn
            route = unfolded["edges"][drawn]["full"]
            expected = router.route(source, event, target)
            assert len(route) == len(expected), (source, event, target)
            for point, wanted in zip(route, expected, strict=True):
                assert point == pytest.approx(wanted, abs=NEAR)


def test_colours_tell_what_an_edge_carries_and_lines_which_event_it_is(
    pictures: list[tuple[Automaton, list[Picture]]],
) -> None:
    """As docs/semantics.md has it: unbroken and red behind a join that collects failures."""
    lines = {"SUCCEEDED": "solid", "FAILED": "dashed", "STARTED": "dotted", "STOPPED": "dotted"}
    met = set()
    for automaton, (unfolded, *_) in pictures:
        failing = failing_joins(automaton)
        for number, (source, event, _) in enumerate(automaton.edges):
            drawn = unfolded["edgeOf"][number] if number < len(unfolded["edgeOf"]) else None
            if drawn is not None:
                edge = unfolded["edges"][drawn]
                assert edge["kind"] == ("FAILED" if source in failing else event.value)
                assert edge["line"] == lines[event.value]
                met.add((edge["kind"], edge["line"]))
    assert met >= {("SUCCEEDED", "solid"), ("FAILED", "dashed"), ("FAILED", "solid")}


def test_folded_pictures_are_in_order(pictures: list[tuple[Automaton, list[Picture]]]) -> None:
    for automaton, (*folded, _) in pictures:
        for picture in folded:
            boxes = [item["box"] for item in picture["items"]]
            assert_apart(boxes)
            groups = {group["group"]: group["box"] for group in picture["groups"]}
            for group in picture["groups"]:
                if group["parent"] >= 0:
                    assert is_inside(group["box"], groups[group["parent"]])
            for item in picture["items"]:
                if item["parent"] >= 0:
                    assert is_inside(item["box"], groups[item["parent"]])
            shown = {item["node"] for item in picture["items"]}
            hidden = {node for item in picture["items"] for node in item["inside"]}
            assert not shown & hidden
            drawable = {node for node, box in enumerate(layout(automaton).nodes) if box.width}
            assert (shown - {-1}) | hidden == drawable


def test_every_edge_begins_and_ends_at_what_it_connects(
    pictures: list[tuple[Automaton, list[Picture]]],
) -> None:
    for _, folded in pictures:
        for picture in folded:
            for edge in picture["edges"]:
                assert touches(edge["full"][0], picture["items"][edge["source"]]["box"])
                if edge["target"] >= 0:
                    assert touches(edge["full"][-1], picture["items"][edge["target"]]["box"], 2.5)


def test_closed_gaps_change_no_order_and_no_corner(
    pictures: list[tuple[Automaton, list[Picture]]],
) -> None:
    """What stands above or beside something else does so when groups are folded, too."""
    for _, (unfolded, *folded, _) in pictures:
        before = {item["node"]: item["box"] for item in unfolded["items"]}
        for picture in folded:
            assert picture["width"] <= unfolded["width"] + NEAR
            assert picture["height"] <= unfolded["height"] + NEAR
            for item in picture["items"]:
                if item["node"] >= 0:  # nodes keep their size
                    assert item["box"]["width"] == pytest.approx(before[item["node"]]["width"])
                    assert item["box"]["height"] == pytest.approx(before[item["node"]]["height"])
            for axis in ("x", "y"):
                nodes = [item for item in picture["items"] if item["node"] >= 0]
                nodes.sort(key=lambda item: before[item["node"]][axis])
                for one, other in pairwise(nodes):
                    assert one["box"][axis] <= other["box"][axis] + NEAR
            for edge in picture["edges"]:
                for one, other in pairwise(edge["full"]):
                    assert one[0] == pytest.approx(other[0]) or one[1] == pytest.approx(other[1])


def test_folding_everything_leaves_little(
    pictures: list[tuple[Automaton, list[Picture]]],
) -> None:
    """A row of boxes that are folded takes the room of boxes, whatever is in them."""
    for _, (unfolded, folded, *_) in pictures:
        outer = [item for item in folded["items"] if item["kind"] == "folded"]
        if outer:
            assert all(46 - NEAR <= item["box"]["height"] <= 46 + NEAR for item in outer)
            if len(outer) == 1 and height_of(outer[0], unfolded) > 200:
                saved = height_of(outer[0], unfolded) / 2
                assert folded["height"] <= unfolded["height"] - saved


def height_of(item: Any, unfolded: Picture) -> float:
    (box,) = [each["box"] for each in unfolded["groups"] if each["group"] == item["group"]]
    height: float = box["height"]
    return height


def test_the_layered_picture_shows_every_node(
    pictures: list[tuple[Automaton, list[Picture]]],
) -> None:
    for automaton, (unfolded, *_, layered) in pictures:
        if len(automaton.nodes) <= 400:
            assert layered["groups"] == []
            assert_apart([item["box"] for item in layered["items"]])
            assert layered["edgeOf"] == unfolded["edgeOf"]


def assert_apart(boxes: list[dict[str, float]]) -> None:
    ordered = sorted(boxes, key=lambda box: box["x"])
    for number, one in enumerate(ordered):
        for other in ordered[number + 1 :]:
            if other["x"] >= one["x"] + one["width"] - NEAR:
                break
            apart = (
                one["y"] + one["height"] <= other["y"] + NEAR
                or other["y"] + other["height"] <= one["y"] + NEAR
            )
            assert apart, (one, other)


def is_inside(box: dict[str, float], outer: dict[str, float]) -> bool:
    return (
        box["x"] >= outer["x"] - NEAR
        and box["y"] >= outer["y"] - NEAR
        and box["x"] + box["width"] <= outer["x"] + outer["width"] + NEAR
        and box["y"] + box["height"] <= outer["y"] + outer["height"] + NEAR
    )


def touches(point: list[float], box: dict[str, float], slack: float = 1.0) -> bool:
    """Whether a point lies on the border; joins are round, so it may lie within their box."""
    x, y = point
    return (
        box["x"] - slack <= x <= box["x"] + box["width"] + slack
        and box["y"] - slack <= y <= box["y"] + box["height"] + slack
    )


REACTIVE = """<root BTCPP_format="4"><BehaviorTree ID="Go"><RecoveryNode number_of_retries="4">
<ReactiveSequence><IsGoal/><IsSafe/><IsCharged/><FollowPath/></ReactiveSequence><Spin/>
</RecoveryNode></BehaviorTree></root>"""


def test_connections_that_stop_are_laid_out_unless_they_would_hide_all_others() -> None:
    door = (REPO / "docs" / "examples" / "door.json").read_text(encoding="utf-8")
    for text, drawn in ((door, True), (REACTIVE, False)):
        seen = see(text, "plan", CheckOptions())
        assert seen.compiled is not None
        automaton = seen.compiled.automaton
        assert (len(automaton.stops) <= len(automaton.edges)) is drawn
        data = automaton_data(automaton)
        stops = [edge for edge in data["edges"] if edge.get("stops")]
        assert len(stops) == len(automaton.stops) > 0
        assert all(bool(edge["route"]) is drawn for edge in stops)
        assert all(edge["route"] for edge in data["edges"] if not edge.get("stops"))
        (picture, *_), *_ = in_node("pictures.mjs", [{"automaton": data, "folds": []}])
        bare = [edge for edge in picture["edges"] if not edge["route"]]
        assert bool(bare) is not drawn
        for edge in bare:  # from border to border
            for item, (x, y) in zip((edge["source"], edge["target"]), edge["full"], strict=True):
                box = picture["items"][item]["box"]
                assert box["x"] - NEAR <= x <= box["x"] + box["width"] + NEAR
                assert box["y"] - NEAR <= y <= box["y"] + box["height"] + NEAR


def test_a_caption_stands_beside_the_line_on_which_its_control_is_entered() -> None:
    cases = [
        ("parallel_all “look” (line 5)", 500, 100),
        ("sequential “visit” (line 2)", 160, 80),
        ("sequential “visit” (line 2)", 60, 40),
        ("recovery (line 3)", 160, 80),
        ("sequential “visit” (line 2)", 500, 400),
    ]
    script = """const { captionOf } = await import(process.argv[1]);
const groups = JSON.parse(process.argv[2]);
console.log(JSON.stringify(groups.map(([label, width, spine]) =>
  captionOf({ label, spine, box: { x: 0, y: 0, width, height: 90 } }))));"""
    done = subprocess.run(
        [
            "node",
            "--input-type=module",
            "-e",
            script,
            (WEB / "paint.js").as_uri(),
            json.dumps(cases),
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(done.stdout) == [
        ["parallel_all “look” (line 5)", 108],
        ["→ “visit”", 88],
        ["sequential “visit” (line 2)", 23],  # no room at all: its halo keeps it readable
        ["recovery (line 3)", 23],
        ["sequential “visit” (line 2)", 23],
    ]
