"""Machines that are written as SCXML and YASMIN, against what judges of both formats do with them.

The judges run the text: an interpreter of appendix D, and one of YASMIN's factory. After each
outcome of a runner the same must be active in the automaton and in the text.
"""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, Any, Protocol

import networkx as nx

from gpsfsm.compile import compile_plan
from gpsfsm.compile.formats import CannotSayError
from gpsfsm.compile.formats.flat import COMPLETED, GAVE_UP, flat
from gpsfsm.compile.formats.scxml_writing import ids_of
from gpsfsm.compile.instants import COMPLETED as HAS_COMPLETED
from gpsfsm.compile.instants import FAILED, GOING, SUCCEEDED, Instants
from gpsfsm.compile.machines import machine_of
from gpsfsm.compile.plan_text import read_plan_or_machine
from gpsfsm.equivalence import UndecidedError, convert_plan
from gpsfsm.model.capability import TICK
from tests.compile.formats.random_statecharts import EventfulChart
from tests.compile.formats.scxml_runs import shown
from tests.compile.formats.statecharts import Chart
from tests.compile.formats.yasmin_machines import YasminMachine
from tests.compile.formats.yasmin_runs import Interpreter

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator

    from gpsfsm.compile.instants import Configuration
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.plan import Plan

_MOST = 150  # configurations of a machine that are compared
_WORDS = {SUCCEEDED: "succeeded", FAILED: "failed"}
_INTERFACES = ("a/Go", "a/Say", "Go", "completed", "gave_up", "a/1 <&\"'>", "é")


class Judge(Protocol):
    """A text that runs."""

    first: Hashable

    def active(self, at: Any) -> set[str]:
        """The names of what is active, or of the end."""

    def after(self, at: Any, name: str, word: str) -> Hashable:
        """Where it is after an outcome."""


class _Yasmin:
    def __init__(self, text: str) -> None:
        self.runs = Interpreter(text, undeclared=True)  # the text says that all are declared
        self.first: Hashable = self.runs.first

    def active(self, at: Any) -> set[str]:
        return {at} if isinstance(at, str) else {name for (name, _), _ in self.runs.steps[at]}

    def after(self, at: Any, name: str, word: str) -> Hashable:
        (after,) = (to for who, to in self.runs.steps[at] if who == (name, word))
        return after


class _Scxml:
    def __init__(self, text: str) -> None:
        self.chart = Chart(text)
        self.regions = 'gpsfsm:form="regions"' in text
        self.first: Hashable = frozenset(self.chart.first())

    def active(self, at: Any) -> set[str]:
        (moment,) = at
        names = {*self.chart.active(moment.at)}
        return {each.removesuffix("_active") for each in shown(names)} if self.regions else names

    def after(self, at: Any, name: str, word: str) -> Hashable:
        return frozenset(self.chart.after(at, f"{name}.{word}"))


def judged(seed: int) -> Iterator[str]:
    """What is written of a random machine does the same; labels for a campaign."""
    plan = source(seed)
    if plan is None:
        yield "no machine"
        return
    automaton = compile_plan(plan).automaton
    for to, kind in (("scxml", _Scxml), ("yasmin", _Yasmin)):
        try:
            text = convert_plan(plan, to)
        except CannotSayError as error:
            yield f"{to} refuses: {error.why.partition(' /')[0]}"
            continue
        except UndecidedError:
            yield f"{to}: undecided"
            continue
        judge: Judge = kind(text)
        compare(automaton, judge, _names(automaton, regions=getattr(judge, "regions", False)))
        yield f"{to}: the same" + (", of regions" if getattr(judge, "regions", False) else "")


def compare(automaton: Automaton, judge: Judge, names: list[str]) -> None:
    """The same is active in both, whatever the outcomes in any order; up to a limit."""
    instants = Instants(automaton)
    pending: list[tuple[Configuration, Any]] = [(instants.first().configuration, judge.first)]
    seen = {pending[0][0]}
    for here, at in pending:  # grows while it is read
        active = [number for number in range(len(names)) if here.active >> number & 1]
        wanted = {names[number] for number in active}
        if here.ended != GOING:
            wanted = {COMPLETED if here.ended == HAS_COMPLETED else GAVE_UP}
        assert judge.active(at) == wanted, (judge.active(at), wanted)
        for number in active if here.ended == GOING else ():
            ticks = automaton.plan.runners[number].interface == TICK
            for outcome in (SUCCEEDED,) if ticks else (SUCCEEDED, FAILED):
                after = instants.after(here, number, outcome).configuration
                if after not in seen and len(seen) < _MOST:
                    seen.add(after)
                    pending.append((after, judge.after(at, names[number], _WORDS[outcome])))


def _names(automaton: Automaton, *, regions: bool) -> list[str]:
    """The names of the runners in the text."""
    if not regions:
        return [each.name for each in flat(automaton)[1]]
    ids = ids_of(automaton)
    return [ids[each.index] for each in automaton.runners]


# -- what is written -------------------------------------------------------------------------------


def source(seed: int) -> Plan | None:
    """A machine in which one acts at a time, one of a file of YASMIN, or one of a statechart."""
    kind = seed % 3
    if kind == 0:
        return machine_of(_flat_graph(random.Random(seed)))[0]  # noqa: S311
    text = YasminMachine(seed).text if kind == 1 else EventfulChart(seed).text
    return read_plan_or_machine(text, file="source").plan


def _flat_graph(chance: random.Random) -> nx.MultiDiGraph[Any]:
    graph: nx.MultiDiGraph[Any] = nx.MultiDiGraph()
    graph.add_node("start", kind="start")
    runners = [f"r{number}" for number in range(chance.randint(1, 6))]
    for name in runners:
        parameters = chance.choice(({}, {"x": 1.5, "text": "<&\"'>\n\té"}, {"yes": True, "n": -3}))
        interface = chance.choice(_INTERFACES)
        graph.add_node(name, kind="runner", interface=interface, parameters=parameters)
    graph.add_node("any", kind="join", need=1)
    graph.add_node("end", kind="complete")
    graph.add_node("lost", kind="give_up")
    targets = [*runners, *runners, "any", "end", "lost"]
    graph.add_edge("start", chance.choice(runners), event="SUCCEEDED")
    graph.add_edge("any", chance.choice([*runners, "end", "lost"]), event="SUCCEEDED")
    for name in runners:
        for event in ("SUCCEEDED", "FAILED"):
            for _ in range(chance.choice((1,) * 30 + (0, 2))):
                graph.add_edge(name, chance.choice(targets), event=event)
    return graph
