"""Machines stepped by the definitions of their options; mistakes planted in what is prepared."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings

import gpsfsm
from gpsfsm.analysis.machines import order_free
from gpsfsm.analysis.machines.findings import Findings
from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.checking import machine_check
from gpsfsm.model.report import Frequency, Verdict
from tests.analysis.machines.random_machines import automaton_of, machine, machines
from tests.cases import many
from tests.oracle.machines import Machine

if TYPE_CHECKING:
    from gpsfsm.model.report import PlanReport

AGAIN = machine(
    *("start SUCCEEDED drive", "drive STARTED look", "drive SUCCEEDED drive"),
    *("drive FAILED drive", "look SUCCEEDED both", "look FAILED both", "both SUCCEEDED end"),
    both=2,
)
"""Look is on no loop, and a loop starts it again and again."""

MEETING = machine(
    *("start SUCCEEDED a", "a SUCCEEDED end", "a FAILED b", "a FAILED d"),
    *("b SUCCEEDED end", "b FAILED end"),
)
for _name, _x in (("a", 1), ("b", 2), ("d", 3)):
    MEETING.nodes[_name].update(
        interface="nav2_capabilities/WaypointRunner", parameters={"x": _x, "y": 1}
    )
RELATED = ["same: WaypointRunner", "at most one of WaypointRunner fails"]


def checked(graph: Any, **options: Any) -> PlanReport:
    (report,) = gpsfsm.check(graph, **options).plans
    return report


def rules_of(graph: Any, **options: Any) -> set[str]:
    return {finding.rule for finding in checked(graph, **options).findings}


def test_what_a_loop_starts_again_has_one_outcome() -> None:
    report = checked(AGAIN, consistent=True)
    assert report.facts is not None
    assert report.facts.completes is Frequency.NEVER
    assert "GP313" in {finding.rule for finding in report.findings}
    free = checked(AGAIN).facts
    assert free is not None
    assert free.completes is Frequency.SOMETIMES


@pytest.mark.parametrize(
    "lines",
    [
        # stopped, and triggered by another connection
        ("start SUCCEEDED a", "a STARTED l", "a SUCCEEDED stop l", "a FAILED l", "l STOPPED b"),
        # two starts trigger it at one instant, and a later event again
        ("start SUCCEEDED l", "start2 SUCCEEDED l", "l FAILED b", "b SUCCEEDED l"),
        # behind a join that forgets its inputs, in no loop
        (
            *("start SUCCEEDED a", "start SUCCEEDED c", "a SUCCEEDED j", "c SUCCEEDED j"),
            *("a SUCCEEDED d", "d SUCCEEDED stop j", "j SUCCEEDED l"),
        ),
    ],
)
def test_several_visits(lines: tuple[str, ...]) -> None:
    automaton = automaton_of(machine(*lines, j=1) if "j" in " ".join(lines) else machine(*lines))
    paths = [automaton.plan.path(runner) for runner in automaton.plan.runners]
    often = {paths[number] for number in machine_check._visited_again(automaton)}
    assert "/machine/l" in often


@settings(max_examples=many(60))
@given(machines(most_runners=4))
def test_whatever_is_visited_twice_may_be(graph: Any) -> None:
    automaton = automaton_of(graph)
    whole = Machine(graph, most=2_000)
    reached = whole.reach([whole.begin()])
    paths = [automaton.plan.path(runner) for runner in automaton.plan.runners]
    often = {paths[number] for number in machine_check._visited_again(automaton)}
    for number, name in enumerate(whole.runners):
        begins = [
            step.after for each in reached.values() for step in each if number in step.started
        ]
        begins += [whole.begin()] * (number in whole.first.started)
        later = whole.reach(begins)
        if any(number in step.started for each in later.values() for step in each):
            assert f"/machine/{name}" in often


def test_overlaps_obey_what_relates_runners() -> None:
    assert "GP501" in rules_of(MEETING)
    assert "GP501" not in rules_of(MEETING, assume=RELATED)
    assert "GP501" in rules_of(MEETING, assume=['any of (name "b", name "d") fails'])
    hanging = {"consistent": True, "faults": ["hang"]}
    assert "GP501" in rules_of(MEETING, **hanging)


def test_overlaps_of_many_configurations_are_decided_by_z3_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before = checked(MEETING, assume=['name "b" fails implies name "d" fails']).findings
    monkeypatch.setattr(machine_check, "ALSO_EXPLORED", 1)
    after = checked(MEETING, assume=['name "b" fails implies name "d" fails']).findings
    met = [each for findings in (before, after) for each in findings if each.rule == "GP501"]
    assert len(met) == 2
    assert met[0].message == met[1].message
    assert all(each.scenario is not None and each.scenario.ends == "COMPLETED" for each in met)
    assert "GP501" not in rules_of(MEETING, assume=RELATED)


def test_overlaps_that_z3_leaves_open_are_undecided(monkeypatch: pytest.MonkeyPatch) -> None:
    def at_a_limit(*_: Any) -> Any:
        raise InconclusiveError

    monkeypatch.setattr(order_free.OrderFree, "overlaps", at_a_limit)
    report = checked(MEETING, assume=['name "b" fails implies name "d" fails'])
    assert report.verdict is Verdict.UNDECIDED
    assert "GP904" in {finding.rule for finding in report.findings}


@pytest.mark.parametrize(
    ("wrong", "graph", "options"),
    [
        ("visits", AGAIN, {"consistent": True}),
        ("ties", AGAIN, {"consistent": True}),
        ("outcomes", AGAIN, {"assume": ["look never fails", "drive never fails"]}),
        ("order", MEETING, {"assume": RELATED}),
    ],
)
def test_a_mistake_of_the_preparation_is_a_defect(
    wrong: str, graph: Any, options: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "GP903" not in rules_of(graph, **options)
    if wrong == "visits":
        monkeypatch.setattr(machine_check, "_visited_again", lambda _: frozenset())
    elif wrong == "order":  # overlaps that look at no assumption
        right, count = machine_check.is_order_free, iter((True, False))
        monkeypatch.setattr(machine_check, "is_order_free", lambda _: next(count))
        assert right(automaton_of(graph))
    else:
        usual = frozenset(("SUCCEEDED", "FAILED"))
        tied = machine_check.tied

        def none(automaton: Any, constraints: Any) -> Any:
            allowed, ties = tied(automaton, constraints)
            return ([usual] * len(allowed) if wrong == "outcomes" else allowed), ties * 0

        monkeypatch.setattr(machine_check, "tied", none)
    assert "GP903" in rules_of(graph, **options)


def test_a_run_that_the_options_rule_out_is_a_defect(monkeypatch: pytest.MonkeyPatch) -> None:
    right = Findings._replayed

    def wrong(self: Findings, run: Any, loop: Any) -> Any:
        return right(self, ((0, 2), *run), loop)

    graph = machine("start SUCCEEDED a", "a FAILED a", "a SUCCEEDED lost")
    monkeypatch.setattr(Findings, "_replayed", wrong)
    assert "GP903" not in rules_of(graph)
    assert "GP903" in rules_of(graph, assume=["a never fails"])


def test_visits_of_a_start_come_once() -> None:
    automaton = automaton_of(machine("start SUCCEEDED a", "start2 SUCCEEDED a", "a FAILED b"))
    assert machine_check._visited_again(automaton) == frozenset()
