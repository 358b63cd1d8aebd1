"""The picture as SVG: what is in it, and that hostile plans write nothing into it but text."""

from __future__ import annotations

import re
from pathlib import Path
from xml.sax.saxutils import quoteattr

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from gpsfsm.picture import automaton_to_svg
from gpsfsm.picture.shapes import shorten, text_width
from tests.cases import many
from tests.model.plans import single, tour
from tests.model.test_drawing import ANY_TEXT, HOSTILE
from tests.picture.support import automaton_of, control, engine_automaton, runner

SVG = "{http://www.w3.org/2000/svg}"
TAGS = {"svg", "title", "style", "defs", "marker", "path", "rect", "circle", "g", "text"}
ATTRIBUTES = {
    "class", "cx", "cy", "d", "height", "id", "markerHeight", "markerWidth", "orient",
    "marker-end", "r", "refX", "refY", "role", "rx", "viewBox", "width", "x", "y",
}  # fmt: skip


def elements(svg: str, tag: str, word: str = "") -> list[etree._Element]:
    result = etree.fromstring(svg.encode()).iter(SVG + tag)
    return [each for each in result if not word or word in each.get("class", "").split()]


def texts(svg: str, word: str) -> list[str]:
    return [each.text or "" for each in elements(svg, "text", word)]


def test_nodes_and_controls_are_labelled() -> None:
    svg = automaton_to_svg(tour())
    assert texts(svg, "caption")[0] == "parallel_all “welcome” (line 3)"
    assert {"WaypointRunner", "all 2", "any", "start", "complete", "give up"} <= {
        *texts(svg, "name")
    }
    assert "x=1.5, y=2, …" in texts(svg, "detail")


def test_events_differ_in_colour_dashes_and_words() -> None:
    svg = automaton_to_svg(automaton_of(f"<Plan>{runner()}{runner()}</Plan>"))
    assert texts(svg, "event") == ["SUCCEEDED", "FAILED"] * 2
    assert len(elements(svg, "path", "is-bad")) == 2
    style = elements(svg, "style")[0].text or ""
    assert ".is-bad{stroke-dasharray" in style
    assert "prefers-color-scheme:dark" in style
    assert len(set(re.findall(r"--(?:ok|bad|begun|halted):(#\w+)", style))) == 8


def test_what_joins_of_failures_lead_to_is_drawn_as_a_failure() -> None:
    svg = automaton_to_svg(automaton_of(f"<Plan>{runner()}{runner()}</Plan>"))
    assert len(elements(svg, "circle", "join")) == 1
    assert len(elements(svg, "circle", "bad")) == 2  # the join, and the dot where edges meet
    solid = [each for each in elements(svg, "path", "bad") if "is-ok" in each.get("class", "")]
    assert len(solid) == 1


def test_dangling_events_end_in_the_open() -> None:
    dead = control("recovery", runner(), runner())
    svg = automaton_to_svg(automaton_of(f"<Plan>{dead}</Plan>"))
    assert len(elements(svg, "circle", "open")) == 3


def test_what_an_engine_does_otherwise_is_told() -> None:
    text = f"<Plan>{control('parallel_all', runner(x=1), runner(x=2))}{runner(x=3)}</Plan>"
    svg = automaton_to_svg(engine_automaton(text, "fabric-v2"))
    assert {"STARTED: never", "FAILED: nothing"} <= set(texts(svg, "event"))
    assert "give up" not in texts(svg, "name")
    tour_guide = Path(__file__).parents[2] / "corpus" / "plans" / "tour_guide.xml"
    svg = automaton_to_svg(engine_automaton(tour_guide.read_text("utf-8"), "fabric-v2"))
    assert texts(svg, "loop") == ["ABORT"] * 3


def test_people_who_hear_it_are_told_what_it_is() -> None:
    root = etree.fromstring(automaton_to_svg(tour()).encode())
    assert root.get("role") == "img"
    assert (root.findtext(f"{SVG}title") or "").startswith("6 runners in a plan")
    titles = [each.text or "" for each in root.iter(f"{SVG}title")]
    assert any(text.endswith("/Plan/Runner[1]") for text in titles)


def test_the_same_bytes_for_the_same_plan() -> None:
    assert automaton_to_svg(tour()) == automaton_to_svg(tour())


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_texts(text: str) -> None:
    harmless(text)


@given(ANY_TEXT)
@settings(max_examples=many(40))
def test_any_text(text: str) -> None:
    harmless(text)


def harmless(text: str) -> None:
    svg = automaton_to_svg(single(text, x=text, text=text))
    svg.encode("utf-8")
    root = etree.fromstring(svg.encode())
    assert {str(each.tag).removeprefix(SVG) for each in root.iter()} <= TAGS
    for each in root.iter():
        assert set(each.attrib) <= ATTRIBUTES


def test_a_hostile_file() -> None:
    name = quoteattr("</text><script>alert(1)</script>")
    svg = automaton_to_svg(
        automaton_of(
            f'<Plan><Control type="sequential" name={name}><Runner interface={name} '
            f"provider={name} x={name}/></Control></Plan>"
        )
    )
    assert "<script" not in svg
    assert not elements(svg, "script")


@given(st.text(max_size=60))
def test_shortened_texts_are_no_wider(text: str) -> None:
    assert text_width(shorten(text, 100)) <= max(100, text_width("…"))
    assert shorten(text, 10_000) == text


def test_a_shortened_text_ends_in_one_sign() -> None:
    assert shorten("task=Say where…, uuid", text_width("task=Say where…, u")) == "task=Say where…"


def test_a_caption_stands_beside_the_line_into_its_control() -> None:
    rooms = control("sequential", runner(), control("recovery", runner()), runner())
    svg = automaton_to_svg(automaton_of(f'<Plan name="a">{runner()}{rooms}</Plan>'))
    lines = [
        (float(x), float(above), float(below))
        for path in elements(svg, "path", "edge")
        for x, above, below in re.findall(
            r"(?:M|L|Q[\d. ]+ )([\d.]+) ([\d.]+)L\1 ([\d.]+)", path.get("d", "")
        )
    ]
    captions = elements(svg, "text", "caption")
    assert [each.text for each in captions] == ["sequential (line 1)", "recovery (line 1)"]
    for each in captions:
        x, y = float(each.get("x", "")), float(each.get("y", ""))
        right = x + text_width(each.text or "") * 11 / 12
        assert not [line for line in lines if x < line[0] < right and line[1] < y < line[2]]
    boxes = [float(each.get("x", "")) for each in elements(svg, "rect", "group")]
    after = [float(each.get("x", "")) - box for each, box in zip(captions, boxes, strict=True)]
    assert after[0] > 10, "beside the line"
    assert after[1] == 10, "it is entered from its side"


def test_marked_nodes_get_a_ring_and_a_flag_with_room_for_it() -> None:
    automaton = automaton_of(f"<Plan>{runner()}{runner()}</Plan>")
    node = automaton.runners[0].index
    remark = "GP402 <lost> value" * 3
    plain, marked = automaton_to_svg(automaton), automaton_to_svg(automaton, {node: remark})
    assert texts(marked, "remark") == [remark]
    assert "remark" not in plain
    (ring,), (flag,) = elements(marked, "rect", "ring"), elements(marked, "rect", "flag")
    left, _, width, _ = map(float, etree.fromstring(marked.encode()).get("viewBox", "").split())
    assert left < 0  # the remark is wider than what is left of the node
    assert left <= float(flag.get("x", ""))
    assert float(flag.get("x", "")) + float(flag.get("width", "")) <= float(ring.get("x", ""))
    (background,) = elements(marked, "rect", "background")
    assert (float(background.get("x", "")), float(background.get("width", ""))) == (left, width)
