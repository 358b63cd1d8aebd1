"""Requests to a plan queue whose process ends before it has answered."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gpsfsm.service.endpoints import controls
from gpsfsm.service.plan_queue import PlanQueueClient
from gpsfsm.service.problems import Problem
from gpsfsm.service.settings import Settings
from gpsfsm.workers.frames import Gone


class Ending(PlanQueueClient):
    """Whatever it is asked, its process ends meanwhile."""

    def __init__(self) -> None:
        super().__init__(Settings())
        self.asked: list[str] = []

    async def _ask(self, head: dict[str, Any], body: bytes) -> dict[str, Any]:
        self.asked.append(head["op"])
        raise Gone("has ended")


@pytest.mark.parametrize(("once", "times"), [(False, 2), (True, 1)])
def test_what_must_not_be_done_twice_is_not_asked_again(once: bool, times: int) -> None:
    queue = Ending()
    with pytest.raises(Problem) as told:
        asyncio.run(queue.ask("control", once=once))
    assert told.value.status == 503
    assert len(queue.asked) == times


def test_a_step_and_a_failure_must_not_be_done_twice() -> None:
    paths = {each.path.rpartition("/")[2] for each in controls.ENDPOINTS}
    again = paths - {"pause", "resume", "speed"}  # once more makes no difference
    assert again == set(controls._ONCE)
