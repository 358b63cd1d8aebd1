"""Counterexamples: canonical, reduced without loss, and the same in both backends."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.analysis.context import Context
from gpsfsm.analysis.decisions.completion import give_up_claim
from gpsfsm.analysis.decisions.dangling import dangling_claim
from gpsfsm.analysis.decisions.joins import deadlock_claim
from gpsfsm.analysis.decisions.orphans import orphan_claim
from gpsfsm.analysis.decisions.stuck import stuck_claim
from gpsfsm.analysis.rules import all_rules
from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import Event
from tests import oracle
from tests.cases import many
from tests.strategies import constraints, faults, plans
from tests.support import decided

if TYPE_CHECKING:
    from gpsfsm.analysis.claims import Claim
    from gpsfsm.analysis.decide import Decided
    from gpsfsm.model.finding import Finding

Predicate = Callable[[oracle.Run], bool]


def claims_of(decision: Decided) -> Iterator[tuple[Claim, Predicate]]:
    """Every claim that the verdicts allow, and the same for the oracle."""
    automaton = decision.deciders.compiled.automaton
    plan = automaton.plan
    facts = decision.facts()
    assert facts is not None
    if facts.gives_up != "never":
        yield give_up_claim(), lambda run: run.gave_up
    if facts.stuck != "never":
        yield stuck_claim(), lambda run: run.stuck
    for event in decision.answers["dangling"]:
        if event.effect == "give_up":
            path = plan.path(plan.runners[event.runner])
            yield dangling_claim(automaton, event), _decisive(path)
    for deadlock in decision.answers["joins"]:
        path = plan.path(automaton.blocks[deadlock.block].element)
        yield deadlock_claim(automaton, deadlock), _waiting(path, deadlock.effect)
    for number in decision.answers["orphans"]:
        yield orphan_claim(None, number), _orphan(plan.path(plan.runners[number]))


def _decisive(path: str) -> Predicate:
    return lambda run: (
        run.emits_failed(path) and run.gave_up and not run.with_outcome(path, "SUCCEEDED").gave_up
    )


def _waiting(path: str, effect: str) -> Predicate:
    def holds(run: oracle.Run) -> bool:
        if not run.waits(path):
            return False
        if effect == "give_up":
            return run.gave_up and not run.with_units_mended(path).gave_up
        return run.stuck if effect == "stuck" else True

    return holds


def _orphan(path: str) -> Predicate:
    return lambda run: path in run.orphans(frozenset({path}))


def check_canonical(whole: oracle.P, decision: Decided, **options: object) -> None:
    context = Context(decision)
    paths = oracle.runner_paths(whole)
    for claim, predicate in claims_of(decision):
        outcome_of = context._canonical(claim)
        wanted = oracle.canonical_scenario(whole, predicate, **options)  # type: ignore[arg-type]
        assert wanted is not None
        assert [str(outcome_of(number)) for number in range(len(paths))] == list(wanted.outcomes)


@given(whole=plans(max_runners=8))
def test_the_structural_pass_finds_the_canonical_scenario(whole: oracle.P) -> None:
    check_canonical(whole, decided(whole, solver="structural"))


@settings(max_examples=many(50))
@given(whole=plans(max_runners=8))
def test_z3_finds_the_canonical_scenario(whole: oracle.P) -> None:
    decision = decided(whole, solver="z3")
    check_canonical(whole, decision)


@settings(max_examples=many(50))
@given(whole=plans(max_runners=5), models=faults(), consistent=st.booleans())
def test_z3_finds_the_canonical_scenario_under_faults(
    whole: oracle.P, models: frozenset[str], consistent: bool
) -> None:
    decision = decided(whole, faults=models, consistent=consistent)
    check_canonical(whole, decision, faults=models, consistent=consistent)


def findings_of(decision: Decided) -> list[Finding]:
    context = Context(decision)
    return [
        finding for rule in all_rules() if rule.find is not None for finding in rule.find(context)
    ]


@given(data=st.data(), whole=plans(max_runners=6), models=faults())
def test_scenarios_hold_however_open_outcomes_are_filled(
    data: st.DataObject, whole: oracle.P, models: frozenset[str]
) -> None:
    assumed = oracle.runner_paths(whole) and data.draw(st.booleans())
    assumptions = [str(data.draw(constraints(whole, faults=models)))] if assumed else []
    decision = decided(whole, faults=models, assumptions=assumptions)
    for finding in [] if decision.contradictory else findings_of(decision):
        scenario = finding.scenario
        if scenario is not None:
            ending = {"COMPLETED": "completed", "GAVE_UP": "gave_up", "STUCK": "stuck"}
            assert oracle.holds_for_all_fillings(
                whole,
                {path: str(outcome) for path, outcome in scenario.outcomes},
                lambda run, name=ending[scenario.ends]: getattr(run, name),
                faults=models,
            )


def triggered_by(automaton: Automaton, delivered: set[Signal]) -> set[int]:
    """The nodes that these events trigger, joins being instantaneous."""
    triggered: set[int] = set()
    while True:
        for node in automaton.nodes:
            came = sum(
                signal in delivered
                or (automaton.nodes[signal.node].kind is NodeKind.JOIN and signal.node in triggered)
                for signal in automaton.inputs[node.index]
            )
            if node.index not in triggered and came >= (node.need or 1):
                triggered.add(node.index)
                break
        else:
            return triggered


@given(whole=plans(max_runners=10))
def test_traces_hold_the_cause_of_each_event_before_it(whole: oracle.P) -> None:
    decision = decided(whole)
    automaton = decision.deciders.compiled.automaton
    nodes = {automaton.plan.path(node.origin): node.index for node in automaton.runners}
    for finding in findings_of(decision):
        if finding.scenario is None:
            continue
        delivered = {Signal(0, Event.SUCCEEDED)}
        for step in finding.scenario.trace:
            signal = Signal(nodes[step.element], step.event)
            assert signal not in delivered
            if step.event is Event.STARTED:
                assert signal.node in triggered_by(automaton, delivered)
            else:
                assert Signal(signal.node, Event.STARTED) in delivered
                assert dict(finding.scenario.outcomes)[step.element] == step.event
            delivered.add(signal)
        ending = {"COMPLETED": automaton.complete, "GAVE_UP": automaton.give_up}
        assert ending[finding.scenario.ends] in triggered_by(automaton, delivered)


@settings(max_examples=many(50))
@given(whole=plans(max_runners=12))
def test_both_backends_write_the_same_findings(whole: oracle.P) -> None:
    by_z3 = decided(whole, solver="z3")
    assert findings_of(decided(whole, solver="structural")) == findings_of(by_z3)
