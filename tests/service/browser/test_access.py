"""The live page can be used by everybody: axe-core on each state of it, and on a phone."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest

from tests.browser_audit import audited, needs_axe
from tests.browser_support import NEXT_FRAME
from tests.conftest import REPO
from tests.service.browser.live import LOST, plan, speech, waypoint
from tests.service.real import TOKEN, RealService, move
from tests.service.real import plan as real_plan
from tests.service.support import Service

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tests.service.browser.conftest import Open
    from tests.service.browser.live import Live

WORLDS = REPO / "corpus" / "worlds"
EXAMPLES = REPO / "docs" / "examples"
BROKEN = plan(waypoint(2, 5), "<Runner")
GREETS = plan(
    waypoint(1, 1),
    f'<Control type="recovery">{speech("I cannot get there. Please open the door.")}</Control>',
    f'<Control type="parallel_all" name="arrive">{speech("Here I am.")}{waypoint(4, 3)}</Control>',
)
FAILS = plan(waypoint(1, 1), waypoint(99, 99))
LONG = plan(*(waypoint(1 + n % 3, 1 + n % 2) for n in range(150)))
REFUSED = r"status of 401|401 \(Unauthorized\)$"
PHONE = (390, 844)


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    journal = tmp_path_factory.mktemp("live") / "queue.db"
    words = ("--journal", journal, "--durability", "process", "--workers", "1")
    with Service(*words, "--world", WORLDS / "closing.yaml") as begun:
        yield begun


def is_open_to_all(page: Live, **more: bool) -> None:
    assert audited(page.page, **more) == []


def test_plans_that_are_written(service: Service, live: Open) -> None:
    with live(service.address, size=(1280, 800)) as page:
        page.editor.wait_for()
        is_open_to_all(page)
        page.write(BROKEN)
        page.page.locator(".finding.error").first.wait_for()
        is_open_to_all(page)
        page.write(GREETS)
        page.page.locator(".finding-head").first.click()
        is_open_to_all(page)
        page.page.locator(".finding-play").first.click()
        page.page.get_by_label("To the end").click()
        is_open_to_all(page)
        for name in ("Tree", "Text", "Runs"):
            page.tab(name).click()
            is_open_to_all(page)


@pytest.mark.parametrize("file", ["nav2/depot.xml", "door.json"])
def test_trees_and_machines(file: str, service: Service, live: Open) -> None:
    with live(service.address, size=(1280, 800)) as page:
        page.write((EXAMPLES / file).read_text(encoding="utf-8"))
        page.page.locator(".draft-stage .graph").wait_for()
        is_open_to_all(page)


@needs_axe
def test_a_run_from_its_start_to_its_end(service: Service, live: Open) -> None:
    with live(service.address, size=(1280, 800)) as page:
        page.run(GREETS, speed="0.25")
        page.active.first.wait_for()
        is_open_to_all(page)
        page.button("Pause the run").click()
        page.held()
        is_open_to_all(page)
        page.click_node(1)
        page.page.get_by_role("menuitem", name="Make it fail").wait_for()
        assert audited(page.page, sizes=((1280, 800),)) == []  # it goes if the window changes
        page.page.keyboard.press("Escape")
        page.page.get_by_role("menuitem").wait_for(state="detached")
        page.click_node(1)
        page.page.get_by_role("menuitem", name="Make it fail").click()
        page.button("Resume the run").click()
        page.page.get_by_label("Speed of this run").select_option("0")
        page.ended("has completed")
        said = page.page.get_by_role("status").filter(has_text=re.compile(r"^Run \d+: completed$"))
        assert said.count() == 1
        for name in ("Said and heard", "Events"):
            page.tab(name).click()
            is_open_to_all(page)


def test_a_run_that_gives_up_and_the_list_of_runs(service: Service, live: Open) -> None:
    with live(service.address, size=(1280, 800)) as page:
        page.run(FAILS, speed="0")
        page.ended("gave up")
        page.tab("Runs").click()
        page.page.locator(".run-row.chosen").wait_for()
        is_open_to_all(page)


@needs_axe
def test_a_very_long_plan(service: Service, live: Open) -> None:
    with live(service.address, size=(1280, 800)) as page:
        page.run(LONG, speed="1")  # it goes on as long as the audit takes
        page.active.first.wait_for()
        is_open_to_all(page)
        page.button("Cancel the run").click()
        page.ended("was cancelled")


def test_keys(service: Service, live: Open) -> None:
    with live(service.address, size=(1280, 800)) as page:
        page.editor.wait_for()
        page.page.locator(".live-brand").click()
        page.page.keyboard.press("?")
        page.page.get_by_role("dialog").wait_for()
        is_open_to_all(page)


def test_on_a_phone_a_run_comes_into_view(service: Service, live: Open) -> None:
    with live(service.address, size=PHONE) as page:
        page.run(GREETS, speed="0")
        page.ended("has completed")
        box = page.title.bounding_box()
        assert box is not None
        assert 40 <= box["y"] < PHONE[1]  # below the head, which stays


_OUTSIDE = """() => {
  const ground = document.querySelector('.map-ground').getBoundingClientRect();
  return [...document.querySelectorAll('.map-label')].filter((label) => {
    const box = label.getBoundingClientRect();
    return box.left < ground.left - 1 || box.right > ground.right + 1;
  }).map((label) => label.textContent);
}"""


def test_the_timeline_of_a_run_takes_the_colours_of_the_theme(service: Service, live: Open) -> None:
    with live(service.address, size=(1280, 800)) as page:
        page.run(GREETS, speed="0")
        page.ended("has completed")
        end = page.page.locator(".timeline-end.state-succeeded").first
        color = "(end) => getComputedStyle(end).color"
        assert end.evaluate(color) == "rgb(26, 127, 55)"
        page.page.emulate_media(color_scheme="dark")
        page.page.evaluate(NEXT_FRAME)
        assert end.evaluate(color) == "rgb(63, 185, 80)"
        page.button("To the end").click()
        line = page.page.locator(".run-timeline .timeline-now").bounding_box()
        rows = page.page.locator(".run-timeline .timeline-over").bounding_box()
        assert line is not None
        assert rows is not None
        assert abs(line["x"] + line["width"] - rows["x"] - rows["width"]) < 1  # seen, not cut off


def test_the_buttons_of_a_run_stay_in_their_pane(service: Service, live: Open) -> None:
    with live(service.address, size=(1280, 800)) as page:
        page.run(GREETS, speed="0.25")
        page.active.first.wait_for()
        for size in (1280, 800), (1000, 700), PHONE:
            page.page.set_viewport_size({"width": size[0], "height": size[1]})
            beyond = page.page.locator(".run-foot").evaluate(
                "(foot) => [...foot.querySelectorAll('button, select, .run-clock')].filter((one) =>"
                " one.getBoundingClientRect().right > foot.getBoundingClientRect().right)"
                ".map((one) => one.textContent)"
            )
            assert beyond == [], size


def test_names_of_places_stay_within_the_walls(service: Service, live: Open) -> None:
    with live(service.address, size=(1280, 800)) as page:
        page.page.locator(".map-label").first.wait_for()
        assert page.page.locator(".map-label").count() >= 5
        assert page.page.evaluate(_OUTSIDE) == []


def test_wishes_of_the_system_do_not_break_it(service: Service, live: Open) -> None:
    for media in ({"forced_colors": "active"}, {"reduced_motion": "reduce"}):
        with live(service.address, size=(1280, 800), **media) as page:
            page.write(GREETS)
            assert audited(page.page, themes=("light",)) == []


def test_a_service_that_is_gone(tmp_path: Path, live: Open) -> None:
    words = ("--journal", tmp_path / "q.db", "--durability", "process", "--workers", "1")
    with (
        Service(*words, "--world", WORLDS / "closing.yaml") as service,
        live(service.address, allowed=(LOST,), size=(1280, 800)) as page,
    ):
        page.run(GREETS, speed="0.25")
        page.active.first.wait_for()
        service.kill()
        page.page.locator(".live-banner").filter(has_text="cannot be reached").wait_for()
        is_open_to_all(page)


def test_a_service_that_only_checks(live: Open) -> None:
    with (
        Service("--workers", "1") as service,
        live(service.address, size=(1280, 800)) as page,
    ):
        page.tab("Runs").click()
        is_open_to_all(page)


def test_tokens_robots_and_held_queues(tmp_path: Path, live: Open) -> None:
    allowed = (REFUSED, r"^failed: \S+/v1/queue$", "503")
    with (
        RealService(tmp_path / "robot", stopper=True) as robot,
        live(robot.address, allowed=allowed, size=(1280, 800)) as page,
    ):
        field = page.page.get_by_label("Token of the service")
        field.wait_for()
        is_open_to_all(page)
        field.fill("wrong")
        page.button("Sign in").click()
        page.page.locator(".token-refused").filter(has_text="did not accept").wait_for()
        is_open_to_all(page)
        field.fill(TOKEN)
        page.button("Sign in").click()
        stop = page.button("STOP")
        stop.wait_for()
        page.write(real_plan(move(120)))
        page.button("Run for real").click()
        page.active.first.wait_for()
        is_open_to_all(page)
        page.page.set_viewport_size({"width": PHONE[0], "height": PHONE[1]})
        page.page.get_by_role("tab", name="Events").scroll_into_view_if_needed()
        box = stop.bounding_box()
        assert box is not None
        assert 0 <= box["y"] < 60  # wherever one looks
        stop.click()
        page.page.locator(".held-banner").filter(has_text="is held").wait_for()
        is_open_to_all(page)
        robot.behave("partly")
        stop.click()
        page.page.locator(".held-trouble").wait_for()
        is_open_to_all(page)
