"""The plans of the corpus as machines: they have exactly the facts that they have as plans."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.analysis.constraints import constraints_of, constraints_under
from gpsfsm.analysis.decide import decide
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.checking.machine_check import decide_machine
from gpsfsm.compile import compile_plan
from gpsfsm.compile.machines import machine_of
from gpsfsm.syntax import parse
from tests.cases import many
from tests.strategies import constraints, plans
from tests.support import plan_of

if TYPE_CHECKING:
    from gpsfsm.model.plan import Plan
    from gpsfsm.model.report import Facts
    from tests import oracle

ROOT = Path(__file__).parents[3]
OWN = sorted((ROOT / "corpus").rglob("*.xml"))
SHARED = sorted((ROOT.parent / "shared" / "corpus").rglob("*.xml"))
OPTIONS = AnalysisOptions(max_scenarios=1)


def require_same(
    other: Facts, facts: Facts, machine: Plan, plan: Plan, *, dangling: bool = True
) -> None:
    """Compare all facts but those about joins, which mean more of a plan (semantics, 9.4).

    Without ``dangling``, the effects of dangling events are left out: what hangs may leave a
    machine stuck by another event, which a plan is not told.
    """
    paths = {
        machine.path(runner): plan.path(origin)
        for runner, origin in zip(machine.runners, plan.runners, strict=True)
    }
    assert other.completes is facts.completes
    assert other.gives_up is facts.gives_up
    assert other.stuck is facts.stuck
    assert tuple(paths[path] for path in other.unreachable) == facts.unreachable
    assert tuple(paths[path] for path in other.orphans) == facts.orphans
    assert other.fewest_failures_to_give_up == facts.fewest_failures_to_give_up
    events = [(paths[each.runner], each.event) for each in other.dangling]
    assert events == [(each.runner, each.event) for each in facts.dangling]
    if dangling:
        effects = [each.effect for each in other.dangling]
        assert effects == [each.effect for each in facts.dangling]


def require_same_facts(plan: Plan) -> bool:
    """Compare all facts but those about joins, which mean more of a plan (semantics, 9.4).

    False for a plan with a runner without an interface, which no machine has.
    """
    compiled = compile_plan(plan)
    automaton = compiled.automaton
    machine, _ = machine_of(automaton.graph)
    if machine is None:
        assert not all(runner.interface for runner in plan.runners)
        return False
    facts = decide(compiled, constraints_of(plan), OPTIONS).facts()
    decided = decide_machine(compile_plan(machine), constraints_of(machine), OPTIONS)
    assert facts is not None
    assert decided.facts is not None, decided.reason
    assert not decided.proof.unproved
    require_same(decided.facts, facts, machine, plan)
    return True


def compared(files: list[Path]) -> int:
    """The number of files that hold plans, after all of them were compared."""
    count = 0
    for file in files:
        plan = parse(file.read_bytes(), file=str(file)).plan
        if plan is not None:
            count += require_same_facts(plan)
    return count


def test_the_missions_have_the_same_facts() -> None:
    assert compared([file for file in OWN if "missions" in file.parts]) >= 10


@pytest.mark.campaign
def test_the_corpus_has_the_same_facts() -> None:
    assert compared(OWN) > 200


@pytest.mark.campaign
@pytest.mark.skipif(not SHARED, reason="there is no shared corpus here")
def test_the_shared_corpus_has_the_same_facts() -> None:
    assert compared(SHARED) > 300


@st.composite
def constrained_plans(draw: st.DrawFn) -> tuple[oracle.P, frozenset[str], bool, list[str]]:
    """A plan, fault models, whether equal actions have equal outcomes, and assumptions."""
    whole = draw(plans(min_runners=1, max_runners=5))
    faults = draw(st.sampled_from((frozenset(), frozenset({"hang"}))))
    assumed = draw(constraints(whole, faults=faults)) if draw(st.booleans()) else None
    return whole, faults, draw(st.booleans()), [] if assumed is None else [str(assumed)]


def of_machine(text: str, machine: Plan, plan: Plan) -> str:
    """An assumption about the runners of a plan, about those of its machine."""
    paths = {
        plan.path(origin): machine.path(runner).removeprefix("/machine/")
        for runner, origin in zip(machine.runners, plan.runners, strict=True)
    }
    return re.sub(r"/Plan[^\s)]*", lambda match: f'name "{paths[match[0]]}"', text)


@settings(max_examples=many(20))
@given(constrained_plans())
def test_what_ties_runners_together_means_the_same(
    case: tuple[oracle.P, frozenset[str], bool, list[str]],
) -> None:
    whole, faults, consistent, assumptions = case
    plan = plan_of(whole)
    limits = constraints_of(plan, faults=faults, consistent=consistent, assumptions=assumptions)
    compiled = compile_plan(plan)
    machine, problems = machine_of(compiled.automaton.graph)
    assert machine is not None, problems
    facts = decide(compiled, limits, OPTIONS).facts()
    options = replace(
        OPTIONS,
        faults=tuple(faults),
        consistent=consistent,
        assumptions=tuple(of_machine(text, machine, plan) for text in assumptions),
    )
    same = compile_plan(machine)
    limits = constraints_under(options, same)
    decided = decide_machine(same, limits, options)
    assert decided.contradictory is (facts is None)
    if facts is not None:
        assert decided.facts is not None
        require_same(decided.facts, facts, machine, plan, dangling=not faults)
