"""One browser for the tests of reports, and reports to open in it."""

from __future__ import annotations

from contextlib import AbstractContextManager, contextmanager
from typing import TYPE_CHECKING, Any, Protocol

import pytest

from tests.browser_support import launched, opened
from tests.viewing.browser.reports import Report

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser


class Open(Protocol):
    """Opens the report of a document."""

    def __call__(
        self, document: dict[str, Any], **context: Any
    ) -> AbstractContextManager[Report]: ...


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    with launched() as chromium:
        yield chromium


@pytest.fixture
def report(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Open:
    """Writes the page of a document to a file and opens it from there."""
    from gpsfsm.viewing.page import page

    @contextmanager
    def open_report(document: dict[str, Any], **context: Any) -> Iterator[Report]:
        file = tmp_path_factory.mktemp("report") / "report.html"
        file.write_text(page(document), encoding="utf-8")
        with opened(browser, file.as_uri(), **context) as opened_page:
            yield Report(opened_page, document)

    return open_report
