"""The refutation: everything that a plan never does, as one disjunction that z3 refutes at once.

The analyses hand in what must never hold if their answers are right (``never``). It is said of up
to four copies of the automaton's trigger equations, which share the outcomes of the instances:

- the *snapshot* is the state at some instant. Which of the outcomes have come by then is free
  (``held``: that of an instance has not), so it also is the whole run, where nothing is held back
  (``over``). Events only cause others: what some snapshot does not show, no later one takes back.
- in the *spared* copy the FAILED of some instances never come, one class of them at a time
  (``fewest``): each class is needed for a give-up, and classes have no instance in common.
- the *flipped* copy is the whole run with one outcome the other way round; in the *saved* one the
  units of a block succeed in place of failing.

    A, B in a parallel_all      never(active A and completed), never(active B and completed)
    snapshot: tA = tB = true, complete = (A succeeds and not held A) and (B succeeds and not held B)
    "held A and complete" contradicts itself, and so does the other: no orphans, in one query
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event, Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from gpsfsm.analysis.structure import Structure
    from gpsfsm.model.automaton import Automaton, Block


TRUE = 1
FALSE = -TRUE


class Circuit:
    """A Boolean circuit that grows, with its text for z3.

    A literal is a number, its negative is the negation, and 1 is "true". Gates with the same inputs
    are one gate, and constants are folded as the circuit grows: what cannot fail leads to nothing.

        and(4, or(2, -2))        or(2, -2) is 1, so that and(4, 1) is 4: no gate at all
    """

    def __init__(self, prefix: str = "v") -> None:
        self._prefix = prefix
        self.size = TRUE  # the greatest literal in use
        self._gates: dict[tuple[int, ...], int] = {}
        self._lines: list[str] = []
        self._names = {TRUE: "true", FALSE: "false"}

    def fresh(self) -> int:
        """A literal that is free."""
        self.size += 1
        number = self.size
        name = f"{self._prefix}{number}"
        self._names[number] = name
        self._names[-number] = f"(not {name})"
        self._lines.append(f"(declare-const {name} Bool)")
        return number

    def all(self, literals: Iterable[int]) -> int:
        """True if all of these are."""
        inputs = dict.fromkeys(literals)
        inputs.pop(TRUE, None)
        if FALSE in inputs or any(-each in inputs for each in inputs):
            return FALSE
        if len(inputs) <= 1:
            return next(iter(inputs), TRUE)
        return self._gate(tuple(sorted(inputs)), "and")

    def any(self, literals: Iterable[int]) -> int:
        """True if one of these is."""
        return -self.all([-each for each in literals])

    def at_least(self, need: int, literals: Sequence[int]) -> int:
        """True if so many of these are; one that stands there twice counts twice."""
        sure = literals.count(TRUE)
        literals, need = [each for each in literals if abs(each) != TRUE], need - sure
        if need <= 0:
            return TRUE
        if need > len(literals):
            return FALSE
        if need == 1:
            return self.any(literals)
        if need == len(literals):
            return self.all(literals)
        return self._gate((need, *sorted(literals)), f"(_ at-least {need})", counts=True)

    def _gate(self, key: tuple[int, ...], operator: str, *, counts: bool = False) -> int:
        identity = (0, *key) if counts else key  # no literal is 0
        number = self._gates.get(identity)
        if number is None:
            number = self._gates[identity] = self.fresh()
            inputs = " ".join([self._names[each] for each in (key[1:] if counts else key)])
            self._lines.append(f"(assert (= {self._names[number]} ({operator} {inputs})))")
        return number

    def require(self, *literals: int) -> None:
        """Assert that one of these is true."""
        if TRUE not in literals:
            inputs = " ".join([self._names[each] for each in literals if each != FALSE])
            self._lines.append(f"(assert (or false {inputs}))")

    def names(self, literals: Iterable[int]) -> list[str]:
        """The literals as they stand in the text."""
        return [self._names[each] for each in literals]

    def text(self) -> str:
        """Declarations and assertions in SMT-LIB."""
        return "\n".join(self._lines)


class UnprovedError(Exception):
    """The answer of an analysis is not put in these terms: z3 decides it by itself."""


class Copy:
    """The nodes that are triggered and the events that happen, as literals.

    ``comes(number, success)``: what must hold besides the trigger for the outcome of an instance to
    come. ``changed``: signals that are defined by others than the automaton.
    """

    def __init__(
        self,
        circuit: Circuit,
        automaton: Automaton,
        comes: Callable[[int, bool], tuple[int, ...]],
        changed: Callable[[Copy, Signal], int | None] = lambda _, __: None,
    ) -> None:
        self._circuit = circuit
        self._automaton = automaton
        self._comes = comes
        self._changed = changed
        self._events: dict[Signal, int] = {}
        self._joins = frozenset(n.index for n in automaton.nodes if n.kind is not NodeKind.RUNNER)
        self.fired = [FALSE] * len(automaton.nodes)
        self.fired[0] = TRUE
        nodes, inputs = automaton.nodes, automaton.inputs
        for node in automaton.order:
            if inputs[node]:
                came = [self.happens(signal) for signal in inputs[node]]
                self.fired[node] = circuit.at_least(nodes[node].need or 1, came)

    def happens(self, signal: Signal | None) -> int:
        """The event happens."""
        if signal is None:
            return FALSE
        literal = self._events.get(signal)
        if literal is None:
            literal = self._changed(self, signal)
            if literal is None:
                literal = self.plain(signal)
            self._events[signal] = literal
        return literal

    def plain(self, signal: Signal) -> int:
        """The event happens, as the automaton has it."""
        node, event = signal
        if node in self._joins:
            return self.fired[node] if event is Event.SUCCEEDED else FALSE
        if event is Event.STARTED:
            return self.fired[node]
        success = event is Event.SUCCEEDED
        return self._circuit.all((self.fired[node], *self._comes(node - 1, success)))


class Refutation:
    """A collection of what must never hold; ``structure`` is what proposed the answers."""

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self.compiled = structure.compiled
        self.automaton = structure.compiled.automaton
        self.circuit = circuit = Circuit()
        allowed = structure.constraints.allowed
        self._succeeds = [
            circuit.fresh()
            if len(outcomes) > 1 and Outcome.SUCCEEDED in outcomes
            else (TRUE if Outcome.SUCCEEDED in outcomes else FALSE)
            for outcomes in allowed
        ]
        self._never: list[int] = []
        self._claims = 0
        self._texts: list[str] = []
        self._parts: list[str] = []

    def never(self, *literals: int) -> None:
        """None of these ever holds."""
        self._claims += len(literals)
        self._never += (each for each in literals if each != FALSE)

    def never_in(self, text: str, names: Iterable[str]) -> None:
        """None of these symbols of a problem of its own, which has the text, ever holds."""
        self._texts.append(text)
        self._parts += names

    @property
    def claims(self) -> int:
        """The number of claims handed in so far; those that constants refute count as well."""
        return self._claims

    def text(self) -> str:
        """The problem, which has a solution if something holds that never should.

        Empty if constants alone refute it.
        """
        names = [*self._parts, *self.circuit.names(dict.fromkeys(self._never))]
        if not names:
            return ""
        wrong = f"(assert (or false {' '.join(names)}))"
        return "\n".join((*self._texts, self.circuit.text(), wrong))

    # -- the snapshot -----------------------------------------------------------------------

    @cached_property
    def held(self) -> list[int]:
        """Per instance: its outcome has not come."""
        return [self.circuit.fresh() for _ in self.automaton.runners]

    @cached_property
    def snapshot(self) -> Copy:
        """The state at some instant."""
        held = self.held
        return Copy(
            self.circuit,
            self.automaton,
            lambda number, success: (self.outcome(number, success), -held[number]),
        )

    def outcome(self, number: int, success: bool) -> int:
        """The outcome of the instance is SUCCEEDED, or else it emits FAILED."""
        return self._succeeds[number] if success else -self._succeeds[number]

    def active(self, number: int) -> int:
        """The instance is active in the snapshot."""
        node = self.automaton.runner_node(number)
        return self.circuit.all((self.snapshot.fired[node], self.held[number]))

    @cached_property
    def over(self) -> int:
        """Nothing is active in the snapshot: the run has come to its end."""
        return self.circuit.all(-self.active(number) for number in range(len(self.held)))

    @property
    def completed(self) -> int:
        """The plan has completed in the snapshot."""
        return self.snapshot.fired[self.automaton.complete]

    @property
    def gave_up(self) -> int:
        """The plan has given up in the snapshot."""
        return self.snapshot.fired[self.automaton.give_up]

    # -- other copies -----------------------------------------------------------------------

    def spared(self, class_of: Mapping[int, int]) -> Copy:
        """A run in which the FAILED of one class of instances, any one, never come."""
        classes = [self.circuit.fresh() for _ in range(max(class_of.values(), default=-1) + 1)]
        if classes:
            self.circuit.require(*classes)

        def comes(number: int, success: bool) -> tuple[int, ...]:
            if success or number not in class_of:
                return (self.outcome(number, success),)
            return self.outcome(number, success), -classes[class_of[number]]

        return Copy(self.circuit, self.automaton, comes)

    @cached_property
    def whole(self) -> Copy:
        """The whole run beside the snapshot: nothing is held back."""
        return Copy(
            self.circuit,
            self.automaton,
            lambda number, success: (self.outcome(number, success),),
        )

    def filled(self, number: int) -> int:
        """The instance has succeeded in the snapshot."""
        signal = Signal(self.automaton.runner_node(number), Event.SUCCEEDED)
        return self.snapshot.happens(signal)

    def saved(self, flips: Mapping[Block, int]) -> Copy:
        """The whole run, where units of a block whose flip is true succeed in place of failing."""
        gains: dict[Signal, list[tuple[Signal, int]]] = {}
        losses: dict[Signal, list[int]] = {}
        for block, flip in flips.items():
            for success, failure in block.units:
                if success is not None and failure is not None:
                    gains.setdefault(success, []).append((failure, flip))
                    losses.setdefault(failure, []).append(flip)
        circuit = self.circuit

        def changed(copy: Copy, signal: Signal) -> int | None:
            if signal not in gains and signal not in losses:
                return None
            more = (circuit.all((flip, copy.plain(other))) for other, flip in gains.get(signal, ()))
            kept = (-flip for flip in losses.get(signal, ()))
            return circuit.any((circuit.all((copy.plain(signal), *kept)), *more))

        return Copy(
            circuit,
            self.automaton,
            lambda number, success: (self.outcome(number, success),),
            changed,
        )

    def flipped(self, flips: Mapping[int, int]) -> Copy:
        """The whole run, where the outcome of an instance is the other one if its flip is true."""

        def comes(number: int, success: bool) -> tuple[int, ...]:
            outcome = self.outcome(number, success)
            flip = flips.get(number, FALSE)
            if flip == FALSE:
                return (outcome,)
            both, neither = (outcome, -flip), (-outcome, flip)
            return (self.circuit.any((self.circuit.all(both), self.circuit.all(neither))),)

        return Copy(self.circuit, self.automaton, comes)

    def at_most_one(self, literals: Iterable[int]) -> None:
        """Assert that no two of these hold: what came before is handed on.

        a, b, c: before b: a; before c: a or b. Never b and its before, never c and its before.
        """
        before = FALSE
        for literal in literals:
            both = self.circuit.all((before, literal))
            if both != FALSE:
                self.circuit.require(-both)
            before = self.circuit.any((before, literal))
