"""A process that is killed while it runs a plan loses nothing (docs/execution.md)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.execution.crashing import campaign, real_campaign

if TYPE_CHECKING:
    from pathlib import Path


def test_a_killed_run_is_resumed_as_if_nothing_had_happened(tmp_path: Path) -> None:
    # The long campaign is benchmarks/soak_crash.py.
    done = campaign(tmp_path, 10, seed=20)
    assert done.total == 10
    assert sum(count > 0 for count in done.kills.values()) >= 3, done.kills


def test_a_killed_run_in_real_time_acts_only_on_what_is_journaled_and_never_twice(
    tmp_path: Path,
) -> None:
    assert real_campaign(tmp_path, 6, seed=3) == 6
