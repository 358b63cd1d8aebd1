"""A machine that was read, against the runs that a judge enumerates: what is denied, what is loose.

A judge gives a graph: by position, which states end, and the position or the end that follows.
"""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.machines.decide import Judge
from gpsfsm.analysis.machines.search import Exploration
from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.compile.instants import COMPLETED, GAVE_UP
from gpsfsm.model.capability import OWN, TICK
from gpsfsm.model.event import Event
from gpsfsm.model.report import Frequency

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator, Mapping

    from gpsfsm.compile.units import MachinePlan

COMPLETES, GIVES_UP = "completes", "gives up"
_ENDS = {COMPLETES: COMPLETED, GIVES_UP: GAVE_UP}
_MOST, _WALKS, _LONGEST = 1_500, 5, 12


class Graph(NamedTuple):
    """The runs of a judge: COMPLETES or GIVES_UP stand for the two ends."""

    firsts: frozenset[Hashable]
    steps: Mapping[Hashable, set[tuple[str, Hashable]]]
    active: frozenset[str]
    endless: bool

    def ends(self) -> set[Hashable]:
        """The ends that runs come to."""
        return {*self.firsts, *(to for row in self.steps.values() for _, to in row)} & {*_ENDS}

    def after(self, at: set[Hashable], who: str) -> set[Hashable]:
        """Where a run may be if this state ends."""
        return {
            what for each in at for name, what in self.steps.get(each, ()) if name == who
        }  # fmt: skip


class _Machine:
    """A machine, followed by the names of its states."""

    def __init__(self, machine: MachinePlan) -> None:
        both = frozenset((Event.SUCCEEDED, Event.FAILED))
        allowed = [
            both - ({Event.FAILED} if each.interface == TICK else set()) for each in machine.runners
        ]
        self.names = [
            None if each.interface in OWN else machine.path(each).removeprefix("/machine/")
            for each in machine.runners
        ]
        self.whole = Exploration(machine.automaton, allowed, limit=_MOST)
        self.judge = Judge(self.whole, machine.inexact)
        self.part = self.judge.part if machine.inexact else self.whole

    def closure(self, at: set[int]) -> set[int]:
        """Also what follows without the end of a state."""
        pending, seen = list(at), set(at)
        while pending:
            for step in self.whole.steps[pending.pop()]:
                if self.names[step.number] is None and step.target not in seen:
                    seen.add(step.target)
                    pending.append(step.target)
        return seen

    def after(self, at: set[int], who: str) -> set[int]:
        return self.closure(
            {
                step.target
                for each in at
                for step in self.whole.steps[each]
                if self.names[step.number] == who
            }
        )


def compared(
    machine: MachinePlan, every: Graph, certain: Graph, chance: random.Random
) -> Iterator[str]:
    """Labels: what is loose, or that all is exact; an AssertionError for what is not true.

    ``every``: all runs that there may be; ``certain``: those that there are, whatever the file does
    not say.
    """
    try:
        of = _Machine(machine)
    except InconclusiveError:
        yield "too many configurations"
        return
    loose = [*_facts(of, every, certain)]
    for _ in range(_WALKS):
        _walk_of_judge(of, every, chance)
        _walk_of_machine(of, certain, chance)
    yield "compared"
    yield "over-approximated" if machine.inexact else "exact"
    yield from loose or ["nothing loose"]


def _facts(of: _Machine, every: Graph, certain: Graph) -> Iterator[str]:
    facts = of.judge.facts()
    assert facts.stuck is Frequency.NEVER, "stuck"
    unreachable = {name for number in facts.unreachable if (name := of.names[number])}
    assert not unreachable & every.active, sorted(unreachable & every.active)
    if {name for name in of.names if name} - unreachable - every.active:
        yield "loose: a state is reached"
    rows = {
        COMPLETES: (facts.completes, ("end", COMPLETED)),
        GIVES_UP: (facts.gives_up, ("end", GAVE_UP)),
        "endless": (facts.endless, ("endless",)),
    }
    possible, sure = (
        {*graph.ends(), *(["endless"] if graph.endless else [])} for graph in (every, certain)
    )
    for name, (frequency, claim) in rows.items():
        proved = claim not in facts.may and frequency is not Frequency.NEVER
        assert not (name in possible and frequency is Frequency.NEVER), f"never {name}"
        assert not (possible - {name} and frequency is Frequency.ALWAYS), f"always {name}"
        assert not (proved and name not in sure), f"{name}, proved"
        if frequency is not Frequency.NEVER and name not in possible:
            yield f"loose: {name}"
        elif name in sure and not proved:
            yield f"not proved: {name}"


def _walk_of_judge(of: _Machine, every: Graph, chance: random.Random) -> None:
    """A random run of the judge is one of the machine."""
    at, here, trace = chance.choice(sorted(every.firsts, key=repr)), of.closure({0}), list[str]()
    while len(trace) < _LONGEST and at not in _ENDS and every.steps[at]:
        who, at = chance.choice(sorted(every.steps[at], key=repr))
        trace.append(who)
        here = of.after(here, who)
        assert here, f"the machine cannot do {trace}"
    if at in _ENDS:
        ends = {of.whole.configurations[each].ended for each in here}
        assert _ENDS[str(at)] in ends, f"{trace}: it {at}"


def _walk_of_machine(of: _Machine, certain: Graph, chance: random.Random) -> None:
    """A random exact run of the machine is one of the judge."""
    if of.part is None:
        return
    number, here, trace = 0, {*certain.firsts}, list[str]()
    while len(trace) < _LONGEST and of.part.steps[number]:
        step = chance.choice(of.part.steps[number])
        number = step.target
        if (who := of.names[step.number]) is not None:
            trace.append(who)
            here = certain.after(here, who)
            assert here, f"the judge cannot do {trace}, which is exact"
    ended = of.part.configurations[number].ended
    assert all(end != ended or name in here for name, end in _ENDS.items()), f"{trace} ends"
