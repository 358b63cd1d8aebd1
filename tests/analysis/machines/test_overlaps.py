"""Runners of machines that hold one resource at once, against a brute force."""

from __future__ import annotations

from itertools import combinations, product
from typing import Any

from hypothesis import assume, given, settings

from gpsfsm.analysis.machines.overlaps import overlaps_in
from gpsfsm.analysis.machines.search import Exploration
from gpsfsm.capabilities.library import bind, builtin_capabilities
from gpsfsm.compile.machines import machine_of
from tests.analysis.machines.random_machines import PLAIN, machines
from tests.cases import many
from tests.equivalence.machine_brute import Played

EVENTS = {1: "SUCCEEDED", 2: "FAILED"}


def met_by_brute_force(graph: Any) -> set[frozenset[str]]:
    """The pairs of runners that are active at once, not later than the instant of the end."""
    played = Played(graph)
    at, seen = played.begin()
    pending, library = [(at, seen.end)], {at}
    met: set[frozenset[str]] = set()
    while pending:
        at, end = pending.pop()
        met.update(map(frozenset, combinations(sorted(at.active), 2)))
        for name, event in product(sorted(at.active), () if end else EVENTS.values()):
            after, seen = played.after(at, name, event)
            met.update(map(frozenset, combinations(sorted(after.active), 2)))
            if not seen.end and after not in library:
                library.add(after)
                pending.append((after, ""))
    return met


@settings(max_examples=many(100))
@given(machines())
def test_all_that_meet_and_no_others(graph: Any) -> None:
    for _, data in graph.nodes(data=True):
        if data["kind"] == "runner":
            data.update(interface="nav2_capabilities/WaypointRunner", parameters={"x": 1.0})
    plan, _ = machine_of(graph)
    assume(plan is not None)
    assert plan is not None
    names = [plan.path(runner).removeprefix("/machine/") for runner in plan.runners]
    exploration = Exploration(plan.automaton, [PLAIN] * len(names))
    overlaps = overlaps_in(exploration, bind(plan, builtin_capabilities().library))
    pairs = {frozenset((names[each.first], names[each.second])) for each in overlaps}
    assert pairs == met_by_brute_force(graph)
    assert {each.resource for each in overlaps} <= {"base"}
    for each in overlaps:
        at, seen = (played := Played(graph)).begin()
        for place, (number, outcome) in enumerate((*each.shown, *each.then), start=1):
            if place - 1 == len(each.shown):
                assert {names[each.first], names[each.second]} <= at.active
            assert not seen.end
            at, seen = played.after(at, names[number], EVENTS[outcome])
        if not each.then:
            assert {names[each.first], names[each.second]} <= at.active
        else:
            assert seen.end or not at.active
