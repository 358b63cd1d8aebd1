"""GP502 and GP503: what a deadline and an energy limit find, and what their scenarios prove."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.analysis.context import Context
from gpsfsm.analysis.decide import decide
from gpsfsm.analysis.decisions import makespan
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.analysis.rules import rule
from gpsfsm.compile import compile_plan
from gpsfsm.model.event import Outcome
from gpsfsm.model.report import Facts, Frequency, Interval, Loaded, PlanReport, Report, Verdict
from gpsfsm.report import render
from tests.analysis.test_time import bindings_of, by_solver, libraries, takes
from tests.cases import many
from tests.oracle import C, P, par_any, plan, rec
from tests.oracle.capabilities import Described, Instance, World
from tests.oracle.clocks import end_of
from tests.strategies import plans
from tests.support import plan_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.model.finding import Finding
    from tests.oracle import Run


def findings(
    code: str, whole: P, library: Sequence[Described], *, consistent: bool = False, **limits: float
) -> list[Finding]:
    tree = plan_of(whole)
    bindings = bindings_of(tree, library)
    constraints = constraints_of(tree, consistent=consistent, bindings=bindings)
    options = AnalysisOptions(consistent=consistent, **limits)  # type: ignore[arg-type]
    decided = decide(compile_plan(tree, bindings=bindings), constraints, options)
    find = rule(code).find
    assert find is not None
    return list(find(Context(decided)))


@pytest.mark.parametrize("consistent", [False, True], ids=["free", "consistent"])
def test_a_deadline_that_is_missed_only_if_the_quick_unit_fails(consistent: bool) -> None:
    quick, slow = takes("d/A", 10), takes("d/B", 100)
    whole = plan(par_any("d/A", "d/B"), "d/C")
    library = [quick, slow, takes("d/C", 1)]
    (finding,) = findings("GP502", whole, library, consistent=consistent, deadline_s=50)
    assert "can take longer than the deadline of 50 s: 11 s to 101 s" in finding.message
    assert finding.scenario is not None
    # FAILED of A is what makes the plan wait for B
    assert finding.scenario.outcomes[:2] == (
        ("/Plan/Control[1]/Runner[1]", Outcome.FAILED),
        ("/Plan/Control[1]/Runner[2]", Outcome.SUCCEEDED),
    )
    assert finding.scenario.story[-1] == "the plan completes after up to 101 s"
    assert not findings("GP502", whole, library, consistent=consistent, deadline_s=101)
    assert not findings("GP502", whole, library, consistent=consistent)


def test_a_deadline_that_is_always_missed() -> None:
    (finding,) = findings("GP502", plan("d/A"), [takes("d/A", 10, 12)], deadline_s=5)
    assert "every run of this plan takes longer" in finding.message
    assert "10 s to 12 s" in finding.message


def test_a_deadline_that_nothing_guarantees() -> None:
    (finding,) = findings("GP502", plan("d/A", "d/X"), [takes("d/A", 1)], deadline_s=5)
    assert "takes at least 1 s" in finding.message
    assert finding.message.endswith("X at line 3")
    assert finding.scenario is not None
    assert finding.scenario.story[-1] == (
        "the plan completes, but nothing limits how long that takes"
    )
    (finding,) = findings("GP502", plan("d/X"), [], deadline_s=5)
    assert finding.message.startswith(
        "nothing guarantees the deadline of 5 s: no capability file declares"
    )
    assert finding.scenario is None


def test_amounts_that_no_float_could_add() -> None:
    vast = [takes("d/A", 1, 1e308), takes("d/B", 1, 1e308)]
    (late,) = findings("GP502", plan("d/A", "d/B"), vast, deadline_s=5)
    assert late.message.endswith("a maximum duration for A at line 2 and B at line 3")
    assert late.hint.startswith("declare a maximum duration for these runners")
    (greedy,) = findings("GP503", plan("d/A", "d/B"), vast, energy_limit_j=5)
    assert greedy.message.endswith("a maximum energy for A at line 2 and B at line 3")
    assert greedy.hint
    never = [takes("d/A", 1e308, sure=True), takes("d/B", 1e308, sure=True)]
    (late,) = findings("GP502", plan("d/A", "d/B"), never, deadline_s=5)
    assert late.message.endswith("longer than the deadline of 5 s: at least 2e+12 s")
    much = [takes("d/A", 1, 9e11), takes("d/B", 1, 9e11)]
    (late,) = findings("GP502", plan("d/A", "d/B"), much, deadline_s=5)
    assert late.message.endswith(": 1 s to 1.8e+12 s")


def test_a_run_that_just_keeps_the_limit_is_not_the_one_shown() -> None:
    # without a failure it is 10 s and 10 J exactly
    whole, library = plan("d/A", rec("d/B")), [takes("d/A", 10), takes("d/B", 10)]
    (late,) = findings("GP502", whole, library, deadline_s=10)
    (greedy,) = findings("GP503", whole, library, energy_limit_j=10)
    for expected, end in ((late, "after up to 20 s"), (greedy, "takes up to 20 J")):
        assert expected.scenario is not None
        assert expected.scenario.outcomes[0] == ("/Plan/Runner[1]", Outcome.FAILED)
        assert expected.scenario.story[-1].endswith(end)


def test_large_plans_get_no_scenario_where_only_z3_finds_one() -> None:
    # two equal actions, which come out alike
    whole, library = plan("d/A", rec("d/B"), "d/A"), [takes("d/A", 10), takes("d/B", 10)]
    for code, limit in (("GP502", "deadline_s"), ("GP503", "energy_limit_j")):
        (finding,) = findings(
            code, whole, library, consistent=True, second_opinion=3, **{limit: 15}
        )
        assert finding.scenario is not None
        (finding,) = findings(
            code, whole, library, consistent=True, second_opinion=2, **{limit: 15}
        )
        assert finding.scenario is None


def test_no_run_that_ends_keeps_no_deadline() -> None:
    hanging = Described(
        "d/A", duration=(1, 2), may_hang=True, never_fails=True, never_succeeds=True
    )
    assert by_solver(makespan, plan("d/A"), [hanging]) is None
    (only,) = findings("GP502", plan("d/A"), [hanging], deadline_s=5)
    assert only.message == "no run of this plan ends, so none meets the deadline of 5 s"


def test_a_plan_without_time_keeps_every_deadline() -> None:
    assert not findings("GP502", plan(par_any(C("sequential"), "d/X")), [], deadline_s=0)


def test_an_energy_limit_counts_what_is_left_behind() -> None:
    whole = plan(par_any("d/A", "d/B"), "d/C")
    library = [takes("d/A", 10), takes("d/B", 20), takes("d/C", 5)]
    (finding,) = findings("GP503", whole, library, energy_limit_j=32)
    assert "can take more energy than the limit of 32 J: 30 J to 35 J" in finding.message
    assert finding.scenario is not None
    assert finding.scenario.story[-1] == "this run takes up to 35 J"
    assert not findings("GP503", whole, library, energy_limit_j=35)
    (finding,) = findings("GP503", whole, library, energy_limit_j=29)
    assert "every run of this plan takes more energy" in finding.message
    (finding,) = findings("GP503", plan("d/A"), [takes("d/A", 1, None)], energy_limit_j=29)
    assert "no capability file declares a maximum energy for A at line 2" in finding.message
    (finding,) = findings("GP503", plan("d/X"), [], energy_limit_j=29)
    assert "no capability file declares how much energy" in finding.message
    assert not findings("GP503", plan(), [], energy_limit_j=0)


def test_an_energy_that_was_not_decided_is_not_said_to_be_undeclared() -> None:
    """B is never triggered, but A is, and a capability tells what it takes."""
    tree = plan_of(plan(rec("d/B"), "d/A"))
    bindings = bindings_of(tree, [takes("d/A", 10), takes("d/B", 20)])
    constraints = constraints_of(tree, bindings=bindings)
    options = AnalysisOptions(energy_limit_j=5)
    decision = decide(compile_plan(tree, bindings=bindings), constraints, options)
    unknown = replace(decision, answers={**decision.answers, "energy": None})
    find = rule("GP503").find
    assert find is not None
    assert [each.rule for each in find(Context(decision))] == ["GP503"]
    assert not list(find(Context(unknown)))


@settings(max_examples=many(100))
@given(
    whole=plans(min_runners=1, max_runners=6),
    library=libraries(),
    consistent=st.booleans(),
    limit=st.sampled_from([0.5, 2.5, 6.0, 15.0, 30.0]),
)
def test_the_decisions_that_are_shown_are_enough(
    whole: P, library: list[Described], consistent: bool, limit: float
) -> None:
    library = [replace(described, may_hang=False) for described in library]  # to hang is no event
    world = World(whole, library, consistent=consistent)

    def most(instance: Instance, run: Run) -> float:
        return instance.bounds(instance.described.duration if instance.described else None)[1]

    def taken(run: Run) -> float:
        return sum(
            one.bounds(one.described.energy)[1]
            for one in world.instances
            if one.described and one.described.energy and run.fired & one.node.trigger
        )

    late = findings("GP502", whole, library, consistent=consistent, deadline_s=limit)
    greedy = findings("GP503", whole, library, consistent=consistent, energy_limit_j=limit)
    for expected, amount in (
        *((each, lambda run: end_of(world, run, most)) for each in late),
        *((each, taken) for each in greedy),
    ):
        if expected.scenario is None:
            assert "nothing guarantees" in expected.message
            continue
        shown = dict(expected.scenario.outcomes)
        runs = [
            run
            for run in world.runs
            if all(run.scenario[path] == outcome for path, outcome in shown.items())
        ]
        assert runs
        assert all(amount(run) > limit for run in runs)


def test_a_report_tells_time_and_energy() -> None:
    facts = Facts(
        runners=1,
        completes=Frequency.ALWAYS,
        gives_up=Frequency.NEVER,
        stuck=Frequency.NEVER,
        makespan=Interval(0.5, 70.0),
        energy=Interval(3.0, None),
        loaded=Loaded(None, 2),
    )
    report = Report((PlanReport("p.xml", Verdict.ACCEPTED, facts, ()),))
    assert "; takes 0.5 s to 70 s; energy: at least 3 J" in render(report, "text")
    (written,) = json.loads(render(report, "json"))["plans"]
    assert written["facts"]["makespan"] == {"min": 0.5, "max": 70.0}
    assert written["facts"]["energy"] == {"min": 3.0, "max": None}
    assert written["facts"]["loaded"] == {"peak": None, "all": 2}
