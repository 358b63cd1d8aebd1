"""A browser for tests: Chromium, driven by Playwright. What a page complains of fails the test."""

from __future__ import annotations

import os
import re
import shutil
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from playwright.sync_api import Browser, ConsoleMessage, Locator, Page, Request

__all__ = ["NEXT_FRAME", "SETTLED", "launched", "opened", "shown_text", "shown_texts"]

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
SETTLED = """async () => {
  const frame = () => new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
  const views = () => JSON.stringify([...document.querySelectorAll('.graph-touch')]
    .map((touch) => touch.gpsfsmGraph?.camera)
    .filter(Boolean)
    .map(({ pan, zoom }) => [pan.x, pan.y, zoom]));
  let [before, since, frames] = [views(), performance.now(), 0];
  while (frames < 5 || performance.now() - since < 250) {
    await frame();
    frames += 1;
    const now = views();
    if (now !== before) [before, since, frames] = [now, performance.now(), 0];
  }
}"""
"""Waits until no automaton has moved for a quarter of a second and for five frames.

A time alone does not do: on a machine with much to do there are few frames in it.
"""
_TEXTS = """async (all) => {
  const frame = () => new Promise((done) => requestAnimationFrame(done));
  const skipped = (one) =>
    one.checkVisibility() && !one.checkVisibility({ contentVisibilityAuto: true });
  await frame();
  await frame();
  const texts = [];
  for (const one of all) {
    for (let left = 100; left && skipped(one); left -= 1) {
      one.scrollIntoView({ block: "nearest" });
      await frame();
    }
    if (skipped(one)) throw new Error(`never drawn: ${one.textContent}`);
    texts.push(one.innerText);
  }
  return texts;
}"""
"""Texts as they are drawn. Rows with ``content-visibility: auto`` have an empty ``innerText``
until the first frame that has them in view."""
_MEDIA: dict[str, Any] = {
    "media": "null",
    "reduced_motion": "no-preference",
    "forced_colors": "none",
}
_FORGET = """() => addEventListener("pagehide", () => {
    sessionStorage.clear();
    localStorage.clear();
})"""
"""The last that is done when the page is left, after what it keeps itself then."""
_KEPT: WeakKeyDictionary[Browser, Page] = WeakKeyDictionary()


@contextmanager
def launched() -> Iterator[Browser]:
    """A browser; the tests that ask for one are skipped where there is none.

    Use it in a fixture of the scope ``package`` (in conftest.py) or ``module``: while it is there,
    no test may call ``asyncio.run``, because Playwright's own loop is running.
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
    **media: Any,
) -> Iterator[Page]:
    """A page at an address, which knows nothing of the pages before; ``media``: as for CSS.

    At the end there must have been no uncaught error, no failed request, no message of level
    warning or error on the console (which is where violations of the policy are told), and no
    request to elsewhere. ``allowed``: patterns of complaints that the test expects.
    """
    complaints: list[str] = []

    def console(message: ConsoleMessage) -> None:
        if message.type in ("error", "warning", "assert"):
            complaints.append(f"console: {message.text}")

    def error(found: Exception) -> None:
        complaints.append(f"error: {found}")

    def failed(request: Request) -> None:
        complaints.append(f"failed: {request.url[:200]}")

    def asked(request: Request) -> None:
        _watch(request.url, address, complaints)

    listeners: dict[Any, Any] = {
        **{"console": console, "pageerror": error, "requestfailed": failed, "request": asked}
    }
    with _fresh(browser) as page:
        width, height = size
        page.set_viewport_size({"width": width, "height": height})
        page.emulate_media(**{**_MEDIA, "color_scheme": theme, **media})
        for kind, listener in listeners.items():
            page.on(kind, listener)
        page.goto(address)
        yield page
        page.evaluate(NEXT_FRAME)
        for kind, listener in listeners.items():
            page.remove_listener(kind, listener)
    left = [each for each in complaints if not any(re.search(one, each) for one in allowed)]
    assert not left, "\n".join(left)


def shown_text(locator: Locator) -> str:
    """The drawn text of an element, as soon as it is there."""
    text: str = locator.evaluate(f"async (one) => (await ({_TEXTS})([one]))[0]")
    return text


def shown_texts(locator: Locator) -> list[str]:
    """The drawn texts of the elements that are there one frame from now."""
    locator.page.evaluate(NEXT_FRAME)
    texts: list[str] = locator.evaluate_all(_TEXTS)
    return texts


@contextmanager
def _fresh(browser: Browser) -> Iterator[Page]:
    """The page that is kept, with nothing in it; a new one takes five times as long to be ready.

    After a test that has failed, it is not kept.
    """
    page = _KEPT.pop(browser, None)
    if page is None:
        page = browser.new_context().new_page()
        page.set_default_timeout(20_000)
    try:
        yield page
        page.unroute_all(behavior="ignoreErrors")
        page.evaluate(_FORGET)
        page.mouse.move(-1, -1)
        page.goto("about:blank")
        page.context.clear_cookies()
    except BaseException:
        page.context.close()
        raise
    _KEPT[browser] = page


def _watch(url: str, address: str, complaints: list[str]) -> None:
    origin = re.match(r"\w+://[^/]*", address)
    assert origin is not None
    if not url.startswith((origin.group(), "data:", "blob:")):
        complaints.append(f"asks another server: {url[:200]}")
