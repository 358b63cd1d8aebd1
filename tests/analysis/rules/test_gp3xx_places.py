"""GP301 to GP311: where a finding stands, what it names, and when it is another rule's."""

from __future__ import annotations

import pytest

from tests.analysis.rules.support import control, findings, messages, runner

A, B, C = (runner("arm/Move", f'to="{name}"') for name in "abc")
NOTHING = control("sequential")


def shown(code: str, *steps: str) -> list[tuple[int, str]]:
    return [(line, message) for line, _, message, _ in messages(code, *steps)]


def test_a_recovery_of_what_cannot_fail_is_no_runner_cut_off() -> None:
    steps = (A, control("recovery", B))
    assumed = ("line 2 never fails",)
    assert [each.location.line for each in findings("GP308", *steps, assumptions=assumed)] == [3]
    assert findings("GP301", *steps, assumptions=assumed) == []


def test_a_recovery_without_runners_needs_no_more_words_than_that_it_is_empty() -> None:
    assert (
        findings("GP308", A, control("recovery", NOTHING), assumptions=("line 2 never fails",))
        == []
    )
    assert shown("GP307", control("recovery", NOTHING), A) == []
    assert shown("GP307", control("recovery"), A) == []


def test_all_that_never_runs_is_counted() -> None:
    lead = "this recovery has no step before it to recover from, so "
    (one,) = shown("GP307", control("recovery", A))
    idle = "; the plan has no other steps, so it completes without doing anything"
    assert one == (2, f"{lead}Move (to=a) at line 3 never runs{idle}")
    (two,) = shown("GP307", control("recovery", A, B))
    assert two == (2, f"{lead}Move (to=a) at line 3 and Move (to=b) at line 4 never run{idle}")


@pytest.mark.parametrize(
    ("name", "sign"),
    [
        ("go_to_1_3", True),  # nothing but the goal
        ("go_to_1_3_and_7", True),
        ("go_to_1", False),
        ("go_to_1_3_from_0_0", False),  # what it guards as well
        ("go_from_0_0", False),
    ],
)
def test_a_recovery_is_named_after_its_goal(name: str, sign: bool) -> None:
    goal, other = (runner("arm/Move", f'x="{x}" y="3.0"') for x in ("1.0", "2.0"))
    before = runner("arm/Move", 'x="0.0" y="0.0"')
    named = control("recovery", goal, other).replace("<Control", f'<Control name="{name}"', 1)
    assert [line for line, _ in shown("GP310", before, named)] == [4] * sign


def test_a_recovery_named_after_exactly_what_it_guards_says_nothing_of_a_goal() -> None:
    before = runner("arm/Move", 'x="1.0" y="3.0" z="5.0"')
    goal, other = (runner("arm/Move", f'x="{x}" y="3.0"') for x in ("1.0", "2.0"))
    named = control("recovery", goal, other).replace("<Control", '<Control name="at_1_3_5"', 1)
    assert shown("GP310", before, named) == []


def test_orphans_are_told_at_the_block_that_has_something_to_leave_behind() -> None:
    alone = control("parallel_any", A)
    ((line, _),) = shown("GP311", control("parallel_any", alone, B))
    assert line == 2
    ((line, _),) = shown("GP311", control("parallel_any", B, control("parallel_all", alone, C)))
    assert line == 2


@pytest.mark.parametrize(("number", "said"), [(1, "a defect"), (2, "2 defects"), (4, "4 defects")])
def test_defects_of_capability_files_are_counted(number: int, said: str) -> None:
    defects = [f"robot.yaml:{line}:1: no" for line in range(1, number + 1)]
    (finding,) = findings("GP211", A, defects=defects)
    more = "; and 1 more" if number == 4 else ""
    assert finding.message == f"the capability files have {said}: {'; '.join(defects[:3])}{more}"
    assert (finding.location.line, finding.location.column, finding.length) == (1, 1, 1)
