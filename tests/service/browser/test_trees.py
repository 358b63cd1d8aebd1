"""The live page with behaviour trees: their leaves on the map, in the picture and in words."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest

from tests.conftest import REPO
from tests.service.support import Service

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.service.browser.conftest import Open

NAV2 = REPO / "docs" / "examples" / "nav2"
DEPOT = (NAV2 / "depot.xml").read_text(encoding="utf-8")
CHOICES = """<root BTCPP_format="4">
  <BehaviorTree ID="Main">
    <Repeat num_cycles="{rounds}">
      <Fallback>
        <Look/>
        <AlwaysSuccess/>
      </Fallback>
    </Repeat>
  </BehaviorTree>
</root>
"""


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    journal = tmp_path_factory.mktemp("live") / "queue.db"
    words = ("--journal", journal, "--durability", "process", "--workers", "1")
    with Service(*words, "--world", NAV2 / "depot.yaml", "--robot", NAV2 / "robot.yaml") as begun:
        yield begun


def test_leaves_of_a_tree_drive_and_are_halted(service: Service, live: Open) -> None:
    with live(service.address) as page:
        page.page.get_by_label("paused").check()
        page.run(DEPOT, world="depot", speed="20")
        page.held()
        drives = page.active.filter(has_text="NavigateToPose (goal=3.5;5;0) at line 5")
        page.step_until(drives)
        page.page.get_by_label("Speed of this run").select_option("0")
        page.button("Resume the run").click()
        page.ended("has completed")
        assert page.pose() == (6.0, 4.0)
        assert page.active.count() == 0  # the watching condition, too, has been halted
        page.tab("Events").click()
        rows = page.page.locator(".event-row")
        rows.filter(has_text=re.compile("IsBatteryLow at line 9 stops")).last.wait_for()
        rows.filter(has_text="the tree completes").wait_for()
        assert rows.filter(has_text="the plan").count() == 0


def test_a_choice_is_told_in_words(service: Service, live: Open) -> None:
    with live(service.address) as page:
        page.run(CHOICES, world="drawn", speed="0")
        page.ended("has completed")
        page.tab("Events").click()
        rows = page.page.locator(".event-row")
        rows.filter(has_text="choice (Repeat: another round) at line 3 does not hold").wait_for()
        assert rows.filter(has_text="ChoiceRunner").count() == 0


def test_a_tree_that_fails_is_no_plan_that_gave_up(service: Service, live: Open) -> None:
    tree = DEPOT.replace("3.5;5;0", "2.2;2;0")  # in a shelf
    with live(service.address) as page:
        page.run(tree, world="depot", speed="0")
        page.ended("The tree has failed")
