"""The documentation site in a browser: all readers can use it, and search it from disk, too."""

from __future__ import annotations

import json
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import TYPE_CHECKING

import pytest

from tests.browser_audit import objections
from tests.browser_support import launched, opened
from tests.test_site import build

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from playwright.sync_api import Browser, Page

PAGES = ("tutorial/index.html", "experiments.html", "rules/GP303.html")
"""Consoles and pictures, wide tables, and a page as most are."""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with launched() as chromium:
        yield chromium


@pytest.fixture(scope="module")
def site(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    build(folder)
    return folder


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *words: object) -> None:
        """Say nothing."""


@pytest.fixture(scope="module")
def address(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """That of a version of the site, on a server that has versions where mike puts them."""
    root = tmp_path_factory.mktemp("root")
    build(root / "0.2", "0.2")
    (root / "latest").symlink_to(root / "0.2")
    listed = [{"version": "0.2", "title": "0.2", "aliases": ["latest"]}]
    (root / "versions.json").write_text(json.dumps(listed), encoding="utf-8")
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(_Quiet, directory=str(root))) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/0.2"
        server.shutdown()


def search(page: Page, word: str) -> None:
    """Type a word into the search box, and wait for what is found."""
    page.locator("input[name=query]").click()
    page.locator("input[name=query]").fill(word[:-1])  # what ends in a hyphen is no query
    page.locator("input[name=query]").press(word[-1])
    page.locator(".md-search-result__link").first.wait_for()


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_all_readers_can_use_pages(browser: Browser, address: str, theme: str) -> None:
    complaints = []
    for name in PAGES:
        with opened(browser, f"{address}/{name}", theme=theme) as page:
            page.locator(".md-version__current[aria-label^='0.2']").wait_for()
            complaints += [f"{name}: {each}" for each in objections(page)]
    with opened(browser, f"{address}/index.html", theme=theme) as page:
        search(page, "recovery")
        page.wait_for_function("document.getAnimations().length === 0")
        complaints += [f"search: {each}" for each in objections(page)]
    assert complaints == []


def test_the_search_finds_from_disk(browser: Browser, site: Path) -> None:
    page_of_rule = (site / "rules" / "GP101.html").as_uri()
    with opened(browser, page_of_rule) as page:
        search(page, "recovery-without-predecessor")
        page.locator(".md-search-result__link").first.click()
        page.wait_for_url("**/rules/GP307.html?h=*")
        page.locator("mark").first.wait_for()


def test_tables_are_reached_by_the_keyboard_where_they_scroll(
    browser: Browser, address: str
) -> None:
    right = """() => [...document.querySelectorAll(".md-typeset__scrollwrap")].every(
        (box) => (box.scrollWidth > box.clientWidth) === (box.tabIndex === 0))"""
    with opened(browser, f"{address}/experiments.html", size=(390, 844)) as page:
        page.wait_for_function(right)
        narrow = page.locator(".md-typeset__scrollwrap[tabindex='0']").count()
        page.set_viewport_size({"width": 1440, "height": 900})
        page.wait_for_function(right)
        assert narrow > page.locator(".md-typeset__scrollwrap[tabindex='0']").count()


def test_the_search_finds_on_a_server_with_versions(browser: Browser, address: str) -> None:
    with opened(browser, f"{address}/cli.html") as page:
        assert page.locator(".md-version__current").inner_text() == "0.2"
        assert page.locator("iframe").count() == 0  # a worker searches
        search(page, "recovery-without-predecessor")
        page.locator(".md-search-result__link").first.click()
        page.wait_for_url("**/0.2/rules/GP307.html?h=*")
