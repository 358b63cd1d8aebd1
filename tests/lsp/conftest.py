from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.lsp.client import Editor

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture(scope="session")
def editor(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Editor]:
    """One server for all tests that do not end it; each opens documents of its own."""
    pytest.importorskip("pygls", reason="gpsfsm lsp needs the extra lsp")
    root = tmp_path_factory.mktemp("plans")
    with Editor(root, options={"plans": ["*/always/*"]}) as client:
        yield client
        assert client.end() == 0
        assert client.process.stderr is not None
        assert client.process.stderr.read() == b""


@pytest.fixture(scope="session")
def frugal(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Editor]:
    """A server for an editor that can do little, and counts bytes."""
    pytest.importorskip("pygls", reason="gpsfsm lsp needs the extra lsp")
    bare = {"general": {"positionEncodings": ["utf-8", "utf-16"]}}
    with Editor(tmp_path_factory.mktemp("frugal"), capabilities=bare) as client:
        yield client
        assert client.end() == 0
