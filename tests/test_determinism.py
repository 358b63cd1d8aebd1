"""The same bytes for the same plan: in every process, whatever the hash seed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

REPO = Path(__file__).parents[1]
PLANS = sorted(str(path.relative_to(REPO)) for path in (REPO / "corpus" / "plans").glob("*.xml"))


@pytest.mark.parametrize("options", [[], ["--consistent", "--faults", "hang,no-start"]], ids=str)
def test_the_same_bytes_under_different_hash_seeds(options: list[str]) -> None:
    runs = [
        subprocess.run(
            [sys.executable, "-m", "gpsfsm", "check", *PLANS, "--format", "json", *options],
            cwd=REPO,
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            check=False,
        )
        for seed in ("0", "1", "4242")
    ]
    assert {run.returncode for run in runs} == {1}
    assert len({run.stdout for run in runs}) == 1
    assert b'"ends"' in runs[0].stdout  # with scenarios
