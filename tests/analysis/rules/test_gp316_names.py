"""GP316: recoveries that are named after the step behind them; GP317: parallels of one unit."""

from __future__ import annotations

import pytest

from tests.analysis.rules.support import control, findings, runner

NAV = "nav2_capabilities/WaypointRunner"


def go(x: object, y: object) -> str:
    return runner(NAV, f'x="{x}" y="{y}"')


def misplaced(label: str, before: str, after: str, inside: str = go(0, 2)) -> bool:
    """True if the recovery of this name between two steps is told."""
    return bool(findings("GP316", before, control(f'recovery" name="{label}', inside), after))


@pytest.mark.parametrize(
    "label",
    [
        "recover_if_1_3_unreachable",
        "recover_1.0_3.0",
        "recover_1_0_3_0",
        "recover (1, 3)",
        "recover_x1_y3",
        "Recovery for 1 and 3",
    ],
)
def test_a_name_that_speaks_of_the_next_step(label: str) -> None:
    assert misplaced(label, go(2.0, -0.5), go(1.0, 3.0))
    assert not misplaced(label, go(1.0, 3.0), go(2.0, -0.5))
    assert not misplaced(label, go(2.0, -0.5), go(1.0, 3.0), inside=go(1, 3))


@pytest.mark.parametrize(
    ("label", "x", "y"),
    [
        ("recovery_-3_-1", -3.0, -1.0),
        ("recovery_for_minus3_minus1", -3.0, -1.0),
        ("recovery_-3_0_-1_0", -3.0, -1.0),
        ("recovery_2_-0.5", 2.0, -0.5),
        ("recovery_2_0_-0_5", 2, -0.5),
        ("recovery_neg_3_neg_1", -3, -1),
    ],
)
def test_signs_and_fractions(label: str, x: float, y: float) -> None:
    assert misplaced(label, go(7, 7), go(x, y))
    assert not misplaced(label, go(7, 7), go(-x, y))
    assert not misplaced(label, go(7, 7), go(x, -y))
    assert not misplaced(label, go(x, y), go(7, 7))


@pytest.mark.parametrize(
    "label",
    [
        "",
        "recovery_1",
        "recovery_3",
        "recover_11_3",
        "recover_1_35",
        "recover_1_3.5",
        "recover_1_3_5",
        "recover_-1_3",
        "recover_minus1_3",
        "recover_1_-3",
        "recover_3_1",
        "recovery_1_0_3_7",
    ],
)
def test_a_name_that_speaks_of_something_else(label: str) -> None:
    assert not misplaced(label, go(2.0, -0.5), go(1.0, 3.0))


def test_a_name_that_may_speak_of_its_own_step_is_left_alone() -> None:
    """``1-3`` is (1, 3) or (1, -3), and a sign is easily forgotten."""
    assert not misplaced("recover_1-3", go(1, -3), go(1, 3))
    assert not misplaced("recover_3_1", go(-3, -1), go(3, 1))


def test_the_name_of_a_control_counts_too() -> None:
    store = control('sequential" name="visit_store', go(1, 3), go(1, 4))
    assert misplaced("recovery_for_visit_store", go(2, 2), store)
    assert not misplaced("recovery_for_visit_storey", go(2, 2), store)
    vague = control('sequential" name="step_2', go(1, 3), go(1, 4))
    assert not misplaced("recovery_step_2", go(2, 2), vague)


def test_the_step_behind_may_stand_behind_the_control_around() -> None:
    recovery = control('recovery" name="recover_1_3', go(0, 2))
    block = control("sequential", go(2, 2), recovery)
    assert findings("GP316", block, go(1, 3))
    assert not findings("GP316", control("parallel_all", block, go(5, 5)), go(1, 3))
    nested = go(2, 2), recovery, control("recovery", go(4, 4)), go(1, 3)
    assert len(findings("GP316", *nested)) == 1


def test_parallels_of_one_unit() -> None:
    guarded = control("parallel_all", go(1, 3), control("recovery", go(0, 2)))
    assert len(findings("GP317", guarded)) == 1
    assert len(findings("GP317", control("parallel_any", control("sequential", go(1, 3))))) == 1
    assert not findings("GP317", control("parallel_any", go(1, 3), go(2, 2)))
    assert not findings("GP317", control("parallel_any"))
    assert not findings("GP317", control("sequential", go(1, 3)))
