"""The oracle on plans whose facts were worked out by hand."""

from __future__ import annotations

from typing import Any

import pytest

from tests.oracle import (
    COMPLETION,
    P,
    R,
    facts,
    par_all,
    par_any,
    plan,
    rec,
    seq,
)
from tests.oracle.support import C1, C2, PLAIN, R1, R2, SOMETIMES, fails

HAND_COMPUTED: dict[str, tuple[P, dict[str, Any]]] = {
    "nothing": (plan(), {"runners": 0}),
    "one runner": (
        plan("A"),
        {"runners": 1, **SOMETIMES, "dangling": fails(R1), "fewest_failures_to_give_up": 1},
    ),
    "guarded runner": (
        plan("A", rec("B")),
        {
            "runners": 2,
            **SOMETIMES,
            "dangling": fails(f"{C1}/Runner[1]"),
            "fewest_failures_to_give_up": 2,
        },
    ),
    "recovery by nothing: the failure completes": (plan("A", rec(seq())), {"runners": 1}),
    "empty recovery changes nothing": (
        plan("A", rec()),
        {"runners": 1, **SOMETIMES, "dangling": fails(R1), "fewest_failures_to_give_up": 1},
    ),
    "two recoveries in a row guard one after the other": (
        plan("A", rec("B", "C"), rec("D"), "E"),
        {
            "runners": 5,
            **SOMETIMES,
            "dangling": fails(f"{C2}/Runner[1]", R2),
            "fewest_failures_to_give_up": 1,
        },
    ),
    "recovery of a recovery's runner": (
        plan("A", rec("B", rec("C"))),
        {
            "runners": 3,
            **SOMETIMES,
            "dangling": fails(f"{C1}/Control[1]/Runner[1]"),
            "fewest_failures_to_give_up": 3,
        },
    ),
    "leading recoveries never run": (
        plan(rec("A"), rec("B", par_all("C", "D")), "E"),
        {
            "runners": 5,
            **SOMETIMES,
            "unreachable": [
                f"{C1}/Runner[1]",
                f"{C2}/Runner[1]",
                f"{C2}/Control[1]/Runner[1]",
                f"{C2}/Control[1]/Runner[2]",
            ],
            "dangling": fails(R1),
            "fewest_failures_to_give_up": 1,
        },
    ),
    "only a leading recovery": (
        plan(rec("A")),
        {"runners": 1, "unreachable": [f"{C1}/Runner[1]"]},
    ),
    "recovery of what cannot fail": (
        plan(seq(), rec("A"), "B", rec(seq()), rec("C")),
        {"runners": 3, "unreachable": [f"{C2}/Runner[1]", "/Plan/Control[4]/Runner[1]"]},
    ),
    "unguarded parallel_all deadlocks": (
        plan(par_all("A", "B"), "C"),
        {
            "runners": 3,
            **SOMETIMES,
            "dangling": fails(f"{C1}/Runner[1]", f"{C1}/Runner[2]", R1),
            "join_deadlocks": [{"control": C1, "effect": "give_up"}],
            "fewest_failures_to_give_up": 1,
        },
    ),
    "guarded parallel_all escalates, and its other units run on": (
        plan(par_all("A", "B"), rec("C")),
        {
            "runners": 3,
            **SOMETIMES,
            "dangling": fails(f"{C2}/Runner[1]"),
            "join_deadlocks": [{"control": C1, "effect": "escalated"}],
            "orphans": [f"{C1}/Runner[1]", f"{C1}/Runner[2]"],
            "fewest_failures_to_give_up": 2,
        },
    ),
    "parallel_all recovered by nothing absorbs": (
        plan(par_all("A", "B"), rec(seq())),
        {
            "runners": 2,
            "join_deadlocks": [{"control": C1, "effect": "absorbed"}],
            "orphans": [f"{C1}/Runner[1]", f"{C1}/Runner[2]"],
        },
    ),
    "parallel_all inside parallel_any: other units may save it": (
        plan(par_any(par_all("A", "B"), "C")),
        {
            "runners": 3,
            **SOMETIMES,
            "dangling": fails(
                f"{C1}/Control[1]/Runner[1]", f"{C1}/Control[1]/Runner[2]", f"{C1}/Runner[1]"
            ),
            "join_deadlocks": [{"control": f"{C1}/Control[1]", "effect": "give_up"}],
            "orphans": [
                f"{C1}/Control[1]/Runner[1]",
                f"{C1}/Control[1]/Runner[2]",
                f"{C1}/Runner[1]",
            ],
            "fewest_failures_to_give_up": 2,
        },
    ),
    "parallel_any over an empty control completes at once": (
        # The sequence's second runner starts after completion, so it is no orphan.
        plan(par_any(seq(), seq("A", "B"))),
        {
            "runners": 2,
            "dangling": fails(
                f"{C1}/Control[2]/Runner[1]", f"{C1}/Control[2]/Runner[2]", effect="dont_care"
            ),
            "orphans": [f"{C1}/Control[2]/Runner[1]"],
        },
    ),
    "started at the very instant of completion": (
        plan("A", rec(par_any(seq(), "B"))),
        {
            "runners": 2,
            "dangling": fails(f"{C1}/Control[1]/Runner[1]", effect="dont_care"),
            "orphans": [f"{C1}/Control[1]/Runner[1]"],
        },
    ),
    "parallels of one unit are that unit": (
        plan(par_all("A"), par_any(rec("B"), "C", rec("D"))),
        {
            "runners": 4,
            **SOMETIMES,
            "unreachable": [f"{C2}/Control[1]/Runner[1]"],
            "dangling": fails(f"{C1}/Runner[1]", f"{C2}/Control[2]/Runner[1]"),
            "fewest_failures_to_give_up": 1,
        },
    ),
    "parallel_any with a unit that cannot fail never fails": (
        plan(par_any("A", seq("B", rec(seq()))), rec("C")),
        {
            "runners": 3,
            # FAILED of A is connected, through a join that never fires, to C.
            "unreachable": [f"{C2}/Runner[1]"],
            "orphans": [f"{C1}/Runner[1]", f"{C1}/Control[1]/Runner[1]"],
        },
    ),
    "completion runner": (
        plan(R(COMPLETION), "A", R(COMPLETION)),
        {"runners": 2, **SOMETIMES, "dangling": fails(R1, R2), "fewest_failures_to_give_up": 1},
    ),
}


@pytest.mark.parametrize("case", HAND_COMPUTED)
def test_facts(case: str) -> None:
    whole, differences = HAND_COMPUTED[case]
    assert facts(whole) == {**PLAIN, **differences}
