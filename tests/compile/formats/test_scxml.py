"""SCXML against python-statemachine: what is read, and what is written, does the same there."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gpsfsm.compile import compile_plan
from gpsfsm.compile.formats import CannotSayError, formats
from gpsfsm.compile.formats.scxml import read
from gpsfsm.compile.instants import COMPLETED, FAILED, SUCCEEDED, Instants
from gpsfsm.model.capability import OWN
from gpsfsm.syntax.source import DEFAULT_LIMITS
from tests.cases import batches, many
from tests.compile.formats.test_formats import CORPUS, closed
from tests.oracle import P, to_xml
from tests.strategies import plans
from tests.support import plan_of

if TYPE_CHECKING:
    from gpsfsm.compile.instants import Configuration
    from gpsfsm.compile.units import MachinePlan

HEAD = '<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0"'
CHARTS = {
    "door": (CORPUS / "door.scxml").read_text(),
    "out of two regions": f"""{HEAD} initial="p">
      <parallel id="p">
        <state id="r1"><state id="a"><transition event="a.ok" target="b"/>
          <transition event="a.failed" target="end"/></state>
          <state id="b"><transition event="b.ok" target="a"/></state></state>
        <state id="r2"><state id="c"><transition event="c.ok" target="f"/></state>
          <final id="f"/></state>
      </parallel>
      <final id="end"/></scxml>""",
    "nested": f"""{HEAD} initial="n">
      <state id="n" initial="y"><transition event="n.leave" target="z"/>
        <transition event="done.state.n" target="x"/>
        <state id="y"><transition event="y.ok" target="g"/>
          <transition event="y.failed" target="y"/></state>
        <final id="g"/></state>
      <state id="x"><transition event="x.ok" target="end"/>
        <transition event="x.failed" target="n"/></state>
      <state id="z"><transition event="z.ok" target="end"/>
        <transition event="z.again" target="z"/><transition event="z.back" target="n"/></state>
      <final id="end"/></scxml>""",
}


def started(text: str) -> Any:
    processor = pytest.importorskip(
        "statemachine.io.scxml.processor", reason="python-statemachine is not installed"
    ).SCXMLProcessor()
    processor.parse_scxml("chart", text)
    return processor.start()


def acting(machine: MachinePlan, at: Configuration) -> frozenset[str]:
    return frozenset(
        each.interface
        for number, each in enumerate(machine.runners)
        if at.active >> number & 1 and each.interface not in OWN
    )


def after(
    machine: MachinePlan, instants: Instants, here: set[Configuration], source: str
) -> set[Configuration]:
    """With any outcome of a state; where it is none of a runner, a choice has come."""
    result = set()
    for at in here:
        for number, each in enumerate(machine.runners):
            if each.interface == source and at.active >> number & 1:
                result |= {
                    instants.after(at, number, event).configuration for event in (SUCCEEDED, FAILED)
                }
    return closed(machine, instants, result | (set() if result else set(here)))


class RandomChart:
    """A chart with nested and parallel states; targets may lie deep inside others."""

    def __init__(self, seed: int) -> None:
        self.chance = random.Random(seed)  # noqa: S311
        self.states: list[str] = []
        self.finals: list[str] = []
        self.lines: list[str] = []
        first = self.inside("", 0)
        targets = [*self.states, *self.finals, "end", "end"]
        body = "\n".join(self.lines)
        while "TARGET" in body:
            body = body.replace("TARGET", self.chance.choice(targets), 1)
        self.text = f'{HEAD} initial="{first}">\n{body}\n<final id="end"/></scxml>'

    def inside(self, pad: str, depth: int) -> str:
        """Some states beside each other; the name of one that may be the first."""
        names = [self.state(pad, depth) for _ in range(self.chance.randint(1, 3 - depth // 2))]
        return self.chance.choice(names)

    def state(self, pad: str, depth: int) -> str:
        name = f"s{len(self.states)}"
        self.states.append(name)
        kind = "state" if depth > 2 else self.chance.choice(("state", "state", "inner", "parallel"))
        tag = "parallel" if kind == "parallel" else "state"
        at = len(self.lines)
        events = self.chance.randint(1, 2) if kind == "state" else self.chance.randint(0, 1)
        first = ""
        self.lines.append("")
        for number in range(events):
            self.lines.append(f'{pad} <transition event="{name}.e{number}" target="TARGET"/>')
        if kind != "state" and self.chance.random() < 0.6:
            self.lines.append(f'{pad} <transition event="done.state.{name}" target="TARGET"/>')
        if kind == "inner":
            chosen = self.inside(pad + " ", depth + 1)
            first = (
                f' initial="{chosen}"'  # python-statemachine takes a parallel for no first state
            )
            if self.chance.random() < 0.3:  # internal ones lead inwards
                inner = self.chance.choice(self.states[self.states.index(name) + 1 :])
                self.lines.append(
                    f'{pad} <transition type="internal" event="{name}.in" target="{inner}"/>'
                )
            self.finals.append(f"{name}_end")
            self.lines.append(f'{pad} <final id="{name}_end"/>')
        elif kind == "parallel":
            for _ in range(2):
                self.state(pad + " ", depth + 1)
        self.lines[at] = f'{pad}<{tag} id="{name}"{first}>'
        self.lines.append(f"{pad}</{tag}>")
        return name


@pytest.mark.parametrize("batch", batches(4))
def test_random_charts_do_what_they_do_elsewhere(batch: int) -> None:
    played = 0
    for seed in range(25 * batch, 25 * batch + 25):
        text = RandomChart(seed).text
        machine, problems = read(text, "chart.scxml", DEFAULT_LIMITS)
        if machine is None:  # a final state that leads to itself: no engine comes out of that
            assert {each.message for each in problems} == {"this is entered without end"}
            continue
        played += 1
        compared(text, seeds=4, name=str(seed))
    assert played > 20


@pytest.mark.parametrize("name", sorted(CHARTS))
def test_a_chart_that_is_read_does_what_it_does_elsewhere(name: str) -> None:
    assert compared(CHARTS[name], seeds=many(60), name=name)


def compared(text: str, *, seeds: int, name: str) -> int:
    """How often a chart comes to an end; the machine follows it to there."""
    machine, problems = read(text, "chart.scxml", DEFAULT_LIMITS)
    assert machine is not None, problems
    instants = Instants(machine.automaton)
    events = sorted(set(_events(text)))
    ends = 0
    for seed in range(seeds):
        chance, chart = random.Random(seed), started(text)  # noqa: S311
        here = closed(machine, instants, {instants.first().configuration})
        for _ in range(12):
            leaves = {each.id for each in chart.configuration}
            active = frozenset(each.interface for each in machine.runners) & leaves
            if chart.is_terminated:
                ends += 1
                assert COMPLETED in {at.ended for at in here} or "failed" in leaves
                break
            assert active in {acting(machine, at) for at in here}, (name, seed)
            here = {at for at in here if acting(machine, at) == active}
            event = chance.choice(events)
            before = leaves
            chart.send(event)
            if {each.id for each in chart.configuration} != before or event.startswith("z.again"):
                here = after(machine, instants, here, event.partition(".")[0])
    return ends


def _events(text: str) -> list[str]:
    parts = text.split('event="')[1:]
    events = [part.partition('"')[0] for part in parts]
    return [event for event in events if not event.startswith("done.")]


@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None, max_examples=many(60))
@given(plans(max_runners=6, max_depth=3), st.integers(0, 2**20))
def test_a_chart_that_is_written_does_what_the_plan_does(whole: P, seed: int) -> None:
    automaton = compile_plan(plan_of(to_xml(whole))).automaton
    write = formats()["scxml"].write
    assert write is not None
    try:
        text = write(automaton)
    except CannotSayError:
        return
    if 'gpsfsm:form="regions"' in text:
        return  # several act at once: test_scxml_regions.py
    chance, chart, instants = random.Random(seed), started(text), Instants(automaton)  # noqa: S311
    at = instants.first().configuration
    while not at.ended:
        number = at.active.bit_length() - 1
        (state,) = (each.id for each in chart.configuration)
        assert f'gpsfsm:interface="{automaton.plan.runners[number].interface}"' in next(
            line for line in text.splitlines() if f'<state id="{state}"' in line
        )
        outcome = chance.choice((SUCCEEDED, FAILED))
        at = instants.after(at, number, outcome).configuration
        chart.send(f"{state}.{'succeeded' if outcome == SUCCEEDED else 'failed'}")
    (end,) = (each.id for each in chart.configuration)
    assert end == ("completed" if at.ended == COMPLETED else "gave_up")
