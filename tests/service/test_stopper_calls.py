"""Calls of others that the stopper passes on: what they stop, and what is answered."""

from __future__ import annotations

import asyncio
import sys
from typing import TYPE_CHECKING

from gpsfsm.service.stopper import Stopper

if TYPE_CHECKING:
    from pathlib import Path

CHILD = """
import json, sys
print(json.dumps({"ready": True}), flush=True)
print(json.dumps({"called": True}), flush=True)
print(json.dumps({"called": "all"}), flush=True)
print(json.dumps({"called": 7}), flush=True)
for line in sys.stdin:
    if line.startswith("answer"):
        open(sys.argv[1], "a").write(line)
    print(json.dumps({"alive": True}), flush=True)
"""


def test_a_call_is_answered_with_what_has_come_of_it(tmp_path: Path) -> None:
    file = tmp_path / "answers"
    calls: list[None] = []

    async def stop_all() -> tuple[bool, str]:
        calls.append(None)
        return False, "a goal may act"

    async def main() -> None:
        stopper = Stopper((sys.executable, "-c", CHILD, str(file)), stop_all)
        await stopper.start()
        async with asyncio.timeout(30):
            while not file.exists() or not file.read_text().endswith("\n"):
                await asyncio.sleep(0.02)
        await stopper.close()

    asyncio.run(main())
    assert file.read_text() == 'answer 7 {"success": false, "message": "a goal may act"}\n'
    assert len(calls) == 1
