"""In real time too, what cannot be written has no effect, and everything is stopped."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

import pytest

from gpsfsm.execution.journal import Heading, Journal
from gpsfsm.execution.journal_errors import JournalFullError
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.realtime import RealtimeDriver
from gpsfsm.execution.replay import replay
from gpsfsm.execution.runner import Runner, StopRequested
from tests.execution.journaling import compiled

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from gpsfsm.execution.host import Sink
    from gpsfsm.execution.records import Input, Record, RunValue
    from gpsfsm.execution.runner import RunContext

PLAN = """<Plan>
  <Control name="all" type="parallel_all">
    <Runner interface="slow" provider="p"/>
    <Runner interface="quick" provider="p"/>
  </Control>
</Plan>
"""


class Watched(Runner):
    """Tells what happens to it."""

    def __init__(self, interface: str, message: list[str]) -> None:
        self._interface = interface
        self._messages = message

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        self._messages.append(f"{self._interface} starts")
        try:
            await context.sleep(20 if self._interface == "slow" else 0.01)
        except StopRequested:
            self._messages.append(f"{self._interface} is stopped")
            raise
        return {"a": 1, "b": 0.1}

    async def stop(self) -> None:
        self._messages.append(f"{self._interface} is unloaded")


class Failing:
    """Hands on to a journal until it is full."""

    def __init__(self, sink: Sink, good: int) -> None:
        self._sink = sink
        self._good = good

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        if not self._good:
            raise JournalFullError("full")
        self._good -= 1
        self._sink.write(at_us, happened, records)


@pytest.mark.parametrize("good", range(4))
def test_a_run_that_cannot_be_written_stops_everything(tmp_path: Path, good: int) -> None:
    path, messages = str(tmp_path / "j.db"), list[str]()
    kernel = Kernel(compiled(PLAN))
    with Journal(path, "none") as journal:
        sink = Failing(journal.begin(kernel, Heading(plan=PLAN.encode())), good)
        driver = RealtimeDriver(
            kernel, sink, lambda interface, _provider: Watched(interface, messages), grace_s=5
        )
        with pytest.raises(JournalFullError):
            asyncio.run(driver.run())
    with JournalReader(path) as reader:
        rows = list(reader.events(1))
    started = {row.interface for row in rows if row.kind == "STARTED"}
    assert {text.split()[0] for text in messages if text.endswith("starts")} <= started
    for interface in started:
        if f"{interface} starts" in messages and interface == "slow":
            assert "slow is stopped" in messages
    assert len([row for row in rows if row.input]) == good
    assert not any(row.kind == "ENDED" for row in rows)


def test_a_run_in_real_time_replays(tmp_path: Path) -> None:
    path, messages = str(tmp_path / "j.db"), list[str]()
    kernel = Kernel(compiled(PLAN.replace("slow", "other")))
    with Journal(path, "none") as journal:
        sink = journal.begin(kernel, Heading(plan=PLAN.encode()))
        driver = RealtimeDriver(
            kernel, sink, lambda interface, _provider: Watched(interface, messages), grace_s=5
        )
        asyncio.run(driver.run())
    with JournalReader(path) as reader:
        rows = list(reader.events(1))
        assert reader.verify(1) == len(rows)
    again = Kernel(compiled(PLAN.replace("slow", "other")))
    assert replay(again, rows).at_us == rows[-1].at_us
    assert again.status is kernel.status
    assert sorted(messages)[-2:] == ["quick is unloaded", "quick starts"]
