"""One service for all tests that do not harm it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.service.support import Service

if TYPE_CHECKING:
    from collections.abc import Iterator

    import httpx

pytest.importorskip("starlette", reason="the extra 'serve' is not installed")
pytest.importorskip("uvicorn", reason="the extra 'serve' is not installed")


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    journal = tmp_path_factory.mktemp("service") / "queue.db"
    words = ("--journal", journal, "--durability", "process", "--failure", "0", "--workers", "1")
    with Service(*words) as server:
        yield server


@pytest.fixture
def client(service: Service) -> Iterator[httpx.Client]:
    with service.client() as connection:
        yield connection
