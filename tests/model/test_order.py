"""The topological order of the nodes of an automaton."""

from __future__ import annotations

from hypothesis import given

from gpsfsm.compile import compile_plan
from gpsfsm.syntax import parse
from tests.oracle import P, to_xml
from tests.strategies import plans


@given(plans())
def test_every_node_comes_after_those_that_its_inputs_come_from(whole: P) -> None:
    plan = parse(to_xml(whole)).plan
    assert plan is not None
    automaton = compile_plan(plan).automaton
    places = {node: place for place, node in enumerate(automaton.order)}
    assert sorted(places) == list(range(len(automaton.nodes)))
    assert all(places[source] < places[target] for source, _, target in automaton.edges)
    assert automaton.order[0] == 0
