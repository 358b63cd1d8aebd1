"""The commands of docs/service.md, run against a service; and the page tells the truth."""

from __future__ import annotations

import re
import shutil
from typing import TYPE_CHECKING

import pytest

from gpsfsm.service.costs import GATE_MS, SMALL_BYTES
from gpsfsm.service.registry import all_endpoints
from gpsfsm.service.settings import MOST_TOKENS, Settings
from tests.conftest import REPO
from tests.service.support import Service
from tests.test_docs import check

if TYPE_CHECKING:
    from pathlib import Path

PAGE = (REPO / "docs" / "service.md").read_text(encoding="utf-8")
_BLOCK = re.compile(r"^```service\n(.*?)^```$", re.DOTALL | re.MULTILINE)


@pytest.mark.skipif(not (shutil.which("curl") and shutil.which("jq")), reason="needs curl and jq")
def test_commands_print_what_the_page_shows(tmp_path: Path) -> None:
    blocks = _BLOCK.findall(PAGE)
    assert blocks
    words = ("--journal", tmp_path / "queue.db", "--failure", "0", "--workers", "1")
    with Service(*words) as service:
        place = service.address.removeprefix("http://")
        text = "\n\n".join(
            f"```console\n{block.replace('localhost:8321', place)}```" for block in blocks
        )
        page = tmp_path / "page.md"
        page.write_text(f"# Page\n\n{text}\n", encoding="utf-8")
        report = check(page)
    assert report.returncode == 0, report.stdout + report.stderr


def test_every_endpoint_is_on_the_page() -> None:
    table = PAGE[: PAGE.index("## Gate")]
    for each in all_endpoints():
        assert f"{each.path}`" in table or f"{each.path}," in table, each.path


def test_the_limits_are_those_of_the_service() -> None:
    settings = Settings()
    for documented, real in (
        ("| 10 s | `--time-limit`", settings.request_s == 10),
        ("| 2 | `--workers`", settings.workers == 2),
        ("| 1024 MB | `--memory`", settings.memory_mb == 1024),
        ("| 64 | `--waiting`", settings.waiting == 64),
        ("| 0.5 s, and four times as long | `--small-limit`", settings.small_s == 0.5),
        ("| as many, at most 2 | `--gate-workers`", settings.reserved == settings.workers == 2),
        ("| tokens | 1000 |", MOST_TOKENS == 1000),
        ("less than 60 ms of a core: plans of up to 55 elements", GATE_MS == 60),
        ("more than 24 KiB", SMALL_BYTES == 24 << 10),
        ("2 MiB, all bodies at once 64 MiB", settings.max_body == 2 << 20),
        ("all bodies at once 64 MiB", settings.max_bodies == 64 << 20),
        ("1 MiB, 20,000 elements", settings.limits.max_bytes == 1 << 20),
        ("20,000 elements, 200 levels", settings.limits.max_elements == 20_000),
        ("| 2048 | `--connections`", settings.connections == 2048),
        ("| 10, 20 and 15 s |", (settings.header_s, settings.body_s, settings.idle_s)
         == (10, 20, 15)),
        ("wait for ends | 64 |", settings.streams == 64),
        ("| 1000 | `--queue`", settings.most_waiting == 1000),
        ("| 100,000 |", settings.most_plans == 100_000),
    ):  # fmt: skip
        assert documented in PAGE
        assert real, documented
