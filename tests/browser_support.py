"""A browser for tests: Chromium, driven by Playwright. What a page complains of fails the test."""

from __future__ import annotations

import os
import re
import shutil
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from playwright.sync_api import Browser, ConsoleMessage, Page

__all__ = ["NEXT_FRAME", "launched", "opened"]

_ARGUMENTS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
NEXT_FRAME = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
"""Waits until what was asked for is drawn."""


@contextmanager
def launched() -> Iterator[Browser]:
    """A browser; the tests that ask for one are skipped where there is none.

    Use it in a fixture of the scope ``package``: while it is there, no test may call
    ``asyncio.run``, because Playwright's own loop is running.
    """
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = os.environ.get("GPSFSM_CHROMIUM") or shutil.which("chromium")
    if path is None:
        pytest.skip("chromium is not installed")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(_ARGUMENTS))
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def opened(
    browser: Browser,
    address: str,
    *,
    allowed: Sequence[str] = (),
    size: tuple[int, int] = (1440, 900),
    theme: str = "light",
    **context: Any,
) -> Iterator[Page]:
    """A page at an address, in a context of its own.

    At the end there must have been no uncaught error, no failed request, no message of level
    warning or error on the console (which is where violations of the policy are told), and no
    request to elsewhere. ``allowed``: patterns of complaints that the test expects.
    """
    width, height = size
    own = browser.new_context(
        viewport={"width": width, "height": height}, color_scheme=theme, **context
    )
    complaints: list[str] = []

    def listen(message: ConsoleMessage) -> None:
        if message.type in ("error", "warning", "assert"):
            complaints.append(f"console: {message.text}")

    try:
        page = own.new_page()
        page.set_default_timeout(20_000)
        page.on("console", listen)
        page.on("pageerror", lambda error: complaints.append(f"error: {error}"))
        page.on("requestfailed", lambda request: complaints.append(f"failed: {request.url[:200]}"))
        page.on("request", lambda request: _watch(request.url, address, complaints))
        page.goto(address)
        yield page
        page.evaluate(NEXT_FRAME)
    finally:
        own.close()
    left = [each for each in complaints if not any(re.search(one, each) for one in allowed)]
    assert not left, "\n".join(left)


def _watch(url: str, address: str, complaints: list[str]) -> None:
    origin = re.match(r"\w+://[^/]*", address)
    assert origin is not None
    if not url.startswith((origin.group(), "data:", "blob:")):
        complaints.append(f"asks another server: {url[:200]}")
