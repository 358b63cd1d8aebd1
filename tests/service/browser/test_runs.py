"""The live page: plans are run, watched, steered, and looked at again."""

from __future__ import annotations

import re
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Literal

import pytest

from tests.conftest import REPO
from tests.service.browser.live import LOST, STATES, STEPPED, plan, speech, waypoint
from tests.service.support import Service

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from playwright.sync_api import Route

    from tests.service.browser.conftest import Open

WORLDS = REPO / "corpus" / "worlds"
WINDOWS: list[tuple[int, int, Literal["dark", "light"]]] = [
    *((1000, 760, "light"), (2560, 1300, "dark"), (800, 900, "dark")),
]
SHORT = plan(waypoint(2, 5), speech("Here I am."))
LONG = plan(waypoint(1, 1), waypoint(4, 3), waypoint(1, 1), waypoint(4, 3), waypoint(1, 1))
RECOVERED = plan(
    waypoint(1, 1), f'<Control type="recovery">{waypoint(4, 3)}</Control>', speech("Done.")
)


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    journal = tmp_path_factory.mktemp("live") / "queue.db"
    words = ("--journal", journal, "--durability", "process", "--workers", "1")
    with Service(*words, "--world", WORLDS / "closing.yaml") as server:
        yield server


def until(true: Callable[[], bool], within_s: float = 20) -> None:
    end_s = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < end_s
        time.sleep(0.05)


def test_a_plan_runs_to_completion(service: Service, live: Open) -> None:
    with live(service.address) as page:
        page.write(SHORT)
        page.page.locator(".map-goal").wait_for()
        assert page.pose() == (1.0, 3.0)
        number = page.run(SHORT, speed="0.5")
        page.active.filter(has_text="WaypointRunner").wait_for()
        page.page.get_by_label("Speed of this run").select_option("0")
        page.ended("has completed")
        assert page.badge.get_attribute("data-status") == "COMPLETED"
        assert page.pose() == (2.0, 5.0)
        page.tab("Said and heard").click()
        page.page.locator(".word-row.say").filter(has_text="Here I am.").wait_for()
        page.go_to(page.at_s() - 0.1)
        page.page.locator(".map-bubble").filter(has_text="Here I am.").wait_for()
        page.button("To the end").click()
        page.tab("Events").click()
        page.page.locator(".event-row.ended").filter(has_text="the plan completes").wait_for()
        page.tab("Runs").click()
        row = page.page.locator(f"[data-run='{number}']")
        row.locator("[data-status=COMPLETED]").wait_for()


_ACTING = """() => {
  const touch = document.querySelector('.run-pane.new .graph-touch');
  const { camera, picture, store } = touch.gpsfsmGraph;
  const { left, top, right, bottom } = camera.viewNow();
  const inView = ({ box: { x, y, width, height } }) =>
    x >= left && y >= top && x + width <= right && y + height <= bottom;
  const isActing = ([, { state }]) => state === 'running' || state === 'reached';
  const acting = [...store.state.states].filter(isActing);
  return acting.map(([node]) => inView(picture.items[picture.itemOf[node]]));
}"""


_FOLLOWED = f"() => ({_ACTING})().every((inView) => inView)"
_TOP = """() =>
  document.querySelector('.run-pane.new .graph-touch').gpsfsmGraph.camera.viewNow().top"""


def test_a_run_is_followed_unless_somebody_looks_elsewhere(service: Service, live: Open) -> None:
    from playwright.sync_api import TimeoutError as PlaywrightTimeoutError

    with live(service.address, size=(390, 700)) as page:
        page.page.get_by_label("paused").check()
        page.run(LONG, speed="20")
        page.held()
        tops, acted = set(), 0
        until_s = time.monotonic() + 300
        while not page.over.count():
            assert time.monotonic() < until_s, "the run does not end"
            before = page.page.evaluate(STATES)
            with suppress(PlaywrightTimeoutError):  # the run has just ended
                page.button("Step: let one event happen, then pause").click(timeout=2_000)
                page.page.wait_for_function(STEPPED, arg=before)
            page.page.wait_for_timeout(200)
            page.page.wait_for_function(_FOLLOWED)
            acted += len(page.page.evaluate(_ACTING))
            tops.add(round(page.page.evaluate(_TOP)))
        assert acted > 5
        assert len(tops) > 1, "the picture had to move"
        page.ended("has completed")
        page.page.wait_for_function(_FOLLOWED)
        page.page.evaluate(
            "() => document.querySelector('.run-pane.new .graph-touch')"
            ".gpsfsmGraph.camera.moveBy(0, 5000)"
        )
        page.go_to(0.1)
        page.page.wait_for_timeout(400)
        assert True not in page.page.evaluate(_ACTING)


def test_a_run_that_does_not_wait_is_shown_to_its_end(service: Service, live: Open) -> None:
    there_and_back = [waypoint(1, 1), waypoint(4, 3)] * 20
    with live(service.address) as page:
        page.run(plan(*there_and_back), speed="0")
        page.ended("has completed")
        page.tab("Events").click()
        page.page.locator(".event-row.ended").wait_for()
        assert page.pose() == (4.0, 3.0)


def silent(route: Route) -> None:
    route.fulfill(content_type="text/event-stream", body=": nothing\n\n")


def test_no_end_is_told_before_the_map_shows_it(service: Service, live: Open) -> None:
    with live(service.address) as page:
        # An answer to a command may overtake the records: here they never come by the stream.
        page.page.route(re.compile(r"/v1/plans/[^/]+/events"), silent)
        page.page.get_by_label("paused").check()
        page.run(SHORT, speed="0")
        page.held()
        step = "() => document.querySelector('[title^=\"Step: let one\"]')?.click()"
        until(lambda: bool(page.page.evaluate(step) or page.over.count()))
        page.ended("has completed")
        assert page.pose() == (2.0, 5.0)


def test_it_is_paused_stepped_and_goes_on(service: Service, live: Open) -> None:
    with live(service.address) as page:
        page.page.get_by_label("paused").check()
        page.run(LONG, speed="0.5")
        page.held()
        assert page.at_s() == 0
        page.step_until(page.active.filter(has_text="line 2"))
        page.button("Resume the run").click()
        until(lambda: page.at_s() > 0)
        page.button("Pause the run").click()
        page.held()
        stood, where = page.at_s(), page.pose()
        page.page.wait_for_timeout(400)
        assert (page.at_s(), page.pose()) == (stood, where)
        page.button("Step: let one event happen, then pause").click()
        until(lambda: page.at_s() > stood)
        page.page.get_by_label("Speed of this run").select_option("0")
        page.button("Resume the run").click()
        page.ended("has completed")
        assert page.pose() == (1.0, 1.0)


_SEEN_AS_PAUSED = """() => new Promise((seen) => {
  const shown = () => [
    document.querySelector(".run-clock").textContent,
    document.querySelector(".map-picture").dataset.pose,
  ].join();
  const look = () => document.querySelector(".run-badge.held")
    && setTimeout(() => seen([shown(), frames()]));
  const frames = () => new Promise((drawn) =>
    requestAnimationFrame(() => requestAnimationFrame(() => drawn(shown()))));
  new MutationObserver(look).observe(document.body, { subtree: true, childList: true });
  document.querySelector("[title='Pause the run']").click();
}).then((all) => Promise.all(all))"""
"""What the page shows at the end of the frame that says "paused", and two frames later."""


def test_it_stands_where_it_is_shown_as_soon_as_it_is_paused(service: Service, live: Open) -> None:
    with live(service.address) as page:
        page.run(LONG, speed="0.5")
        for _ in range(5):
            before = page.at_s()
            until(lambda before=before: page.at_s() > before)
            at_once, later = page.page.evaluate(_SEEN_AS_PAUSED)
            assert at_once == later
            page.button("Resume the run").click()
        page.button("Cancel the run").click()
        page.ended("was cancelled")


_SET_SPEED = """() => {
  const choice = document.querySelector("[title='Speed of this run']");
  choice.value = "0";
  choice.dispatchEvent(new Event("change", { bubbles: true }));
}"""


def test_a_click_is_taken_though_news_come_before_it_ends(service: Service, live: Open) -> None:
    with live(service.address) as page:
        page.page.get_by_label("paused").check()
        page.run(LONG, speed="0.5")
        page.button("Resume the run").hover()
        page.page.mouse.down()
        with page.page.expect_response("**/speed"):
            page.page.evaluate(_SET_SPEED)
        page.page.wait_for_timeout(500)
        page.page.mouse.up()
        page.ended("has completed")


def test_a_running_runner_is_let_fail_by_a_click(service: Service, live: Open) -> None:
    with live(service.address) as page:
        page.run(RECOVERED, speed="0.25")
        page.active.filter(has_text="line 2").wait_for()
        page.click_node(1)
        page.page.get_by_role("menuitem").click()
        page.active.filter(has_text="line 3").wait_for()
        page.tab("Events").click()
        page.page.locator(".event-row.failed").filter(has_text="line 2").wait_for()
        page.tab("Running").click()
        page.page.locator(".active-row").filter(has_text="line 3").wait_for()
        page.page.keyboard.press("x")  # the only one that runs
        page.ended("gave up")
        assert page.page.locator(".active-row").count() == 0


def test_words_of_a_plan_are_shown_as_they_are(service: Service, live: Open) -> None:
    """A sign of direction would turn around what stands beside it."""
    shown = "\u2039U+202E\u203alive <img"
    with live(service.address) as page:
        page.run(plan(speech("\u202elive &lt;img src=x onerror=alert(1)&gt;")), speed="0")
        page.ended("has completed")
        for words in (page.page.locator(".map-bubble"), page.page.locator(".word-row")):
            page.go_to(1)
            words.filter(has_text=shown).wait_for()
            page.tab("Said and heard").click()
        assert page.page.locator("#gpsfsm-live img").count() == 0


def test_it_is_cancelled(service: Service, live: Open) -> None:
    with live(service.address) as page:
        page.run(LONG, speed="0.5")
        page.active.first.wait_for()
        page.button("Cancel the run").click()
        page.ended("was cancelled")
        assert page.badge.get_attribute("data-status") == "CANCELLED"
        assert page.page.locator(".run-commands button").count() == 0


def test_a_past_run_is_scrubbed(service: Service, live: Open) -> None:
    with live(service.address) as page:
        number = page.run(RECOVERED, speed="0")
        page.ended("has completed")
    with live(service.address) as page:
        page.choose_run(number)
        end_s, end = page.at_s(), page.pose()
        page.go_to(0)
        until(lambda: page.pose() == (1.0, 3.0))
        page.go_to(1.5)
        page.active.filter(has_text="line 2").wait_for()
        until(lambda: 1.0 < page.pose()[1] < 3.0)
        halfway = page.pose()
        assert page.active.get_by_role("button").is_disabled()  # it has happened
        page.button("Next event").click()
        until(lambda: page.at_s() > 1.5)
        page.button("Previous event").click()
        until(lambda: page.at_s() < 1.5)
        page.go_to(1.5)
        until(lambda: page.pose() == halfway)  # as it was on the way there
        page.button("To the end").click()
        until(lambda: (page.at_s(), page.pose()) == (end_s, end))
        page.button("Replay the run").click()
        until(lambda: 0 < page.at_s() < end_s)
        page.button("Stop the replay").click()
        assert page.page.url.partition("&at=")[0].endswith(f"#run={number}")  # and where it stands
        page.page.reload()
        page.title.filter(has_text=f"Run {number}").wait_for()


def test_the_keyboard_alone_is_enough(service: Service, live: Open) -> None:
    with live(service.address) as page:
        page.page.get_by_label("Speed of the run").focus()
        page.page.keyboard.press("ArrowUp")
        page.page.get_by_label("World", exact=True).focus()
        page.page.keyboard.press("c")
        page.editor.focus()
        page.page.keyboard.insert_text(LONG)
        page.page.locator(".draft-status.good, .draft-status.bad").wait_for()
        page.page.keyboard.press("Control+Enter")
        page.shown([])
        page.active.first.wait_for()
        page.page.locator(".graph-touch").last.wait_for()
        page.tab("Running").focus()
        page.page.keyboard.press("r")
        page.page.locator(".run-row.chosen:focus").wait_for()
        page.tab("Running").focus()
        page.page.keyboard.press("x")
        page.ended("gave up")
        page.page.keyboard.press("?")
        page.page.get_by_role("dialog").wait_for()
        page.page.keyboard.press("Escape")
        page.page.keyboard.press("t")
        page.page.keyboard.press("e")
        page.page.locator(".editor-text:focus").wait_for()


def test_it_fits_into_windows(service: Service, live: Open) -> None:
    wide = "document.documentElement.scrollWidth <= document.documentElement.clientWidth"
    with live(service.address) as page:
        page.run(SHORT, speed="0")
        page.ended("has completed")
        for across, down, theme in WINDOWS:
            page.page.set_viewport_size({"width": across, "height": down})
            page.page.emulate_media(color_scheme=theme)
            page.page.reload()  # it opens in a window of this size
            page.ended("has completed")
            assert page.page.evaluate(wide)
            for name in ("Edit", "To the start", "Keys (?)"):
                named = page.page.get_by_label(name).or_(page.button(name))
                box = named.filter(visible=True).first.bounding_box()  # the draft has a player, too
                assert box is not None
                assert box["x"] >= 0
                assert box["x"] + box["width"] <= across


def test_the_service_is_killed_while_a_run_goes_on(tmp_path: Path, live: Open) -> None:
    kept = ("--journal", tmp_path / "q.db", "--durability", "process")
    words = (*kept, "--workers", "1", "--world", WORLDS / "closing.yaml")
    with Service(*words) as service:
        _, port = service.place
        with live(service.address, allowed=(LOST,)) as page:
            page.run(LONG, speed="1")
            page.active.first.wait_for()
            service.kill()
            page.page.locator(".live-banner").filter(has_text="cannot be reached").wait_for()
            title = page.title.inner_text()
            with Service(*words, "--port", port):
                page.page.locator(".connection.good").wait_for(timeout=60_000)
                page.toasts.filter(has_text="is back").wait_for()
                page.page.get_by_label("Speed of this run").select_option("0")
                page.ended("has completed")
                assert page.title.inner_text() == title
                assert page.pose() == (1.0, 1.0)


def test_a_token_is_asked_for(tmp_path: Path, live: Open) -> None:
    file = tmp_path / "token"
    file.write_text("open-sesame-open-sesame\n", encoding="utf-8")
    with (
        Service("--workers", "1", "--token-file", file) as service,
        live(service.address, allowed=("status of 401",)) as page,
    ):
        field = page.page.get_by_label("Token of the service")
        field.fill("wrong")
        page.button("Sign in").click()
        page.page.locator(".token-refused").filter(has_text="did not accept").wait_for()
        field.fill("open-sesame-open-sesame")
        page.button("Sign in").click()
        page.write(SHORT)
        assert page.status.inner_text().startswith("✓")
        page.page.reload()
        page.page.locator(".draft-status.good").wait_for()
