"""Timelines: what they hold, and the picture of one."""

from __future__ import annotations

import re
from itertools import pairwise

import pytest
from lxml import etree

from gpsfsm.execution.records import Input, Kind, Record, Status
from gpsfsm.watch.moments import Moment
from gpsfsm.watch.svg import MAX_LANES, Bar, Timeline, timeline, to_svg
from tests.watch.support import Watched, runner, watch

SVG = "{http://www.w3.org/2000/svg}"
PLAN = f"""<Plan>
{runner(takes="2")}
<Control type="parallel_all" name="both">
{runner("One", takes="1", message="a &lt;b&gt; &amp; c")}
{runner("Two", takes="30")}
</Control>
<Control type="recovery">{runner("Three", takes="4")}</Control>
</Plan>"""


def drawn(run: Watched, title: str = "a run") -> etree._Element:
    parser = etree.XMLParser(resolve_entities=False)
    return etree.fromstring(to_svg(timeline(run.moments, run.words), title).encode(), parser)


def number(element: etree._Element, name: str) -> float:
    return float(str(element.get(name)))


def bars(svg: etree._Element) -> list[tuple[str, float, float]]:
    """Class, begin and end of the bars in the lanes."""
    return [
        (str(each.get("class")), number(each, "x"), number(each, "x") + number(each, "width"))
        for each in svg.iter(f"{SVG}rect")
        if each.find(f"{SVG}title") is not None and each.get("class") != "pause"
    ]


def test_bars_and_joins() -> None:
    rows = timeline((run := watch(PLAN)).moments, run.words)
    assert [lane.label for lane in rows.lanes] == [
        "line 2  Go (takes=2)",
        "line 3  parallel_all 'both'",
        "line 4  One (takes=1, message=a <b> & c)",
        "line 5  Two (takes=30)",
        "line 7  Three (takes=4)",
    ]
    bars = [(lane.bar.outcome if lane.bar else None, lane.cause) for lane in rows.lanes]
    assert bars == [
        (Kind.SUCCEEDED, None),
        (None, None),
        (Kind.FAILED, 0),
        (Kind.STOPPED, 0),
        (Kind.SUCCEEDED, 2),
    ]
    assert [mark.summary for mark in rows.lanes[1].marks] == ["one has failed"]
    assert rows.status is Status.COMPLETED
    last = rows.lanes[-1].bar
    assert last is not None
    assert last.ended_us == rows.end_us
    assert 3_999_990 <= last.ended_us - (last.started_us or 0) <= 4_000_010


def test_the_picture_is_to_scale() -> None:
    run = watch(PLAN)
    svg = drawn(run)
    spans = bars(svg)
    assert [name for name, _, _ in spans] == ["ok", "bad", "stop", "ok"]
    (_, go, go_end), (_, one, one_end), (_, two, two_end), (_, three, three_end) = spans
    per_second = (go_end - go) / 2
    assert one == pytest.approx(go_end, abs=0.2)
    assert one_end - one == pytest.approx(per_second, abs=0.2)
    assert two == pytest.approx(one, abs=0.2)
    assert three_end - three == pytest.approx(4 * per_second, abs=0.2)
    assert two_end == pytest.approx(three_end, abs=0.2)  # it is stopped when the plan completes


def test_nothing_is_outside_of_the_picture_and_no_labels_overlap() -> None:
    svg = drawn(watch(PLAN), "title")
    width, height = number(svg, "width"), number(svg, "height")
    rows: dict[float, list[tuple[float, float]]] = {}
    for text in svg.iter(f"{SVG}text"):
        x, y, long = number(text, "x"), number(text, "y"), 6.7 * len(str(text.text))
        name = str(text.get("class"))
        begin = x - long / 2 if "middle" in name else x - long if "end-here" in name else x
        assert 0 <= begin < begin + long <= width + 1, text.text
        assert 0 < y < height
        rows.setdefault(y, []).append((begin, begin + long))
    for spans in rows.values():
        for (_, end), (begin, _) in pairwise(sorted(spans)):
            assert begin >= end - 1
    for rect in svg.iter(f"{SVG}rect"):
        assert number(rect, "width") > 0


def test_it_needs_nothing_but_itself_and_follows_light_and_dark() -> None:
    text = to_svg(timeline((run := watch(PLAN)).moments, run.words), "x")
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", text)
    assert "<script" not in text
    assert "prefers-color-scheme:dark" in text
    svg = etree.fromstring(text.encode())
    used = {name for each in svg.iter() for name in str(each.get("class") or "").split() if name}
    styled = set(re.findall(r"^\.([a-z-]+)\{", text, re.MULTILINE))
    assert used - {"label"} <= styled


def test_every_outcome_has_a_form_of_its_own() -> None:
    svg = drawn(watch(PLAN))
    forms = [str(each.get("d")) for each in svg.iter(f"{SVG}path") if each.get("class") == "sign"]
    legend = [re.sub(r"^M[\d.]+,[\d.]+", "", form) for form in forms[-4:]]
    assert len(set(legend)) == 4


def test_texts_of_plans_stay_texts() -> None:
    hostile = "&lt;/text&gt;&lt;script&gt;alert(1)&lt;/script&gt;&#x202e;"
    svg = drawn(watch(f"<Plan>{runner(message=hostile, text=hostile)}</Plan>"), "<b>\x1b[31m")
    assert not list(svg.iter(f"{SVG}script"))
    everything = "".join(svg.itertext())
    assert everything.isascii() or "\u202e" not in everything
    assert "\x1b" not in everything
    assert "</text><script>" in everything


def test_the_same_run_is_the_same_picture() -> None:
    first, second = (
        to_svg(timeline((run := watch(PLAN)).moments, run.words), "x") for _ in range(2)
    )
    assert first == second


def test_a_pause_is_a_band_and_what_is_active_stays_open() -> None:
    run = Watched(f"<Plan>{runner(takes='2')}{runner('Next', takes='50')}</Plan>")
    run.driver.at(1_000_000, lambda: run.driver.deliver(Input(Kind.PAUSE)))
    run.driver.at(5_000_000, lambda: run.driver.deliver(Input(Kind.RESUME)))
    run.driver.deliver(Input(Kind.BEGIN))
    while run.driver.now_us() < 5_000_000:
        run.driver.advance()
    run.driver.advance()  # Next is loaded
    rows = timeline(run.moments, run.words)
    assert rows.pauses == ((1_000_000, 5_000_000),)
    assert rows.status is Status.RUNNING
    held = rows.lanes[1].bar
    assert held is not None
    assert (held.triggered_us, held.outcome) == (2_000_000, None)
    svg = drawn(run)
    assert len([1 for each in svg.iter(f"{SVG}rect") if each.get("class") == "pause"]) == 1
    assert [name for name, _, _ in bars(svg)] == ["ok", "open"]
    run.driver.abandon()


def test_very_many_lanes_are_not_drawn() -> None:
    run = Watched(f"<Plan>{runner() * (MAX_LANES + 7)}</Plan>")
    nodes = [node.index for node in run.kernel.automaton.runners]
    rows = timeline(
        [Moment(node, Record(Kind.TRIGGERED, node)) for node in reversed(nodes)], run.words
    )
    assert (len(rows.lanes), rows.hidden) == (MAX_LANES, 7)
    assert rows.lanes[0].bar == Bar(1)
    assert "7 more lanes are not drawn" in to_svg(rows, "x")


@pytest.mark.parametrize(
    "end_us", [0, 1, 999, 12_345, 5_000_000, 100_000_000, 36_000_000_000, 10**13, 10**17]
)
def test_there_are_some_ticks_but_not_many(end_us: int) -> None:
    shown = to_svg(Timeline((), (), end_us, Status.COMPLETED), "x")
    ticks = re.findall(r'class="soft middle"[^>]*>([^<]+)<', shown)
    assert 1 <= len(ticks) <= 10
    assert ticks[0].startswith("0 ")
    assert len(set(ticks)) == len(ticks)
