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
        assert "endless" in page.locator(".play-head .end").inner_text()


def test_the_picture_has_one_layout_and_draws_what_stops(report: Open) -> None:
    with report(document_of(DOOR.read_text())) as opened:
        kinds = opened.page.evaluate(f"() => {_PICTURE}.edges.map(({{ kind }}) => kind)")
        assert kinds.count("STOPS") == 2
        assert opened.page.evaluate(f"() => {_PICTURE}.items.length") == 5


REACTIVE = """<root BTCPP_format="4"><BehaviorTree ID="Go"><ReactiveSequence>
<IsGoal/><IsSafe/><ReactiveFallback><IsCharged/><Charge/></ReactiveFallback><FollowPath/>
</ReactiveSequence></BehaviorTree></root>"""
_NEAR = """() => {
  const graph = document.querySelector('.graph-touch').gpsfsmGraph;
  const { selected, near } = graph.pointers();
  const bare = [...near].filter((edge) => !graph.picture.edges[edge].route.length);
  return [selected.size, near.size, bare.length];
}"""


def test_the_tree_of_a_reactive_tree_is_nested_and_selects_all_inside(report: Open) -> None:
    document = document_of(REACTIVE)
    with report(document) as opened:
        page = opened.page
        page.get_by_role("tab", name="Tree").click()
        rows = page.locator(".tree .row")
        fallback = rows.filter(has_text="ReactiveFallback").filter(has_not_text="choice").first
        charge = rows.filter(has_text="Charge").last
        levels = [int(each.get_attribute("aria-level") or 0) for each in (fallback, charge)]
        assert levels[1] == levels[0] + 1
        assert charge.locator(".row-line").first.inner_text().startswith("@")
        charge.click()
        selected, near, bare = page.evaluate(_NEAR)
        assert selected == 1
        assert 0 < bare < near, "what stops it, and what it stops"
        fallback.click()
        selected, near, bare = page.evaluate(_NEAR)
        assert selected > 1
        assert bare == 0
        assert near > 0
