"""The live page behind a reverse proxy, below a path of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.conftest import REPO
from tests.service.browser.live import plan, speech, waypoint
from tests.service.proxy import behind_nginx
from tests.service.support import Service

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tests.service.browser.conftest import Open

PLAN = plan(waypoint(2, 5), speech("Here I am."))


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder: Path = tmp_path_factory.mktemp("plant")
    words = ("--journal", folder / "queue.db", "--durability", "process", "--workers", "1")
    world = REPO / "corpus" / "worlds" / "closing.yaml"
    with (
        Service(*words, "--root-path", "/gpsfsm", "--world", world) as service,
        behind_nginx(service, folder, tls=False) as proxy,
    ):
        yield proxy


@pytest.mark.parametrize("place", ["/gpsfsm/", "/gpsfsm"])
def test_a_plan_is_checked_run_and_shown_again(address: str, live: Open, place: str) -> None:
    with live(f"{address}{place}") as page:
        number = page.run(PLAN, speed="0")
        page.ended("has completed")
        assert page.page.url.startswith(f"{address}/gpsfsm/")
    with live(f"{address}/gpsfsm/#run={number}") as again:
        again.ended("has completed")
