"""Nothing is dropped in silence: foreign elements, attributes and keys are reported or refused."""

from __future__ import annotations

import random
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from gpsfsm.compile.machine_files import automaton_to_graphml
from gpsfsm.compile.plan_text import read_plan_or_machine
from gpsfsm.compile.units import MachinePlan
from tests.cases import many
from tests.compile.formats.foreign import inserted

if TYPE_CHECKING:
    from gpsfsm.syntax import Parsed

ROOT = Path(__file__).parents[3]
CASES = Path(__file__).parent / "cases"
DOOR = (ROOT / "docs" / "examples" / "door.json").read_text()


def read(text: str) -> Parsed:
    return read_plan_or_machine(text, file="x")


def said(parsed: Parsed) -> int:
    assert isinstance(parsed.plan, MachinePlan)
    return len(parsed.plan.approximations)


def door_graphml() -> str:
    plan = read(DOOR).plan
    assert plan is not None
    return automaton_to_graphml(plan.automaton)


@pytest.mark.parametrize(
    "text",
    [
        (ROOT / "corpus" / "machines" / "delivery.yasmin.xml").read_text(),
        *(
            (CASES / f"yasmin_{name}.xml").read_text()
            for name in ("orthogonal", "implicit_outcome")
        ),
        *(path.read_text() for path in sorted(CASES.glob("langgraph_*.json"))),
        DOOR,
        door_graphml(),
    ],
    ids=["delivery", "orthogonal", "implicit", "fanout", "untyped", "json", "graphml"],
)
def test_what_is_foreign_is_reported_or_refused(text: str) -> None:
    before = read(text)
    assert before.plan is not None
    for seed in range(many(60)):
        changed = inserted(text, random.Random(seed))  # noqa: S311
        after = read(changed)
        assert after.problems or said(after) > said(before), changed
        assert (after.plan is None) == bool(after.problems)
