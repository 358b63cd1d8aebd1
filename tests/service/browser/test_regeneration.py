"""The live page and a model: a plan from a task, and another one after a plan has given up."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.cli.regenerating import CLOSING, ELSEWHERE, MISSION, TASK, TO_ANNEX, answers
from tests.service.support import Service

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.service.browser.conftest import Open

GIVES_UP = Path(MISSION).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("regeneration")


@pytest.fixture(scope="module")
def service(folder: Path) -> Iterator[Service]:
    answers(folder)
    model = ("--model", f"replay:{folder / 'answers.jsonl'}", "--task", TASK)
    words = ("--journal", folder / "q.db", "--durability", "process", "--workers", "1")
    with Service(*words, "--world", CLOSING, *model) as server:
        yield server


def test_the_plan_that_goes_on_arrives_beside_the_old_one(service: Service, live: Open) -> None:
    with live(service.address) as page:
        first = page.run(GIVES_UP, speed="5")
        page.active.first.wait_for()
        page.page.locator(".run-panes.two").wait_for(timeout=60_000)
        page.page.locator(".run-title", has_text=f"Run {first + 2}").wait_for(timeout=60_000)
        page.ended("has completed")
        assert "closed: office door, annex door" in (page.map.get_attribute("aria-label") or "")
        old, new = page.page.locator(".run-pane.old"), page.page.locator(".run-pane.new")
        old.filter(has_text=f"Before: run {first + 1}").filter(has_text="gave up").wait_for()
        new.filter(has_text=f"Now: run {first + 2}").wait_for()
        page.page.set_viewport_size({"width": 1280, "height": 800})
        for pane in (old, new):
            within = pane.bounding_box()
            button = pane.get_by_role("button", name="Zoom in").bounding_box()
            assert within is not None
            assert button is not None
            assert button["x"] >= within["x"]
        difference = page.page.locator(".run-difference")
        difference.locator("summary").filter(has_text="behaves differently").click()
        assert difference.locator("li").count() > 0
        page.button("Show only this run").click()
        page.page.locator(".run-panes:not(.two)").wait_for()
        page.button(f"continues run {first + 1}").click()
        page.title.filter(has_text=f"Run {first + 1}").wait_for()
        page.ended("gave up")
        banner = page.page.locator(".run-banner").filter(has_text=f"run {first + 2} continues")
        banner.wait_for()
        page.choose_run(first)
        page.page.locator(".run-banner").filter(has_text="refused").wait_for()


def test_a_model_writes_a_plan_from_a_task(service: Service, folder: Path, live: Open) -> None:
    answers(folder, "I do not know.", ELSEWHERE)
    with live(service.address) as page:
        page.write(TO_ANNEX)
        page.page.get_by_label("Task").fill("go to the window")
        page.button("Write a plan").click()
        page.page.locator(".draft-refusal").filter(has_text="replaced your text").wait_for(
            timeout=60_000
        )
        page.page.locator(".draft-status.good").wait_for()
        assert page.editor.input_value() == ELSEWHERE
        page.button("Restore my text").click()
        assert page.editor.input_value() == TO_ANNEX
        answers(folder, "No.", "No!", "Never.")
        page.button("Write a plan").click()
        none = page.page.locator(".draft-refusal").filter(has_text="No plan was accepted")
        none.wait_for(timeout=60_000)
        assert page.editor.input_value() == TO_ANNEX
