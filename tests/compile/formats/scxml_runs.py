"""Random runs of an automaton by its own instants, as events of the SCXML that is written of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.compile.formats.scxml_writing import ids_of
from gpsfsm.compile.instants import COMPLETED, FAILED, GAVE_UP, SUCCEEDED, Instants

if TYPE_CHECKING:
    import random

    from gpsfsm.model.automaton import Automaton

_ENDS = {COMPLETED: "completed", GAVE_UP: "gave_up"}
_WORDS = {SUCCEEDED: "succeeded", FAILED: "failed"}


class Run(NamedTuple):
    """The events of a run, and what is active at first and after each: states, or the end."""

    events: list[str]
    active: list[set[str]]


def random_run(automaton: Automaton, chance: random.Random, longest: int = 40) -> Run:
    """A run with outcomes in a random order, as semantics.md says."""
    instants = Instants(automaton)
    ids = ids_of(automaton)
    runners = [node.index for node in automaton.runners]
    at = instants.first().configuration
    run = Run([], [])
    while True:
        active = [number for number in range(len(runners)) if at.active >> number & 1]
        end = _ENDS.get(at.ended)
        run.active.append({end} if end else {f"{ids[runners[each]]}_active" for each in active})
        if end or not active or len(run.events) >= longest:
            return run
        number, event = chance.choice(active), chance.choice((SUCCEEDED, FAILED))
        run.events.append(f"{ids[runners[number]]}.{_WORDS[event]}")
        at = instants.after(at, number, event).configuration


def shown(configuration: set[str]) -> set[str]:
    """Of what an engine says is active, the active runners and the end."""
    ends = configuration & set(_ENDS.values())
    return ends or {each for each in configuration if each.endswith("_active")}
