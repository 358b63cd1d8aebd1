"""What an assumption means for a plan."""

from __future__ import annotations

import pytest

from gpsfsm.analysis.assumptions import holds, parse_assumption
from gpsfsm.analysis.assumptions.formula import Constant
from tests.analysis.assumptions.support import (
    MEANINGS,
    PLAN,
    Predicate,
    bind,
    plan_of,
    refusal,
    scenarios,
)


@pytest.mark.parametrize(("text", "meaning"), MEANINGS, ids=[text for text, _ in MEANINGS])
def test_meaning(text: str, meaning: Predicate) -> None:
    formula = bind(text)
    for scenario in scenarios(4):
        assert holds(formula, scenario) == meaning(scenario), scenario


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("never fails: Gripper*", True),
        ("all GripperRunner fail", True),
        ("any GripperRunner fails", False),
        ("at most 1 GripperRunner fails", True),
        ("at least 1 GripperRunner fails", False),
        ("GripperRunner fails", True),  # speaks of an instance that is not there: does not apply
        ("not GripperRunner fails", True),
        ("GripperRunner fails or not GripperRunner fails and any GripperRunner fails", True),
        ("same: GripperRunner", True),
    ],
)
def test_interfaces_that_match_nothing(text: str, value: bool) -> None:
    bound = parse_assumption(text).bind(PLAN)
    assert bound.formula == Constant(value)
    assert len(bound.unmatched) == 1
    assert bound.unmatched[0].startswith("Gripper")


def test_unmatched_is_empty_where_all_match() -> None:
    bound = parse_assumption("never fails: *").bind(PLAN)
    assert (bound.text, bound.unmatched) == ("never fails: *", ())


def test_the_empty_plan() -> None:
    empty = plan_of()
    assert bind("never fails: *", empty) == Constant(True)
    assert "line 9 contains no runner; the plan has no runner" in str(
        refusal("line 9 fails", empty)
    )
    assert "there is no runner inside /Plan" in str(refusal("all /Plan fail", empty))
