"""The live page as a test uses it: by what a person sees of it."""

from __future__ import annotations

import re
from contextlib import suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from playwright.sync_api import Locator, Page

__all__ = ["Live", "plan", "speech", "waypoint"]

LOST = (
    r"ERR_(CONNECTION_(REFUSED|RESET|CLOSED)|EMPTY_RESPONSE|INCOMPLETE_CHUNKED)"
    r"|^failed: |status of 503"
)
"""The complaints of a browser whose service has been killed."""

_SECONDS = re.compile(r"(?:(\d+):)?(\d+\.\d)")
_PLACE_OF_NODE = """(touch, words) => {
    const { camera, picture } = touch.gpsfsmGraph;
    const { box } = picture.items[picture.itemOf[words]];
    const edge = touch.getBoundingClientRect();
    return [edge.x + camera.pan.x + (box.x + box.width / 2) * camera.zoom,
            edge.y + camera.pan.y + (box.y + box.height / 2) * camera.zoom];
}"""

_PUT_IN = """(area, text) => {
    area.value = text;
    area.dispatchEvent(new Event("input", { bubbles: true }));
}"""
"""``fill`` puts in line by line, which takes long."""

_DRAWN = """() => new Promise((drawn) =>
    requestAnimationFrame(() => requestAnimationFrame(() => drawn())))"""
"""The page draws once per frame."""

STATES = """() => {
  const { store } = document.querySelector('.run-pane.new .graph-touch').gpsfsmGraph;
  return [...store.state.states].map(([node, { state }]) => `${node} ${state}`).join();
}"""
"""The nodes of the run that is shown, with their states."""
STEPPED = f"""(before) =>
  document.querySelector('.run-over') || ({STATES})() !== before"""
"""True once an event has happened since the states were those."""


def waypoint(x: float, y: float) -> str:
    name = "nav2_capabilities/WaypointRunner"
    return f'<Runner interface="{name}" provider="{name}" x="{x}" y="{y}"/>'


def speech(text: str) -> str:
    name = "perception_capabilities/SpeechRunner"
    return f'<Runner interface="{name}" provider="{name}" text="{text}"/>'


def plan(*units: str) -> str:
    return "<Plan>\n" + "\n".join(f"  {unit}" for unit in units) + "\n</Plan>\n"


class Live:
    """A page of the service in a browser."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.editor = page.get_by_role("textbox", name="Text of the plan")
        self.status = page.locator(".draft-status")
        self.title = page.locator(".run-title")
        self.badge = page.locator(".run-head .run-badge").first
        self.over = page.locator(".run-over")
        self.active = page.locator(".active-row")
        self.clock = page.locator(".run-clock")
        self.handle = page.get_by_label("Time of the run")
        self.map = page.locator(".map-picture")
        self.toasts = page.locator(".toast")

    def button(self, name: str) -> Locator:
        return self.page.get_by_role("button", name=name, exact=True)

    def tab(self, name: str | re.Pattern[str]) -> Locator:
        return self.page.get_by_role("tab", name=name)

    def write(self, text: str) -> None:
        """The text is put in at once, checked, and told to be accepted or not."""
        self.editor.evaluate(_PUT_IN, text)
        self.page.locator(".draft-status:is(.good, .bad)").wait_for()

    def run(self, text: str, *, world: str = "closing", speed: str = "20") -> int:
        """The number of the run that the page then shows."""
        self.write(text)
        self.page.get_by_label("World", exact=True).select_option(world)
        self.page.get_by_label("Speed of the run").select_option(speed)
        before = self.page.locator(".run-title").all_inner_texts()
        self.button("Run").click()
        return self.shown(before)

    def shown(self, before: list[str]) -> int:
        """The number of the run that is shown, as soon as it is another one."""
        pattern = re.compile(r"^Run (\d+)")
        title = self.title.filter(has_not_text=before[0]) if before else self.title
        title.wait_for(timeout=60_000)
        match = pattern.match(title.inner_text())
        assert match is not None
        return int(match[1])

    def held(self) -> None:
        """The run that is shown is paused."""
        self.page.locator(".run-badge.held").wait_for()

    def ended(self, words: str) -> None:
        """The run that is shown has ended so."""
        self.over.filter(has_text=words).wait_for(timeout=60_000)
        self.page.evaluate(_DRAWN)

    def step_until(self, wanted: Locator) -> None:
        """Lets one event happen after the other in a paused run, until something is shown."""
        from playwright.sync_api import TimeoutError as PlaywrightTimeoutError

        for _ in range(20):
            before = self.page.evaluate(STATES)
            self.button("Step: let one event happen, then pause").click()
            with suppress(PlaywrightTimeoutError):  # of an event that no node has
                self.page.wait_for_function(STEPPED, arg=before, timeout=5_000)
            with suppress(PlaywrightTimeoutError):  # other panes are drawn after the automaton
                wanted.wait_for(timeout=2_000)
                return
        raise AssertionError(f"no step has shown {wanted}")

    def at_s(self) -> float:
        """The time of the run that is shown."""
        match = _SECONDS.match(self.clock.inner_text())
        assert match is not None
        return int(match[1] or 0) * 60 + float(match[2])

    def pose(self) -> tuple[float, float]:
        """Where the map shows the robot."""
        x, y = (self.map.get_attribute("data-pose") or "").split()
        return float(x), float(y)

    def go_to(self, seconds: float) -> None:
        """Moves the handle of the timeline."""
        self.handle.fill(str(round(seconds * 1000)))

    def click_node(self, node: int) -> None:
        """Clicks a runner in the automaton of the run that goes on."""
        touch = self.page.locator(".run-pane.new .graph-touch")
        x, y = touch.evaluate(_PLACE_OF_NODE, node)
        self.page.mouse.click(x, y)

    def choose_run(self, number: int) -> None:
        self.tab("Runs").click()
        self.page.locator(f"[data-run='{number}']").click()
        self.title.filter(has_text=re.compile(rf"^Run {number}\b")).wait_for()
