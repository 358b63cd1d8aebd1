"""Scenarios of findings as plays: the run, its story, and where each sentence happens."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import InternalError
from gpsfsm.viewing.playing import Wanted, play
from gpsfsm.viewing.stories import story_places

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.compile import Compiled
    from gpsfsm.model.event import Event, Outcome
    from gpsfsm.model.finding import Finding, Scenario
    from gpsfsm.viewing.playing import Played

__all__ = ["MOST_NODES", "MOST_RECORDS", "Budget", "Plays"]

MOST_RECORDS = 40_000
"""Records of all plays of a document: some 400 kB of a page."""
MOST_NODES = 150_000
"""Nodes of all automata that are run for a document, each time anew: some three seconds."""


@dataclass(slots=True)
class Budget:
    """What the plays of a document may cost in all, in size and in time."""

    records: int = MOST_RECORDS
    nodes: int = MOST_NODES

    def take(self, records: int, nodes: int) -> None:
        """Spend so much."""
        self.records -= records
        self.nodes -= nodes

    @property
    def spent(self) -> bool:
        """Whether there is room for no more."""
        return self.records <= 0 or self.nodes <= 0


@dataclass(slots=True)
class Plays:
    """The plays of one plan; ``left_out`` counts those that there was no room for.

    The first one of a plan is always there, however long it is. ``consistent``: equal actions have
    equal outcomes.
    """

    compiled: Compiled
    budget: Budget
    consistent: bool = False
    plays: list[dict[str, Any]] = field(default_factory=list)
    left_out: int = 0
    _numbers: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        plan = self.compiled.automaton.plan
        self._numbers = {plan.path(each): number for number, each in enumerate(plan.runners)}

    def add(self, finding: Finding) -> int:
        """The index of the play for a finding; -1 if it has none, or there is no room for it."""
        scenario = finding.scenario
        if scenario is None:
            return -1
        if self.budget.spent and self.plays:
            self.left_out += 1
            return -1
        played = self._played(scenario)
        if played is None:
            return -1
        self.budget.take(len(played.records), len(self.compiled.automaton.nodes))
        title = f"{finding.rule} at line {finding.location.line}"
        self.plays.append(self._data(title, scenario, played))
        return len(self.plays) - 1

    def _played(self, scenario: Scenario) -> Played | None:
        """The run; None if it is one of another automaton, where it goes another way.

        That is so for what an engine does otherwise than the paper says.
        """
        if any(path not in self._numbers for path, _ in scenario.outcomes):
            return None
        outcomes = {self._numbers[path]: outcome for path, outcome in scenario.outcomes}
        others = self._equal(outcomes) if self.consistent else {}
        trace = self._trace(scenario)
        try:
            played = play(self.compiled, Wanted(outcomes, trace, others))
        except InternalError:
            return None
        as_told = played.status.value == scenario.ends.value and all(
            step in played.places for step in trace
        )
        return played if as_told else None

    def _equal(self, outcomes: Mapping[int, Outcome]) -> dict[int, Outcome]:
        """What the other instances of the same actions do: the same."""
        runners = self.compiled.automaton.plan.runners
        decided = {runners[number].action: outcome for number, outcome in outcomes.items()}
        return {
            number: decided[runner.action]
            for number, runner in enumerate(runners)
            if runner.action in decided
        }

    def _trace(self, scenario: Scenario) -> list[tuple[Event, int]]:
        return [
            (step.event, self._numbers[step.element])
            for step in scenario.trace
            if step.element in self._numbers
        ]

    def _data(self, title: str, scenario: Scenario, played: Played) -> dict[str, Any]:
        plan = self.compiled.automaton.plan
        return {
            "title": title,
            "ends": played.status.value,
            "story": list(scenario.story),
            "records": played.records,
            "story_at": story_places(
                scenario.story,
                plan,
                self._trace(scenario),
                played.places,
                len(played.records) - 1,
            ),
        }
