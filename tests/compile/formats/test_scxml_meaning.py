"""What is said of a statechart is what an interpreter of appendix D of the recommendation does."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

import gpsfsm
from gpsfsm.analysis.machines.decide import Judge
from gpsfsm.analysis.machines.exact import ExactPart
from gpsfsm.analysis.machines.search import Exploration
from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.compile.formats.elements import Elements
from gpsfsm.compile.formats.scxml import _Reader, read
from gpsfsm.compile.formats.scxml_chart import Chart as ReadChart
from gpsfsm.compile.formats.scxml_writing import NAMESPACE, OWN_NAMESPACE
from gpsfsm.compile.units import MachinePlan
from gpsfsm.model.capability import OWN, TICK
from gpsfsm.model.event import Event
from gpsfsm.model.plan import Element
from gpsfsm.model.report import Frequency
from gpsfsm.syntax.source import DEFAULT_LIMITS
from tests.cases import batches
from tests.compile.formats.random_statecharts import OddChart
from tests.compile.formats.statecharts import Chart, EndlessStepError, TooManyError, Verdict

MOST = 20_000


def disagreements(text: str) -> list[str] | str:
    """Where the machine of a chart says what the judge denies; or why nothing was compared."""
    machine, problems = read(text, "chart.scxml", DEFAULT_LIMITS)
    if machine is None:
        return f"refused: {problems[0].message.partition(' ')[0]}"
    both = frozenset((Event.SUCCEEDED, Event.FAILED))
    allowed = [
        both - ({Event.FAILED} if each.interface == TICK else set()) for each in machine.runners
    ]
    try:
        exploration = Exploration(machine.automaton, allowed, limit=MOST)
        judge = Judge(exploration, machine.inexact)
        answers = judge.facts()
        verdict = Chart(text).verdict()
    except (InconclusiveError, TooManyError, EndlessStepError) as error:
        return type(error).__name__
    may = {claim[1:] or claim[:1] for claim in answers.may}
    rows = {
        "completes": (answers.completes, verdict.completes, (1,)),
        "gives up": (answers.gives_up, verdict.gives_up, (2,)),
        "stuck": (answers.stuck, verdict.stuck, (0,)),
        "endless": (answers.endless, verdict.endless, ("endless",)),
    }
    wrong = []
    for name, (frequency, can, claim) in rows.items():
        if frequency is Frequency.NEVER and can:
            wrong.append(f"never {name}")
        if frequency is not Frequency.NEVER and claim not in may and not can:
            if name != "endless" or not verdict.waits:
                wrong.append(f"{name}, proved")
        if frequency is Frequency.ALWAYS and any(
            other for word, (_, other, _) in rows.items() if word != name
        ):
            wrong.append(f"always {name}")
    part = judge.part if machine.inexact else exploration
    return wrong + moments(text, machine, exploration, part, verdict)


def name_of(runner: Element) -> str:
    """The name of a runner's node."""
    return next(each.text for each in runner.attributes if each.name == "name")


def moments(
    text: str,
    machine: MachinePlan,
    whole: Exploration,
    part: Exploration | None,
    verdict: Verdict,
) -> list[str]:
    """The stable configurations of the two: none is missing, and the exact ones are real."""
    elements = Elements(text, DEFAULT_LIMITS, NAMESPACE, OWN_NAMESPACE)
    reader = _Reader(ReadChart(elements))
    watching = {name for rows in reader.watchers.values() for name in rows}
    passive = {
        each.interface
        for number, each in enumerate(machine.runners)
        if not any(
            source == machine.automaton.runner_node(number)
            for source, *_ in machine.automaton.edges
        )
    }

    def seen(exploration: Exploration) -> set[frozenset[str]]:
        rows = set()
        for at in exploration.configurations[: exploration.reached]:
            active = [
                each for number, each in enumerate(machine.runners) if at.active >> number & 1
            ]
            pending = any(
                each.interface in OWN and name_of(each) not in watching for each in active
            )
            if not pending and not at.ended:
                rows.add(frozenset(each.interface for each in active if each.interface not in OWN))
        return rows

    def without(rows: set[frozenset[str]]) -> set[frozenset[str]]:
        return {each - passive for each in rows}

    wrong = [f"missing: {sorted(each)}" for each in without(verdict.acting) - without(seen(whole))]
    if part is not None:
        wrong += [
            f"unreal: {sorted(each)}"
            for each in without(seen(part)) - without(verdict.acting | verdict.passing)
        ]
    return wrong
