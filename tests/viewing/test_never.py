"""No failure is drawn of what never fails, and nothing else is left out."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.analysis.constraints import constraints_under
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.api import check_options
from gpsfsm.model.event import Event, Outcome
from gpsfsm.viewing.picture import never_emitted
from gpsfsm.viewing.plans import see
from gpsfsm.viewing.plays import Wanted, play
from tests.viewing.support import only
from tests.viewing.test_pictures import random_plan

if TYPE_CHECKING:
    from gpsfsm.checking import CheckOptions

_RUNNER = '<Runner interface="a/{0}" provider="a/{0}"/>'
_A, _B, _C = (_RUNNER.format(name) for name in "ABC")
_ALL = f'<Plan><Control type="parallel_all">{_A}{_B}</Control>{_C}</Plan>'
_ONLY_C = ("never fails: A", "never fails: B")


def _assuming(*assumptions: str) -> CheckOptions:
    return check_options(AnalysisOptions(assumptions=assumptions))


def edges_of(plan: dict[str, Any]) -> list[tuple[int, str, int]]:
    return [(edge["source"], edge["event"], edge["target"]) for edge in plan["automaton"]["edges"]]


def test_a_failure_that_an_assumption_excludes_is_not_drawn() -> None:
    whole = only(_ALL)
    bound = only(_ALL, _assuming(*_ONLY_C))
    fails = [(source, event) for source, event, _ in edges_of(whole) if event == "FAILED"]
    assert {source for source, _ in fails} == {1, 2, 3}
    assert {source for source, event, _ in edges_of(bound) if event == "FAILED"} == {3}
    (join,) = [n for n, node in enumerate(bound["automaton"]["nodes"]) if node.get("hidden")]
    assert join in whole["automaton"]["failing"]
    assert join not in {source for source, *_ in edges_of(bound)}


def test_one_of_two_that_can_fail_is_enough_for_the_join() -> None:
    bound = only(_ALL, _assuming("never fails: A"))
    assert {source for source, event, _ in edges_of(bound) if event == "FAILED"} == {2, 3}
    assert not any(node.get("hidden") for node in bound["automaton"]["nodes"])


def test_a_join_that_gets_some_of_its_inputs_is_drawn() -> None:
    """It never fires, but the connection of what can fail ends there."""
    both = _ALL.replace("parallel_all", "parallel_any")
    bound = only(both, _assuming("never fails: A"))
    nodes = bound["automaton"]["nodes"]
    assert {source for source, event, _ in edges_of(bound) if event == "FAILED"} == {2, 3}
    assert not any(nodes[target].get("hidden") for *_, target in edges_of(bound) if target >= 0)


def test_a_capability_says_it_too() -> None:
    speech = (
        '<Plan><Runner interface="perception_capabilities/SpeechRunner" '
        'provider="perception_capabilities/SpeechRunner" text="Hello."/></Plan>'
    )
    compiled = see(speech, "plan.xml", check_options()).compiled
    assert compiled is not None
    (binding,) = compiled.bindings
    assert binding is not None
    drawn = "FAILED" in {event for _, event, _ in edges_of(only(speech))}
    assert drawn is not binding.never_fails


@pytest.mark.parametrize("seed", range(12))
def test_what_is_left_out_happens_in_no_run(seed: int) -> None:
    compiled = see(random_plan(seed), "plan.xml", check_options()).compiled
    assert compiled is not None
    automaton = compiled.automaton
    runners = len(automaton.runners)
    firm = [number for number in range(runners) if (number * 7 + seed) % 3]
    options = check_options()
    allowed = [*constraints_under(options.analysis, compiled).allowed]
    for number in firm:
        allowed[number] = frozenset({Outcome.SUCCEEDED})
    never = never_emitted(automaton, allowed)
    assert {signal.node for signal in never if signal.event is Event.FAILED} == {
        automaton.runner_node(number) for number in firm
    }
    free = [number for number in range(runners) if number not in firm][:5]
    for chosen in product((Outcome.SUCCEEDED, Outcome.FAILED), repeat=len(free)):
        played = play(compiled, Wanted(dict(zip(free, chosen, strict=True))))
        joined = {record["node"] for record in played.records if record["kind"] == "JOINED"}
        assert not joined & {signal.node for signal in never if signal.event is Event.SUCCEEDED}
