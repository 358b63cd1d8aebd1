"""The facts of a corpus plan on an original engine, by playing its connections in every order."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.compile.engine_text import read_connections
from gpsfsm.model.engine import EnginePlan
from tests.oracle.engine import Machine, scenarios

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["engine_facts", "engine_of"]


def engine_of(words: Sequence[str]) -> str | None:
    """The engine that command line words name."""
    return words[words.index("--engine") + 1] if "--engine" in words else None


def engine_facts(text: str, engine: str) -> dict[str, Any]:
    """All facts but those about declared capabilities, which the plans of the rules have none of.

    ``join_deadlocks`` is left out: the tests' brute force does not know the blocks of an engine.
    """
    reading = read_connections(text, engine)
    assert isinstance(reading.result, EnginePlan)
    assert reading.plan is not None
    machine = Machine(reading.result)
    places = {leaf: reading.element(machine.of[leaf]) or 0 for leaf in machine.leaves}
    leaves = sorted(machine.leaves, key=places.__getitem__)  # in document order
    path = {leaf: reading.plan.path(reading.plan.elements[places[leaf]]) for leaf in leaves}
    played = [(scenario, *machine.ends(scenario)) for scenario in scenarios(machine)]
    reached = set().union(*(some for _, _, some in played))
    ends = [each for _, each, _ in played]
    interfaces = {machine.of[leaf].source.interface for leaf in leaves}
    return {
        "runners": len(leaves),
        "completes": _frequency(ends, "COMPLETED"),
        "gives_up": "never",
        "stuck": "never",
        "unreachable": [path[leaf] for leaf in leaves if leaf not in reached],
        "dangling": [
            {"runner": path[leaf], "event": event, "effect": _effect(played, leaf, succeeds)}
            for leaf in leaves
            if leaf in reached
            for event, succeeds in (("SUCCEEDED", True), ("FAILED", False))
            if not machine.leads_on(leaf, succeeds=succeeds)
        ],
        "orphans": [path[leaf] for leaf in leaves if leaf in machine.orphans],
        "fewest_failures_to_give_up": None,
        "makespan": None,
        "energy": None,
        "loaded": {"peak": machine.most_active, "all": len(interfaces)},
        "engine": {
            "name": engine,
            "hangs": _frequency(ends, "HANG"),
            "aborts": _frequency(ends, "ABORT"),
        },
    }


def _frequency(ends: Sequence[set[str]], end: str) -> str:
    if not any(end in each for each in ends):
        return "never"
    return "always" if all(each == {end} for each in ends) else "sometimes"


def _effect(played: Sequence[Any], leaf: int, succeeds: bool) -> str:
    """``stuck`` if the plan hangs because of this outcome, and would not with the other one."""
    ends = {frozenset(scenario.items()): each for scenario, each, _ in played}
    for scenario, path, reached in played:
        if scenario[leaf] is not succeeds or leaf not in reached or "HANG" not in path:
            continue
        if "HANG" not in ends[frozenset({**scenario, leaf: not succeeds}.items())]:
            return "stuck"
    return "dont_care"
