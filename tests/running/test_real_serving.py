"""The queue of real runs, as far as no process is needed: its bonds."""

from __future__ import annotations

import asyncio
import time
from typing import Any

import pytest

from gpsfsm.running.real_serving import RealQueue

_LEASE_S = 0.05


class Halting(RealQueue):
    """It has no plans, and notes why it is to stop."""

    def __init__(self) -> None:
        self._bonds = {}
        self.halted: list[str] = []

    def halt(self, reason: str, *, renew: bool = True) -> int:
        self.halted.append(reason)
        return 0

    def held(self) -> dict[str, Any]:
        return {"bonds": len(self._bonds)}


@pytest.mark.parametrize("more", [{"end": False}, {"end": True}, {"end": False, "lease_s": 60.0}])
def test_a_late_beat_does_not_hide_that_its_bond_was_lost(more: dict[str, Any]) -> None:
    async def late() -> list[str]:
        queue = Halting()
        await queue.beat({"client": "me", "lease_s": _LEASE_S, "end": False}, b"")
        time.sleep(2 * _LEASE_S)  # the event loop hangs, and so does what looks at the lease
        await queue.beat({"client": "me", "lease_s": _LEASE_S, **more}, b"")
        halted = [*queue.halted]
        await queue.beat({"client": "me", "lease_s": _LEASE_S, "end": True}, b"")
        return halted

    assert asyncio.run(late()) == [f"the bond is lost: no beat for {_LEASE_S:g} s from me"]
