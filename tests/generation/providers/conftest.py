"""No test depends on the proxies or models of the machine that it runs on."""

from __future__ import annotations

import os

import pytest

_PROXIES = ("HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY", "NO_PROXY")


@pytest.fixture(autouse=True)
def _plain_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in os.environ:
        if name.upper() in _PROXIES or name.startswith(
            ("GPSFSM_MODEL", "GPSFSM_BASE", "GPSFSM_API")
        ):
            monkeypatch.delenv(name)
