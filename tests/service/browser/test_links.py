"""Links to a run, to a time of it, and to a finding of its plan."""

from __future__ import annotations

import zlib
from base64 import urlsafe_b64encode
from typing import TYPE_CHECKING

import pytest

from tests.conftest import REPO
from tests.service.browser.live import plan, speech, waypoint
from tests.service.support import Service, ended

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.service.browser.conftest import Open

WORLD = REPO / "corpus" / "worlds" / "closing.yaml"
TWO = plan(
    waypoint(2, 5), speech("Here I am."), f'<Control type="recovery">{speech("Oh.")}</Control>'
)
_PACKER = zlib.compressobj(9, wbits=-15)
BOMB = urlsafe_b64encode(_PACKER.compress(bytes(5_000_000)) + _PACKER.flush()).decode().rstrip("=")
"""Megabytes of one character, in a few thousand."""
_WRITTEN = "(hash) => location.hash === hash"


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    journal = tmp_path_factory.mktemp("links") / "queue.db"
    words = ("--journal", journal, "--durability", "process", "--workers", "1")
    with Service(*words, "--world", WORLD) as server:
        with server.client() as client:  # run 1, to which links lead
            answer = client.post("/v1/plans", json={"plan": TWO})
            ended(client, answer.json()["plan_id"])
        yield server


def test_a_time_of_a_run_is_the_same_in_another_browser(service: Service, live: Open) -> None:
    with live(service.address) as page:
        number = page.run(TWO, speed="0")
        page.ended("has completed")
        assert page.page.url.endswith(f"#run={number}")
        page.go_to(1.5)
        page.page.wait_for_function(_WRITTEN, arg=f"#run={number}&at=1500000")
        page.page.locator(".details .finding-head").first.click()
        page.page.wait_for_function("() => location.hash.includes('&finding=')")
        key = page.page.locator(".details .finding.selected .rule-code").inner_text()
        assert f"&finding={key}:" in page.page.url
        before = (page.clock.inner_text(), page.pose(), page.active.all_inner_texts())
        with live(page.page.url) as again:
            again.page.locator(".details .finding.selected").wait_for()
            now = (again.clock.inner_text(), again.pose(), again.active.all_inner_texts())
            assert now == before
            assert again.title.inner_text().startswith(f"Run {number}")
            assert not again.toasts.count()


def test_back_and_forward_go_from_run_to_run(service: Service, live: Open) -> None:
    with live(service.address) as page:
        first = page.run(TWO, speed="0")
        page.ended("has completed")
        page.go_to(1)
        page.page.wait_for_function(_WRITTEN, arg=f"#run={first}&at=1000000")
        second = page.run(TWO, speed="0")
        assert second > first
        page.ended("has completed")
        page.page.wait_for_function(_WRITTEN, arg=f"#run={second}")
        page.page.go_back()
        page.title.filter(has_text=f"Run {first}").wait_for()
        page.page.wait_for_function(_WRITTEN, arg=f"#run={first}&at=1000000")
        assert page.at_s() == 1
        page.page.go_back()
        page.tab("Draft").and_(page.page.locator("[aria-selected=true]")).wait_for()
        page.page.go_forward()
        page.page.go_forward()
        page.title.filter(has_text=f"Run {second}").wait_for()
        assert page.page.url.endswith(f"#run={second}")


_SPY = """() => Object.defineProperty(navigator, "clipboard", {
  configurable: true, value: { writeText: async (text) => void (globalThis.copied = text) },
})"""


def test_a_draft_goes_with_its_link(service: Service, live: Open) -> None:
    text = plan(waypoint(2, 5), speech("Guten Tag, Zoë 🙂."), "<!-- " + "more " * 500 + "-->")
    with live(service.address) as page:
        page.write(text)
        page.page.evaluate(_SPY)
        page.page.get_by_role("button", name="Copy link: it opens this text").click()
        link = page.page.evaluate("() => globalThis.copied")
        assert link.startswith(f"{service.address}/#draft=")
        assert len(link) < 1_000
        page.page.locator(".details .finding-head").last.click()
        page.page.get_by_role("button", name="Copy a link to this finding").click()
        key = page.page.locator(".finding.selected .rule-code").inner_text()
        linked = page.page.evaluate("() => globalThis.copied")
        assert linked.startswith(f"{link}&finding={key}:")
    with live(linked) as page:
        page.page.locator(".finding.selected", has_text=key).wait_for()
        assert page.editor.input_value() == text
        assert not page.toasts.count()
        page.page.wait_for_function("() => location.hash === ''")  # it is a text like others now
        page.write("<Plan/>")
        page.page.reload()
        page.page.locator(".draft-status:is(.good, .bad)").wait_for()
        assert page.editor.input_value() == "<Plan/>"
        page.page.goto(link)  # only what is behind the # differs
        page.page.get_by_role("button", name="Restore my text").click()
        assert page.editor.input_value() == "<Plan/>"


def test_the_link_of_a_finding_is_that_of_the_text_it_was_found_in(
    service: Service, live: Open
) -> None:
    edit_and_copy = """() => {
      const area = document.querySelector(".editor-text");
      area.value += " ";
      area.dispatchEvent(new Event("input", { bubbles: true }));
      document.querySelector("[aria-label='Copy a link to this finding']").click();
    }"""
    with live(service.address) as page:
        page.write(TWO)
        page.page.evaluate(_SPY)
        page.page.get_by_role("button", name="Copy link: it opens this text").click()
        link = page.page.evaluate("() => globalThis.copied")
        page.page.locator(".details .finding-head").last.click()
        page.page.evaluate(edit_and_copy)
        assert page.page.evaluate("() => globalThis.copied").startswith(f"{link}&finding=")


def test_a_text_that_fits_in_no_link_has_none(service: Service, live: Open) -> None:
    noise = "".join(f"{number * 2654435761 % 2**32:08x}" for number in range(3_000))
    with live(service.address) as page:
        page.write(plan(waypoint(2, 5), f"<!-- {noise} -->"))
        assert not page.page.get_by_role("button", name="Copy link").count()
        page.write(TWO)
        page.page.get_by_role("button", name="Copy link").wait_for()


@pytest.mark.parametrize(
    "fragment",
    [
        "#draft=abc",
        f"#draft={BOMB}",
        "#draft=<Plan>",
        "#draft=abc&run=1",
        "#run=<img src=x>",
        "#run=1&run=2",
        "#run=0",
        "#run=-1",
        "#view=plan",
        "#at=5",
        "#" + "run=1&" * 500,
    ],
)
def test_a_hostile_link_is_left_out_with_a_notice(
    fragment: str, service: Service, live: Open
) -> None:
    with live(f"{service.address}/{fragment}") as page:
        page.toasts.filter(has_text="The link points to something that is not here.").wait_for()
        assert not page.page.locator("#gpsfsm-live img, #gpsfsm-live script").count()


def test_a_run_that_there_is_not(service: Service, live: Open) -> None:
    with live(f"{service.address}/#run=999999", allowed=("404",)) as page:
        page.toasts.filter(has_text="Run 999999 cannot be shown").wait_for()
        assert page.toasts.count() == 1
