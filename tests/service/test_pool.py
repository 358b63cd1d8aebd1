"""Workers begin together and end together: none outlives the event loop that has started it."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from gpsfsm.errors import GpsfsmError
from gpsfsm.service.pool import all_of

if TYPE_CHECKING:
    from pathlib import Path

FAILURE = "no memory"


@pytest.mark.parametrize("cause", ["failure", "cancellation", "nothing"])
def test_nothing_goes_on_behind_it(cause: str) -> None:
    ended: list[int] = []

    async def part(number: int) -> None:
        try:
            await asyncio.sleep(0 if cause == "nothing" else 60)
        finally:
            await asyncio.sleep(number / 100)  # a process that is ended takes a while, too
            ended.append(number)

    async def failing() -> None:
        await asyncio.sleep(0.01)
        if cause == "failure":
            raise GpsfsmError(FAILURE)

    async def everything() -> None:
        work = asyncio.ensure_future(all_of(all_of(part(1), part(3)), all_of(part(2), failing())))
        await asyncio.sleep(0.005)
        if cause == "cancellation":
            work.cancel()
        await work

    match cause:
        case "failure":
            with pytest.raises(GpsfsmError, match=FAILURE):
                asyncio.run(everything())
        case "cancellation":
            with pytest.raises(asyncio.CancelledError):
                asyncio.run(everything())
        case _:
            asyncio.run(everything())
    assert sorted(ended) == [1, 2, 3]


def test_a_queue_that_cannot_begin_leaves_no_word_of_its_workers(tmp_path: Path) -> None:
    """They are being started meanwhile; asyncio complained of those that ended behind its loop."""
    journal = tmp_path / "queue.db"
    journal.write_text("not a database " * 500)
    command = [sys.executable, "-m", "gpsfsm", "serve", "--isolated", "--port", "0"]
    for _ in range(3):
        done = subprocess.run(
            [*command, "--journal", journal],
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert done.returncode == 2
        assert done.stderr == (
            f"gpsfsm: {journal}: this is not a journal of gpsfsm, or its first bytes are damaged\n"
        )
