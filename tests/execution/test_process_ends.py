"""A process ends, whatever its runners do."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
STUBBORN = """
from tests.execution.realtiming import Diary, plan, play

async def stubborn(context):
    while True:
        try:
            await context.sleep(0.01)
        except BaseException:
            pass

async def short(context):
    await context.sleep(0.05)

sink, driver = play(
    plan("A", "B", control="parallel_any"), Diary(A=stubborn, B=short), grace_s=0.1
)
print(driver.kernel.status.value)
"""


def test_a_runner_that_never_stops_does_not_keep_the_process_alive() -> None:
    done = subprocess.run(
        [sys.executable, "-c", STUBBORN],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )
    assert (done.returncode, done.stdout) == (0, "COMPLETED\n"), done.stderr
