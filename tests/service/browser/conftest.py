"""One browser for the tests of the live page, and pages of a service in it."""

from __future__ import annotations

from contextlib import AbstractContextManager, contextmanager, suppress
from typing import TYPE_CHECKING, Any, Protocol

import httpx
import pytest

from tests.browser_support import launched, opened
from tests.service.browser.live import Live

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser

_ABANDONED = r"^failed: \S+/v1/(view|worlds/\S+|plans/\d+/events|queue/events|runs\S*)$"
"""Requests that the page itself gives up, because their answers are not wanted any more."""


class Open(Protocol):
    """Opens the live page of a service."""

    def __call__(self, address: str, **context: Any) -> AbstractContextManager[Live]: ...


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    with launched() as launch:
        yield launch


@pytest.fixture
def live(browser: Browser) -> Open:
    @contextmanager
    def open_page(address: str, *, allowed: tuple[str, ...] = (), **context: Any) -> Iterator[Live]:
        with opened(browser, address, allowed=(_ABANDONED, *allowed), **context) as page:
            try:
                yield Live(page)
            except BaseException:  # the next test finds no run of this one in the queue
                for command in ("stop", "queue/release"):
                    with suppress(httpx.HTTPError):  # it is gone
                        httpx.post(f"{address}/v1/{command}", json={})
                raise

    return open_page
