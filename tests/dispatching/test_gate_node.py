"""The keeper of the gate: what it writes down about what it decides."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from gpsfsm.dispatching.gate_node import PlanKeeper, for_engine
from gpsfsm.errors import GpsfsmError
from gpsfsm.gating import Gate, GateOptions
from gpsfsm.syntax import Limits
from tests.dispatching.test_mirror import go, plan

if TYPE_CHECKING:
    from pathlib import Path

PLAN = plan(go(1))
OPTIONS = for_engine(GateOptions(), "fabric-v2")


def test_a_receipt_is_about_the_very_text(tmp_path: Path) -> None:
    file = tmp_path / "receipts.jsonl"
    short = replace(OPTIONS, check=replace(OPTIONS.check, limits=Limits(max_bytes=len(PLAN))))
    with Gate(short) as gate:
        keeper = PlanKeeper(gate, str(file))
        assert keeper.refused(PLAN, "submit") == ""
        assert "; the limit is 130 (--max-bytes)" in keeper.refused(f"{PLAN} ", "submit")
    rows = [json.loads(line) for line in file.read_text().splitlines()]
    assert [row["decision"] for row in rows] == ["accepted", "rejected"]
    texts = (PLAN, f"{PLAN} ")
    assert [row["digests"]["plan"] for row in rows] == [
        hashlib.sha256(text.encode()).hexdigest() for text in texts
    ]


def test_nothing_is_decided_that_cannot_be_written_down(tmp_path: Path) -> None:
    with Gate(OPTIONS) as gate, pytest.raises(GpsfsmError, match="cannot write"):
        PlanKeeper(gate, str(tmp_path)).refused(PLAN, "submit")
