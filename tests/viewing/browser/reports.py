"""A report in a browser, in the words of those who use it: what they press and what they see."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gpsfsm.api import check_options
from gpsfsm.checking import check_text
from gpsfsm.viewing.document import document
from gpsfsm.viewing.plans import Viewed
from tests.browser_support import NEXT_FRAME, SETTLED, shown_text, shown_texts
from tests.viewing.browser.states import shown_after

if TYPE_CHECKING:
    from playwright.sync_api import Page

    from gpsfsm.checking import CheckOptions

__all__ = ["Report", "States", "document_of", "expected_states"]

States = dict[int, str]
"""The states of elements, by their numbers; those that are idle left out."""

_TREE = """() => [...document.querySelectorAll('.tree .row')].map((row) => {
  const state = row.querySelector('.state');
  return [Number(row.dataset.element), state ? state.className : ''];
})"""


def document_of(
    *texts: str | bytes, options: CheckOptions | None = None, diff: bool = False
) -> dict[str, Any]:
    """The view document of some texts."""
    chosen = options or check_options()
    names = [f"plan{number}.xml" for number in range(len(texts))]
    each = [
        Viewed(text, check_text(text, name, chosen))
        for text, name in zip(texts, names, strict=True)
    ]
    return document(each, chosen, diff=diff)


def expected_states(plan: dict[str, Any], play: dict[str, Any], count: int) -> States:
    """The states of the elements after so many records, by brute force.

    Of a join a control shows only that it waits, or waits for ever.
    """
    nodes = plan["automaton"]["nodes"]
    states: States = {}
    for node, state, _ in shown_after(plan["automaton"], play["records"], count)["states"]:
        element = nodes[node]["element"]
        if element >= 0 and (nodes[node]["kind"] == "runner" or state in ("waiting", "stuck")):
            states.setdefault(element, state)
    return states


@dataclass
class Report:
    """An open report."""

    page: Page
    document: dict[str, Any]

    @property
    def plan(self) -> dict[str, Any]:
        """The first plan of the document."""
        plan: dict[str, Any] = self.document["plans"][0]
        return plan

    def drawn(self) -> None:
        """Wait until what was asked for is drawn."""
        self.page.evaluate(NEXT_FRAME)

    def settled(self) -> None:
        """Wait until the views have moved to where they go, and what follows them has followed."""
        self.page.evaluate(SETTLED)

    def press(self, *keys: str) -> None:
        """Press keys, and wait for what they do."""
        for key in keys:
            self.page.keyboard.press(key)
        self.drawn()

    def text(self, selector: str) -> str:
        """What is written in the first element of that kind."""
        return shown_text(self.page.locator(selector).first)

    def texts(self, selector: str) -> list[str]:
        """What is written in all elements of that kind."""
        return shown_texts(self.page.locator(selector))

    def select(self, rule: str) -> None:
        """Open the first finding of a rule."""
        self.page.locator(".finding-head", has_text=rule).first.click()
        self.drawn()

    def open_play(self, rule: str) -> dict[str, Any]:
        """Open the scenario of the first finding of a rule, at its start; return the play."""
        place, finding = next(
            (place, each)
            for place, each in enumerate(self.plan["findings"])
            if each["rule"] == rule and each["play"] >= 0
        )
        self.page.locator(f'.finding[data-finding="{place}"] > .finding-play').click()
        self.page.get_by_role("tab", name=re.compile("Tree")).click()
        self.page.get_by_label("To the start").click()
        self.drawn()
        play: dict[str, Any] = self.plan["plays"][finding["play"]]
        return play

    def states(self) -> States:
        """What the rows of the tree show; they must all be in view."""
        self.drawn()
        states: States = {}
        for element, classes in self.page.evaluate(_TREE):
            match = re.search(r"state-(\w+)", classes)
            if match is not None and match.group(1) != "idle":
                states[element] = match.group(1)
        return states

    def step(self) -> tuple[int, int]:
        """Which step is shown, of how many."""
        number, of = self.text(".play-place").split(" / ")
        return int(number), int(of)

    def sentence(self) -> str:
        """The sentence of the story that is marked in the bar; "" for none."""
        self.drawn()
        return " ".join(self.texts(".playbar .story li.current"))
