"""Fixed plans and what they were before: what is proved, and what the engine refuses."""

from __future__ import annotations

import pytest

from gpsfsm.checking import CheckOptions
from gpsfsm.fixing import Edit, Fix, Safety, Sameness, engine, fix_text, sameness
from gpsfsm.fixing.compare import keeps
from gpsfsm.fixing.fixer import Fixer
from tests.fixing.support import go, say

OPTIONS = CheckOptions()
NOTHING = "<Control type='sequential'/>"
PLAN = f"<Plan>{go(1, 2)}{say('here')}</Plan>"
DIRTY = f"<Plan speed='3'>{go(1, 2)}{say('here')}</Plan>"


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        (DIRTY, PLAN, Sameness.SAME),
        (PLAN, f"<Plan>{go(1.0, 2.0)}{NOTHING}{say('here')}</Plan>", "same"),
        (PLAN, f"<Plan>{go(1, 3)}{say('here')}</Plan>", Sameness.RENAMED),
        (PLAN, f"<Plan>{say('here')}{go(1, 2)}</Plan>", "renamed"),  # in the same places
        (PLAN, f"<Plan>{go(1, 2)}</Plan>", Sameness.DIFFERENT),
        (
            f"<Plan><Control type='parallel_all'>{go(1, 2)}{go(3, 4)}</Control></Plan>",
            f"<Plan>{go(1, 2)}{go(3, 4)}</Plan>",
            Sameness.DIFFERENT,
        ),
        # the same, but not of one form: what is seen ends at once
        (
            f"<Plan><Control type='parallel_any'>{NOTHING}{go(1, 2)}</Control></Plan>",
            f"<Plan><Control type='parallel_any'>{NOTHING}<Control type='sequential'>"
            f"{go(1, 2)}{say('x')}</Control></Control></Plan>",
            Sameness.SAME,
        ),
        ("<Plan", PLAN, None),
        (PLAN, "<Plan", None),
    ],
)
def test_sameness(before: str, after: str, expected: Sameness | None) -> None:
    assert sameness(before, after, OPTIONS) == expected


def test_a_fix_of_names_may_rename_and_no_other() -> None:
    other = f"<Plan>{go(1, 3)}{say('here')}</Plan>"
    assert keeps(PLAN, other, [Fix("GP205", "", 0, ())], OPTIONS)
    assert not keeps(PLAN, other, [Fix("GP112", "", 0, ())], OPTIONS)
    assert not keeps(PLAN, f"<Plan>{go(1, 2)}</Plan>", [Fix("GP205", "", 0, ())], OPTIONS)
    assert keeps("<Plan", PLAN, [Fix("GP112", "", 0, ())], OPTIONS)  # nobody knew what it did


@pytest.mark.parametrize("safety", Safety)
def test_a_safe_fix_that_changes_what_the_plan_does_is_refused(
    safety: Safety, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It takes a runner away beside the attribute that its finding is about."""
    end = DIRTY.index(">")
    runner = DIRTY.index(say("here"))
    edits = (Edit(5, end), Edit(runner, runner + len(say("here"))))
    fixer = Fixer("greedy", ("GP112",), lambda _: [Fix("GP112", "", 6, edits, safety)], "x", "x")
    monkeypatch.setattr(engine, "all_fixers", lambda: (fixer,))
    fixed = fix_text(DIRTY, OPTIONS, unsafe=True)
    assert bool(fixed.applied) is (safety is Safety.UNSAFE)
    expected = DIRTY if safety is Safety.SAFE else f"<Plan>{go(1, 2)}</Plan>"
    assert fixed.text == expected
