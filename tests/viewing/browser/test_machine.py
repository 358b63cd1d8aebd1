"""The page of a machine: what stops and what repeats is seen, and a lasso is played."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tests.viewing.browser.reports import document_of

if TYPE_CHECKING:
    from tests.viewing.browser.conftest import Open

DOOR = Path(__file__).parents[3] / "docs" / "examples" / "door.json"
_STATES = """() => Object.fromEntries([...globalThis.gpsfsmPage.store.state.states]
  .map(([node, { state }]) => [node, state]))"""
_PICTURE = "globalThis.gpsfsmPage.stages.plan.made.graph.picture()"
_TAKEN = "() => [...globalThis.gpsfsmPage.store.state.taken].sort((one, other) => one - other)"


def test_a_lasso_is_played_to_the_end_of_its_round(report: Open) -> None:
    document = document_of(DOOR.read_text())
    with report(document) as opened:
        page = opened.page
        finding = page.locator(".finding", has_text="GP314").nth(1)
        finding.locator(".finding-play").click()
        page.get_by_label("To the end").click()
        opened.drawn()
        states = page.evaluate(_STATES)
        assert states["0"] == "succeeded"
        assert states["1"] == "running"  # again
        assert states["2"] == "running"
        assert states["3"] == "succeeded"
        edges = document["plans"][0]["automaton"]["edges"]
        taken = {(edges[at]["source"], edges[at]["event"]) for at in page.evaluate(_TAKEN)}
        assert taken == {
            (0, "SUCCEEDED"), (1, "STARTED"), (2, "SUCCEEDED"), (1, "STOPPED"), (3, "SUCCEEDED"),
        }  # fmt: skip
        assert "ENDLESS" in page.locator("body").inner_text()


def test_the_picture_has_one_layout_and_draws_what_stops(report: Open) -> None:
    with report(document_of(DOOR.read_text())) as opened:
        kinds = opened.page.evaluate(f"() => {_PICTURE}.edges.map(({{ kind }}) => kind)")
        assert kinds.count("STOPS") == 2
        assert opened.page.evaluate(f"() => {_PICTURE}.items.length") == 5
