"""A machine stepped by the definitions of its options: small, slow, and prepared by nothing.

The exploration ties runners before it begins (``checking/machine_check.py``), and z3 gets outcomes
and groups that were prepared (``analysis/constraints.py``). Here a configuration remembers what has
come so far instead, and each outcome is asked for by the definition: is there a scenario with these
outcomes? What has come is forgotten once nobody can act any more whose outcome depends on it.

    --consistent; Drive STARTED → Look, Drive SUCCEEDED and FAILED → Drive
    Drive active, Look active             nothing has come: Look may succeed, and it may fail
    Look FAILED, Drive SUCCEEDED          the same runners are active, but Look FAILED has come:
    Drive active, Look active             no scenario has Look SUCCEEDED as well

The conditions of a tree on its blackboard have the answer of the last until something may have
written what they ask for (semantics, 10.3).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.compile.instants import (
    CODES,
    FAILED,
    HANG,
    STARTED,
    SUCCEEDED,
    Change,
    Configuration,
    Instants,
    Successors,
    bits,
)
from gpsfsm.compile.units import TreeMachine
from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from gpsfsm.analysis.definitions import Definitions
    from gpsfsm.compile.instants import Instant
    from gpsfsm.model.automaton import Automaton, Tie

_OUTCOMES = {SUCCEEDED: Outcome.SUCCEEDED, FAILED: Outcome.FAILED, HANG: Outcome.HANG}
_UNSURE = -1


class _Memory(NamedTuple):
    """The past of a run: outcomes by instance, and by condition its answer, 0 for none."""

    outcomes: tuple[tuple[int, int], ...] = ()
    answers: tuple[int, ...] = ()


class Plain(Successors):
    """The steps of a machine. ``said`` of a configuration is the number of what is remembered.

    ``by_scenario``: every instance has one visit, so that assumptions may relate instances.
    """

    def __init__(
        self, automaton: Automaton, definitions: Definitions, *, by_scenario: bool = False
    ) -> None:
        self.automaton = automaton
        self.definitions = definitions
        self.by_scenario = by_scenario
        super().__init__(Instants(automaton), ())  # outcomes are asked for, not listed
        plan = automaton.plan
        self.ties: list[Tie] = []
        if definitions.consistent and isinstance(plan, TreeMachine):
            self.ties = [tie for tie in plan.ties if self._has_equal_outcomes(tie)]
        self._related = self._relations()
        self._after: dict[int, int] = {}  # by instance all that may act because of it, as bits
        self._memories = {_Memory((), (0,) * len(self.ties)): 0}
        self._rows = list(self._memories)
        self._states: dict[Configuration, int] = {}
        self._configurations: list[Configuration] = []
        self._possible: dict[tuple[int, int], tuple[int, ...]] = {}

    def _has_equal_outcomes(self, tie: Tie) -> bool:
        """No assumption is about some of these conditions alone."""
        admitted = {
            tuple(o for o in Outcome if self.definitions.admits({number: o}))
            for number in tie.runners
        }
        return len(admitted) == 1

    def _relations(self) -> dict[int, int]:
        """By instance the instances, as bits, that its outcome may decide something for."""
        import networkx

        graph: networkx.Graph[int] = networkx.Graph()
        for members in {*self.definitions.equals.values()}:
            networkx.add_path(graph, members)
        for spoken in self.definitions.spoken() if self.by_scenario else ():
            networkx.add_path(graph, sorted(spoken))
        related: dict[int, int] = {}
        for part in networkx.connected_components(graph):
            related |= dict.fromkeys(part, sum(1 << number for number in part))
        return related

    # -- single steps -----------------------------------------------------------------------

    @property
    def tied(self) -> Collection[int]:
        """All instances: by their definitions, any may have fewer outcomes somewhere."""
        return range(len(self.automaton.runners))

    def first(self) -> Configuration:
        """The configuration after the first instant."""
        instant = self.instants.first()
        return self.remembered(instant, -1, STARTED)

    def possible(self, at: Configuration, number: int) -> tuple[int, ...]:
        """The outcomes that an active instance may have. Raises InconclusiveError at a limit."""
        key = at.said, number
        if key not in self._possible:
            outcomes = (code for code in sorted(_OUTCOMES) if self._may_come(at, number, code))
            self._possible[key] = tuple(outcomes)
        return self._possible[key]

    def _may_come(self, at: Configuration, number: int, code: int) -> bool:
        memory = self._rows[at.said]
        answers = {
            answer
            for tie, answer in zip(self.ties, memory.answers, strict=True)
            if number in tie.runners and answer > 0
        }
        settled = dict(memory.outcomes)
        if not answers <= {code} or settled.get(number, code) != code:
            return False
        kept = settled if self.by_scenario else {}
        outcomes = {other: _OUTCOMES[each] for other, each in (kept | {number: code}).items()}
        return self.definitions.admits(outcomes)

    def after(self, at: Configuration, number: int, code: int) -> Configuration:
        """The configuration after an outcome."""
        if code == HANG:
            hanging = self.instants.hanging(at, number)
            return hanging._replace(said=self._numbered(hanging, number, code, at.said, ()))
        return self.remembered(self.instants.after(at, number, code), number, code)

    def instead(self, at: Configuration, number: int, code: int) -> Configuration:
        """The configuration after an outcome that is compared with only.

        In a scenario the other one remains: all else that comes obeys the options with that.
        """
        instant = self.instants.after(at, number, code)
        real = FAILED if code == SUCCEEDED else SUCCEEDED
        return self.remembered(instant, number, real if self.by_scenario else code)

    def remembered(self, instant: Instant, number: int, code: int) -> Configuration:
        """The configuration after an instant, at which an instance had this outcome."""
        after = instant.configuration
        memory = self._rows[after.said]
        answers = tuple(
            self._answer(tie, answer, instant, number, code)
            for tie, answer in zip(self.ties, memory.answers, strict=True)
        )
        return after._replace(said=self._numbered(after, number, code, after.said, answers))

    def _numbered(
        self, after: Configuration, number: int, code: int, said: int, answers: tuple[int, ...]
    ) -> int:
        """The number of what is remembered after an outcome of an instance."""
        outcomes = dict(self._rows[said].outcomes)
        if number in self._related:
            equals = self.definitions.equals.get(number, (number,))
            outcomes |= dict.fromkeys(equals, code)
        acting = 0
        for other in bits(after.active | after.hanging) if outcomes else ():
            acting |= self._acting_after(other)
        kept = {n: each for n, each in outcomes.items() if self._related[n] & acting}
        memory = _Memory(tuple(sorted(kept.items())), answers or self._rows[said].answers)
        if memory not in self._memories:
            self._memories[memory] = len(self._rows)
            self._rows.append(memory)
        return self._memories[memory]

    def _acting_after(self, number: int) -> int:
        """The instances, as bits, that may be active at some time after one was."""
        if number not in self._after:
            automaton = self.automaton
            pending = [automaton.runner_node(number)]
            seen = set(pending)
            for node in pending:  # grows while it is read
                fresh = {*automaton.successors[node]} - seen
                seen |= fresh
                pending += sorted(fresh)
            runners = (node for node in seen if 0 < node <= len(automaton.runners))
            self._after[number] = sum(1 << automaton.runner_number(node) for node in runners)
        return self._after[number]

    def _answer(self, tie: Tie, before: int, instant: Instant, number: int, code: int) -> int:
        """The answer that the conditions of a tie have after an instant.

        A condition that stands before a script and is entered with it may have been asked before
        the script, so that its answer says nothing of the next: no answer counts until none of the
        conditions is being asked.
        """
        after, events = instant.configuration, set(instant.events)
        written = answered_early = False
        for signal, earlier in tie.resets:
            if signal.node * 4 + CODES[signal.event] in events:
                written = True
                starts = (self.automaton.runner_node(each) * 4 + STARTED for each in earlier)
                answered_early |= not events.isdisjoint(starts)
        if before == _UNSURE or answered_early:
            return _UNSURE if any(after.active >> each & 1 for each in tie.runners) else 0
        busy = after.active | after.hanging | instant.moved
        if written or any(busy >> writer & 1 for writer in tie.writers):
            return 0
        return code if number in tie.runners else before

    # -- all steps, as an exploration takes them ----------------------------------------------

    def packed(self, configuration: Configuration) -> int:
        """The number of a configuration."""
        number = self._states.setdefault(configuration, len(self._states))
        if number == len(self._configurations):
            self._configurations.append(configuration)
        return number

    def unpacked(self, state: int) -> Configuration:
        """The configuration of a number."""
        return self._configurations[state]

    def changes(self, state: int) -> list[Change]:
        """The steps that a configuration has, by runner and outcome; ``added`` is the target."""
        at = self._configurations[state]
        return [
            self._step(at, number, code)
            for number in bits(at.active)
            for code in self.possible(at, number)
        ]

    def _step(self, at: Configuration, number: int, code: int) -> Change:
        if code == HANG:
            target = self.packed(self.after(at, number, code))
            return Change(number, code, 0, target, 0, 0, 1 << number, 0)
        instant = self.instants.after(at, number, code)
        target = self.packed(self.remembered(instant, number, code))
        return Change(number, code, 0, target, 0, 0, instant.moved, instant.joined)

    def targets(self, state: int, changes: Iterable[Change]) -> list[int]:
        """The configurations that its steps lead to."""
        del state
        return [change.added for change in changes]

    def moved(self, state: int, changes: Iterable[Change]) -> list[int]:
        """The runners that come to an end in its steps."""
        del state
        return [change.moved for change in changes]
