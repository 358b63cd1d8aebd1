"""The live page of a robot: how far its runners are, where it is, and how it is stopped."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest

from tests.service.real import SHORT, TOKEN, RealService, move, plan, set_plan, until
from tests.service.support import ended

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Page

    from tests.service.browser.conftest import Open
    from tests.service.browser.live import Live

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealService]:
    with RealService(tmp_path_factory.mktemp("real") / "robot", stopper=True) as service:
        yield service


_UNAUTHORIZED = r"^console: .* 401 \(Unauthorized\)$"
_ABANDONED = r"^failed: \S+/v1/queue$"
_COLOR = "(one) => getComputedStyle(one).backgroundColor"


def signed_in(page: Page) -> None:
    page.get_by_label("Token of the service").fill(TOKEN)
    page.get_by_role("button", name="Sign in").click()
    page.get_by_role("button", name="STOP").wait_for()


def begun(live: Live, text: str) -> None:
    live.write(text)
    live.button("Run for real").click()
    live.title.wait_for()


def test_a_robot_is_watched_and_stopped(robot: RealService, live: Open) -> None:
    with live(robot.address, allowed=(_UNAUTHORIZED, _ABANDONED)) as page, robot.client() as client:
        signed_in(page.page)
        assert not page.page.get_by_label("World", exact=True).is_visible()
        assert not page.page.get_by_label("Speed of the run").is_visible()
        begun(page, plan(move(120)))
        says = page.page.locator(".active-says")
        says.filter(has_text=re.compile(r"^11\d\.\d m left$")).wait_for()
        assert page.page.get_by_text("Make it fail").count() == 0
        assert page.button("Step: let one event happen, then pause").count() == 0
        assert page.button("Pause the run").is_visible()
        pose = "() => Number(document.querySelector('.map-picture').dataset.pose.split(' ')[1]) > 3"
        page.page.wait_for_function(pose)  # the map has grown with it
        page.page.get_by_role("button", name="STOP").click()
        banner = page.page.locator(".held-banner")
        banner.filter(has_text="The queue is held: stopped by token 0.").wait_for()
        banner.filter(has_text="No plan starts until you release it; none is waiting.").wait_for()
        stop = page.page.get_by_role("button", name="STOP")
        stop.hover()
        assert stop.evaluate(_COLOR) == "rgb(153, 9, 14)"  # whatever else buttons do there
        page.badge.filter(has_text="cancelled").wait_for()
        waiting = set_plan(client, SHORT)
        banner.filter(has_text="1 is waiting").wait_for()
        page.button("Release the queue").click()
        banner.wait_for(state="hidden")
        assert ended(client, waiting)["completed"]


def test_a_stop_that_is_not_confirmed_is_told(robot: RealService, live: Open) -> None:
    refused = r"^console: .* 503 \(Service Unavailable\)$"
    robot.behave("partly")
    with (
        live(robot.address, allowed=(_UNAUTHORIZED, _ABANDONED, refused)) as page,
        robot.client() as client,
    ):
        signed_in(page.page)
        page.page.get_by_role("button", name="STOP").click()
        trouble = page.page.locator(".held-trouble")
        trouble.filter(has_text="The stop is not confirmed").wait_for()
        assert "/dock has not answered" in trouble.inner_text()
        robot.behave("well")
        page.button("Release the queue").click()
        page.page.locator(".held-banner").wait_for(state="hidden")
        until(lambda: client.get("/v1/queue").json()["held"] == "")
