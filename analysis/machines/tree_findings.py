"""Findings about the machine of a behaviour tree, in the words of trees (semantics, section 10).

A leaf has several uses in the machine: one for each round of a loop that is written out, and one
that watches in a reactive node. It is unreachable if none of them is ever started. Choices and
ticks stand for what a node does by itself, so nothing is said of them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from gpsfsm.analysis.machines.findings import Findings
from gpsfsm.analysis.rules import rule
from gpsfsm.analysis.words import listed, place
from gpsfsm.model.choice import OWN
from gpsfsm.model.finding import Severity
from gpsfsm.model.report import Frequency
from gpsfsm.model.story import Statement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.machines.decide import Answers, DanglingAt
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.event import Event
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Element


def answers_for_tree(answers: Answers, automaton: Automaton) -> Answers:
    """The answers that are about the tree: of leaves, each named by its first use.

    A Parallel that has ended waits for nobody, whatever its joins have taken in.
    """
    runners = automaton.plan.runners
    started = {
        each.spot for number, each in enumerate(runners) if number not in answers.unreachable
    }
    named: dict[tuple[str, int], int] = {}
    for number in answers.unreachable:
        each = runners[number]
        if each.spot not in started and each.interface not in OWN:
            named.setdefault(each.spot, number)
    dangling: dict[tuple[tuple[str, int], Event], DanglingAt] = {}
    for event in answers.dangling:
        place = automaton.plan.elements[automaton.nodes[event.signal.node].origin].spot
        dangling.setdefault((place, event.signal.event), event)
    return replace(
        answers,
        unreachable=tuple(sorted(named.values())),
        dangling=tuple(dangling.values()),
        waiting=(),
        orphans=(),
    )


class TreeFindings(Findings):
    """The findings about one tree."""

    def _severity_of_never(self) -> Severity | None:
        """A tree that goes round for ever is mostly meant to."""
        return Severity.INFO if self._goes_on() else None

    def _hint_of_never(self) -> str:
        return "nothing, if the tree is meant to go on for ever" if self._goes_on() else ""

    def _goes_on(self) -> bool:
        return self.answers.endless is not Frequency.NEVER

    def _loops(self) -> Iterator[Finding]:
        """Loops that really go on: a choice among its steps may be one that never comes."""
        for loop in self.answers.loops:
            elements = [self.plan.runners[number] for number in loop.runners]
            if not loop.trap and any(each.interface in OWN for each in elements):
                continue
            acting = [each for each in elements if each.interface not in OWN]
            names = listed([place(each) for each in _once(acting)]) or "nothing that acts"
            code = "GP313" if loop.trap else "GP314"
            message = (
                f"once it has begun, this loop goes on for ever, whatever the outcomes: {names}"
                if loop.trap
                else f"this loop goes on for ever if the same outcomes repeat: {names}"
            )
            yield rule(code).finding(
                message,
                self.plan.location((acting or elements)[0]),
                severity=Severity.INFO,
                hint="nothing, if that is intended; else bound the loop",
                scenario=self._scenario(
                    code, loop.lasso.prefix, Statement.FOR_EVER, loop=loop.lasso.loop
                ),
            )


def _once(elements: list[Element]) -> list[Element]:
    """The first use of each leaf."""
    return list({each.spot: each for each in reversed(elements)}.values())[::-1]
