"""What happens at one instant of a machine (semantics, 9.2)."""

from __future__ import annotations

from typing import Any

from gpsfsm.compile.instants import COMPLETED, EVENTS, FAILED, GAVE_UP, SUCCEEDED, Instant, Instants
from tests.analysis.machines.random_machines import automaton_of, machine


class Played:
    """A machine that is played outcome by outcome; ``events`` are those of the last instant."""

    def __init__(self, *connections: str, **needs: int) -> None:
        self.automaton = automaton_of(machine(*connections, **needs))
        self.instants = Instants(self.automaton)
        self._take(self.instants.first())

    def play(self, name: str, outcome: int) -> Played:
        """The instant at which a runner ends."""
        self._take(self.instants.after(self.at, self.number(name), outcome))
        return self

    def hang(self, name: str) -> Played:
        """A runner never ends by itself."""
        self.at = self.instants.hanging(self.at, self.number(name))
        return self

    def number(self, name: str) -> int:
        """The number of a runner."""
        names = [self.name(node.index) for node in self.automaton.runners]
        return names.index(name)

    def name(self, node: int) -> str:
        """The name of a node."""
        path = self.automaton.plan.path(self.automaton.nodes[node].origin)
        return path.removeprefix("/machine/")

    @property
    def active(self) -> list[str]:
        """The active runners."""
        return [
            self.name(node.index)
            for number, node in enumerate(self.automaton.runners)
            if self.at.active >> number & 1
        ]

    def _take(self, instant: Instant) -> None:
        self.at = instant.configuration
        self.events = [f"{self.name(code >> 2)} {EVENTS[code & 3]}" for code in instant.events]


def test_a_trigger_while_active_has_no_effect_and_after_the_end_starts_again() -> None:
    played = Played("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED b", "b SUCCEEDED a")
    assert played.active == ["a", "b"]
    played.play("a", SUCCEEDED)
    assert played.events == ["a SUCCEEDED"]
    assert played.active == ["b"]
    played.play("b", SUCCEEDED)
    assert played.events == ["b SUCCEEDED", "a STARTED"]
    assert played.active == ["a"]


def test_several_starts_and_connections_to_one_runner_trigger_it_once() -> None:
    played = Played("start SUCCEEDED a", "start2 SUCCEEDED a", "start2 SUCCEEDED b")
    assert played.events == ["start SUCCEEDED", "start2 SUCCEEDED", "a STARTED", "b STARTED"]


def test_an_outcome_may_trigger_the_runner_that_has_it() -> None:
    played = Played("start SUCCEEDED a", "a FAILED a").play("a", FAILED)
    assert played.events == ["a FAILED", "a STARTED"]


def test_stopping_comes_before_triggering() -> None:
    connections = ("start SUCCEEDED a", "start SUCCEEDED b", "a FAILED stop b", "a FAILED b")
    played = Played(*connections).play("a", FAILED)
    assert played.events == ["a FAILED", "b STOPPED", "b STARTED"]
    assert played.active == ["b"]


def test_what_is_not_active_is_not_stopped_and_what_hangs_is() -> None:
    connections = ("start SUCCEEDED a", "a STARTED b", "a FAILED stop b", "b STOPPED c")
    played = Played(*connections).play("b", SUCCEEDED).play("a", FAILED)
    assert played.events == ["a FAILED"]
    played = Played(*connections).hang("b").play("a", FAILED)
    assert played.events == ["a FAILED", "b STOPPED", "c STARTED"]
    assert played.active == ["c"]


def test_events_of_an_instant_come_in_the_order_of_their_causes() -> None:
    played = Played(
        *("start SUCCEEDED a", "start SUCCEEDED b", "a FAILED stop b", "a FAILED j", "b FAILED j"),
        *("j SUCCEEDED b", "b STARTED c"),
        j=1,
    )
    assert played.active == ["a", "b", "c"]
    played.play("c", SUCCEEDED).play("a", FAILED)
    assert played.events == [
        "a FAILED",
        *("b STOPPED", "j SUCCEEDED", "b STARTED", "c STARTED"),
    ]


def test_a_join_of_all_its_inputs_is_armed_as_it_fires() -> None:
    loop = ("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED j", "b SUCCEEDED j")
    played = Played(*loop, "j SUCCEEDED a", "j SUCCEEDED b", j=2)
    for _ in range(3):
        assert played.play("a", SUCCEEDED).events == ["a SUCCEEDED"]
        assert "j SUCCEEDED" in played.play("b", SUCCEEDED).events


def test_a_join_of_some_inputs_takes_in_the_others_before_it_fires_again() -> None:
    loops = ("start SUCCEEDED a", "start SUCCEEDED b", "a FAILED a", "b FAILED b")
    played = Played(*loops, "a FAILED j", "b FAILED j", "j SUCCEEDED c", "c SUCCEEDED end", j=1)
    assert "j SUCCEEDED" in played.play("a", FAILED).events
    assert "j SUCCEEDED" not in played.play("a", FAILED).events
    assert "j SUCCEEDED" not in played.play("b", FAILED).events
    assert "j SUCCEEDED" in played.play("b", FAILED).events


def test_a_join_that_is_stopped_is_as_at_first() -> None:
    loops = ("start SUCCEEDED a", "a FAILED a", "a FAILED j", "b FAILED j", "a SUCCEEDED a")
    played = Played(*loops, "a SUCCEEDED stop j", "j SUCCEEDED c", j=1)
    assert "j SUCCEEDED" in played.play("a", FAILED).events
    assert "j SUCCEEDED" not in played.play("a", FAILED).events
    played.play("a", SUCCEEDED)
    assert "j SUCCEEDED" in played.play("a", FAILED).events


def test_a_join_that_needs_more_than_it_has_never_fires() -> None:
    played = Played("start SUCCEEDED a", "a FAILED j", "a FAILED a", "j SUCCEEDED c", j=2)
    for _ in range(3):
        assert played.play("a", FAILED).events == ["a FAILED", "a STARTED"]


def test_the_first_end_counts_and_giving_up_goes_before_completing() -> None:
    def ended(*connections: str, outcomes: str = "ab") -> int:
        played = Played("start SUCCEEDED a", "start SUCCEEDED b", *connections)
        for name in outcomes:
            played.play(name, SUCCEEDED)
        return played.at.ended

    both: tuple[Any, ...] = ("a SUCCEEDED end", "b SUCCEEDED lost")
    assert ended(*both) == COMPLETED
    assert ended(*both, outcomes="ba") == GAVE_UP
    assert ended("a SUCCEEDED end", "a SUCCEEDED lost") == GAVE_UP
