"""The oracle under scenario options, one scenario at a time, and its helpers."""

from __future__ import annotations

import pytest

from tests.oracle import (
    FAILED,
    HANG,
    NO_START,
    SUCCEEDED,
    Both,
    Constraint,
    Implies,
    Not,
    P,
    R,
    Run,
    Says,
    System,
    action_key,
    canonical_scenario,
    compile_plan,
    facts,
    holds_for_all_fillings,
    par_all,
    par_any,
    plan,
    rec,
    runner_paths,
    seq,
    to_xml,
)
from tests.oracle.support import C1, PLAIN, R1, R2, SOMETIMES, fails

HANGS = frozenset({"hang"})
NO_STARTS = frozenset({"no-start"})


def fewest(whole: P, constraint: Constraint | None = None, *, consistent: bool = False) -> object:
    answer = facts(whole, constraint=constraint, consistent=consistent)
    assert answer is not None
    return answer["fewest_failures_to_give_up"]


def test_hang_gets_a_plan_stuck() -> None:
    assert facts(plan(par_all("A", "B")), faults=HANGS) == {
        **PLAIN,
        **SOMETIMES,
        "runners": 2,
        "stuck": "sometimes",
        "dangling": fails(f"{C1}/Runner[1]", f"{C1}/Runner[2]"),
        "join_deadlocks": [{"control": C1, "effect": "stuck"}],
        "fewest_failures_to_give_up": 1,
    }


def test_a_hanging_unit_is_an_orphan() -> None:
    hangs = Says(f"{C1}/Runner[1]", "hangs")
    answer = facts(plan(par_any("A", "B"), "C"), faults=HANGS, constraint=hangs)
    assert answer is not None
    assert answer["orphans"] == [f"{C1}/Runner[1]"]  # B has to come before C
    assert answer["gives_up"] == "sometimes"  # by C
    assert answer["stuck"] == "sometimes"  # A hangs, so the join of the failures waits
    # B's failure alone makes nothing give up, since A hangs; C's does.
    assert answer["dangling"] == [
        *fails(f"{C1}/Runner[1]", f"{C1}/Runner[2]", effect="dont_care"),
        *fails(R1),
    ]


def test_without_start_the_next_unit_is_not_triggered() -> None:
    whole = plan(par_any("A", seq(seq(), "B"), "C"))
    a, c = f"{C1}/Runner[1]", f"{C1}/Runner[2]"
    b = f"{C1}/Control[1]/Runner[1]"
    system = System(whole, NO_STARTS)
    run = system.run((NO_START, SUCCEEDED, SUCCEEDED))  # in document order: a, b, c
    assert [run.triggers(path) for path in (a, b, c)] == [True, False, False]
    assert run.emits_failed(a)
    assert run.ends == "STUCK"
    run = system.run((FAILED, NO_START, SUCCEEDED))
    assert [run.triggers(path) for path in (a, b, c)] == [True, True, False]
    answer = facts(whole, faults=NO_STARTS)
    assert answer is not None
    assert (answer["completes"], answer["gives_up"], answer["stuck"]) == ("sometimes",) * 3
    assert answer["orphans"] == [a, b, c]


def test_a_unit_without_runner_passes_its_trigger_on() -> None:
    whole = plan(par_all(seq(), rec("R"), "A", "B"))
    graph = compile_plan(whole, no_start=True)
    recovery, first, second = graph.runners
    assert recovery.trigger == 0
    assert first.trigger == graph.start
    assert second.trigger == first.started


def test_no_start_without_parallels_is_like_failed() -> None:
    whole = plan("A", rec("B"), "C")
    assert facts(whole) == facts(whole, faults=NO_STARTS)


def test_no_start_makes_a_join_wait_stuck_inside_parallel_any() -> None:
    whole = plan(par_any(par_all("A", "B"), "C"))
    answer = facts(whole, faults=NO_STARTS)
    assert answer is not None
    assert answer["join_deadlocks"] == [{"control": f"{C1}/Control[1]", "effect": "stuck"}]


def test_equal_actions_have_equal_outcomes() -> None:
    same = plan("Go x=1", rec(R("Go x=1.0", label="again", provider="other/One")))
    free, bound = facts(same), facts(same, consistent=True)
    assert free is not None
    assert bound is not None
    assert free["fewest_failures_to_give_up"] == bound["fewest_failures_to_give_up"] == 2
    retry = plan("Go x=1", rec("Go x=1.0", "Say"), "Go x=true")
    no_help = Says(f"{C1}/Runner[2]", "fails")
    answer = facts(retry, consistent=True, constraint=no_help)
    assert answer is not None
    # Under consistency the retry never helps: whoever reaches the end needed no recovery.
    assert answer["fewest_failures_to_give_up"] == 1
    assert (
        canonical_scenario(
            retry,
            lambda run: run.completed and run.triggers(f"{C1}/Runner[1]"),
            consistent=True,
            constraint=no_help,
        )
        is None
    )


@pytest.mark.parametrize(
    ("whole", "wanted"),
    [
        (plan(par_all("Go", "Go")), 1),  # the other one fails later
        (plan(par_any("Go", "Go")), 2),
        (plan(par_all("Go", "Go"), rec("Say")), 2),  # so it does here, or while Say is active
        (plan(par_all("Go", "Go"), rec("Go")), 2),  # Go, Go of the recovery; the third comes later
        (plan(par_all(par_any("Go", "Go", "Go"), "Go")), 1),
        (plan(par_all(seq("Say", "Go"), par_any("Go", "Go"))), 1),
        (plan("Go", rec("Say"), "Go"), 2),  # Go and Say, or Go twice
    ],
)
def test_a_failure_that_comes_after_the_give_up_does_not_count(whole: P, wanted: int) -> None:
    assert fewest(whole, consistent=True) == wanted


def test_failures_that_assumptions_bring_about_may_come_later() -> None:
    a, b, c = (f"{C1}/Runner[{number}]" for number in (1, 2, 3))
    whole = plan(par_all("A", "B", "C"))
    tied = Both(
        Implies(Says(a, "fails"), Says(b, "fails")), Implies(Says(b, "fails"), Says(c, "fails"))
    )
    assert fewest(whole, tied) == 1
    hopeless = Both(Says(a, "fails"), Says(b, "fails"))
    assert fewest(plan(par_all("A", "B")), hopeless) == 1
    assert fewest(plan(par_any("A", "B")), hopeless) == 2


@pytest.mark.parametrize(
    ("left", "right", "equal"),
    [
        ("Go x=1", "Go x=1.0", True),
        ("Go x=1 y=a", "Go y=a x=1", True),
        ("Go x=1", "Go x=true", False),
        ("Go x=0", "Go x=false", False),
        ("Go x=true", "Go x=true", True),
        ("Go x=1", "Go x=2", False),
        ("Go x=1", "Go y=1", False),
        ("Go x=1", "Go", False),
        ("Go", "Say", False),
        ("Go x=a", "Go x=b", False),
    ],
)
def test_equality_of_actions(left: str, right: str, equal: bool) -> None:
    one, other = R(left, "a", "1", "p/P"), R(right, "b", "2", "q/Q")
    assert (action_key(one) == action_key(other)) is equal


def test_constraints() -> None:
    whole = plan("A", "B")
    never = Says(R1, "succeeds")
    answer = facts(whole, constraint=never)
    assert answer is not None
    assert answer["dangling"] == [*fails(R1, effect="dont_care"), *fails(R2)]
    both = Implies(never, Not(Says(R2, "fails")))
    assert str(both) == ("(/Plan/Runner[1] succeeds) implies (not (/Plan/Runner[2] fails))")
    # A flipped outcome is not checked against the constraint again: with A succeeding B would
    # have to succeed, yet the second scenario keeps that B fails, and gives up all the same.
    only = facts(whole, constraint=lambda s: s[R1] == FAILED and s[R2] == FAILED)
    assert only is not None
    assert only["dangling"] == fails(R1, effect="dont_care")
    assert only["unreachable"] == [R2]
    assert facts(whole, constraint=lambda scenario: False) is None


def test_a_mended_unit_need_not_save_the_plan() -> None:
    # C always fails: mending the block only moves the give-up from the block to C.
    whole = plan(par_all("A", "B"), "C")
    answer = facts(whole, constraint=Says(R1, "fails"))
    assert answer is not None
    assert answer["join_deadlocks"] == [{"control": C1, "effect": "absorbed"}]
    assert answer["completes"] == "never"


def test_all_failing_units_are_mended_together() -> None:
    a, b = f"{C1}/Runner[1]", f"{C1}/Control[1]/Runner[1]"
    whole = plan(par_all("A", seq("B", "C")))
    answer = facts(whole, constraint=lambda s: s[a] == s[b] == FAILED)
    assert answer is not None
    assert answer["join_deadlocks"] == [{"control": C1, "effect": "give_up"}]
    # One flip alone saves nothing.
    assert answer["dangling"] == fails(a, b, effect="dont_care")


def test_canonical_scenario() -> None:
    whole = plan(par_any("A", "B"), "C", rec("D"))
    scenario = canonical_scenario(whole, lambda run: run.gave_up)
    assert scenario is not None
    assert list(scenario.scenario.values()) == [FAILED, FAILED, SUCCEEDED, SUCCEEDED]
    assert scenario.ends == "GAVE_UP"
    # Untriggered instances count too, so nothing fails that need not.
    scenario = canonical_scenario(whole, lambda run: run.gave_up and run.triggers(R1))
    assert scenario is not None
    assert list(scenario.scenario.values()) == [SUCCEEDED, SUCCEEDED, FAILED, FAILED]
    # Hanging alone gets it stuck; failing first comes before hanging first.
    scenario = canonical_scenario(whole, lambda run: run.stuck, faults=HANGS)
    assert scenario is not None
    assert scenario.outcomes == (SUCCEEDED, SUCCEEDED, HANG, SUCCEEDED)
    stopped = canonical_scenario(
        whole, lambda run: run.stuck and not run.triggers(R1), faults=HANGS
    )
    assert stopped is not None
    assert stopped.outcomes == (FAILED, HANG, SUCCEEDED, SUCCEEDED)
    assert canonical_scenario(whole, lambda run: run.stuck) is None


def test_holds_for_all_fillings() -> None:
    whole = plan("A", rec("B"), "C")
    fallback = f"{C1}/Runner[1]"

    def gives_up(run: Run) -> bool:
        return run.gave_up

    assert holds_for_all_fillings(whole, {R2: FAILED}, gives_up)
    assert not holds_for_all_fillings(whole, {R1: FAILED}, gives_up)
    assert holds_for_all_fillings(whole, {R1: FAILED, fallback: FAILED}, gives_up)
    assert not holds_for_all_fillings(whole, {R2: FAILED}, gives_up, faults=HANGS)
    assert not holds_for_all_fillings(whole, {}, gives_up)
    never = Says(R2, "succeeds")
    assert not holds_for_all_fillings(whole, {R2: FAILED}, gives_up, constraint=never)
    with pytest.raises(ValueError, match="no such"):
        holds_for_all_fillings(whole, {"/Plan": FAILED}, gives_up)


def test_orphans_of_one_scenario() -> None:
    whole = plan(par_any("A", "B", "C"))
    run = System(whole).run((SUCCEEDED, FAILED, SUCCEEDED))
    a, b, c = (f"{C1}/Runner[{n}]" for n in (1, 2, 3))
    assert run.orphans() == {a, b, c}
    assert run.orphans(frozenset({a})) == {a}
    assert run.orphans(frozenset()) == frozenset()
    assert System(whole).run((SUCCEEDED, FAILED, FAILED)).orphans() == {b, c}
    assert System(whole).run((FAILED, FAILED, FAILED)).orphans() == frozenset()


def test_before_it_fails_an_instance_without_start_triggers_nothing() -> None:
    whole = plan(par_any(seq("A", rec("C")), "B"))
    run = System(whole, NO_STARTS).run((NO_START, SUCCEEDED, SUCCEEDED))  # A, C, B
    assert run.ends == "COMPLETED"
    assert run.orphans() == frozenset()  # B is never triggered, and C has to come
    late = System(whole, NO_STARTS).run((FAILED, SUCCEEDED, SUCCEEDED))
    assert late.orphans() == set(runner_paths(whole))  # B first, or C first


def test_unknown_fault() -> None:
    with pytest.raises(ValueError, match="unknown faults"):
        facts(plan("A"), faults=frozenset({"hangs"}))


def test_xml() -> None:
    whole = plan(R("Go x=1", "a", "7", "p/P"), par_all(rec()))
    assert to_xml(whole) == (
        "<Plan>\n"
        '  <Runner interface="Go" provider="p/P" x="1" name="a" id="7"/>\n'
        '  <Control type="parallel_all">\n'
        '    <Control type="recovery"/>\n'
        "  </Control>\n"
        "</Plan>\n"
    )
