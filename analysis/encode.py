"""The automaton as an SMT-LIB problem.

One Boolean per outcome, one per triggered node: the least solution of the trigger equations is
the run of the scenario, and since a compiled plan has no cycles it is the only one. There are no
time stamps: pure order needs none.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from itertools import combinations, pairwise
from typing import TYPE_CHECKING

from gpsfsm.late import pattern
from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import End, Event, Outcome

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from gpsfsm.analysis.constraints import Constraints

TRUE, FALSE = "true", "false"
_SYMBOL = pattern(r"\b[a-z]\d+(?:_\d+)?\b")


def conjunction(terms: Iterable[str]) -> str:
    """The SMT-LIB term for all of ``terms``."""
    return _join("and", TRUE, FALSE, terms)


def disjunction(terms: Iterable[str]) -> str:
    """The SMT-LIB term for any of ``terms``."""
    return _join("or", FALSE, TRUE, terms)


def negation(term: str) -> str:
    """The SMT-LIB term for the opposite of ``term``."""
    return {TRUE: FALSE, FALSE: TRUE}.get(term, f"(not {term})")


def at_least(need: int, terms: Sequence[str]) -> str:
    """``need`` of the terms hold, or more."""
    if need == 1:
        return disjunction(terms)
    if need == len(terms):
        return conjunction(terms)
    return FALSE if need > len(terms) else f"((_ at-least {need}) {' '.join(terms)})"


def _join(operator: str, neutral: str, absorbing: str, terms: Iterable[str]) -> str:
    kept = [term for term in terms if term != neutral]
    if absorbing in kept:
        return absorbing
    if len(kept) <= 1:
        return kept[0] if kept else neutral
    return f"({operator} {' '.join(kept)})"


def symbols_of(text: str) -> list[str]:
    """The symbols that occur in ``text``, each once, in order of occurrence."""
    return list(dict.fromkeys(_SYMBOL.findall(text)))


class _Runs(ABC):
    """The terms that a run and its variants have in common."""

    automaton: Automaton

    @abstractmethod
    def triggered(self, node: int) -> str:
        """The node is triggered; a join fires."""

    @abstractmethod
    def happens(self, signal: Signal | None) -> str:
        """The event happens."""

    def ending(self, end: End) -> str:
        """Some maximal run of the scenario ends like this."""
        automaton = self.automaton
        complete = self.triggered(automaton.complete)
        give_up = self.triggered(automaton.give_up)
        if end is End.COMPLETED:
            return complete
        if end is End.GAVE_UP:
            return give_up
        if end is End.ABORT:
            return self.aborts
        if (end is End.STUCK) is not automaton.traits.gives_up:
            return FALSE
        return conjunction((negation(complete), negation(give_up), negation(self.aborts)))

    @property
    def lost(self) -> str:
        """Some maximal run gives up; on an engine that cannot, it hangs."""
        return self.ending(End.GAVE_UP if self.automaton.traits.gives_up else End.HANG)

    @cached_property
    def aborts(self) -> str:
        """The engine can abort before the plan completes."""
        return disjunction(map(self.breaks, self.automaton.deadly))

    def breaks(self, join: int) -> str:
        """A second input comes at this join, at which the engine aborts."""
        inputs = [self.happens(signal) for signal in self.automaton.inputs[join]]
        twice = f"((_ at-least 2) {' '.join(inputs)})" if len(inputs) > 1 else FALSE
        loops = join in self.automaton.traits.looping
        return disjunction((twice, self.triggered(join) if loops else FALSE))


class Encoding(_Runs):
    """Terms and assertions for the questions of the analyses.

    Symbols: ``s7`` instance 7 succeeds, ``n7`` it does not start, ``h7`` it hangs; ``t7`` node 7
    is triggered (for a join: it fires); ``t7_2`` the same in variant 2 of the run.
    """

    def __init__(self, automaton: Automaton, constraints: Constraints) -> None:
        self.automaton = automaton
        self.constraints = constraints
        self._variants = 0

    def succeeds(self, number: int) -> str:
        """The outcome of this instance is SUCCEEDED."""
        return f"s{number}"

    def outcome(self, number: int, outcomes: Iterable[Outcome]) -> str:
        """The outcome of this instance is one of these."""
        wanted = set(outcomes) & self.possible
        if wanted == self.possible:
            return TRUE
        return disjunction(self._is(number, outcome) for outcome in sorted(wanted))

    @property
    def possible(self) -> set[Outcome]:
        """The outcomes that the fault models allow."""
        return {Outcome.FAILED, *self.named}

    @cached_property
    def named(self) -> dict[Outcome, str]:
        """The outcomes that have a symbol, by their letter; FAILED is none of these."""
        letters = {Outcome.SUCCEEDED: "s"}
        if self.constraints.no_start:
            letters[Outcome.NO_START] = "n"
        if self.constraints.hang:
            letters[Outcome.HANG] = "h"
        return letters

    def symbols(self, number: int) -> list[str]:
        """The symbols of an instance; at most one of them is true."""
        return [f"{letter}{number}" for letter in self.named.values()]

    def _is(self, number: int, outcome: Outcome) -> str:
        if outcome is Outcome.FAILED:
            return negation(disjunction(self.symbols(number)))
        return f"{self.named[outcome]}{number}"

    def emits_failed(self, number: int) -> str:
        """The instance, once triggered, emits FAILED."""
        if self.automaton.traits.refusals_hang:
            return self.outcome(number, (Outcome.FAILED,))
        return self.outcome(number, (Outcome.FAILED, Outcome.NO_START))

    def scenarios(self) -> list[str]:
        """Assertions that say which scenarios there are."""
        constraints = self.constraints
        terms: list[str] = []
        for number, allowed in enumerate(constraints.allowed):
            terms += [
                f"(not (and {one} {other}))" for one, other in combinations(self.symbols(number), 2)
            ]
            term = self.outcome(number, allowed)
            if term != TRUE:
                terms.append(term)
        for group in constraints.groups:
            for one, other in pairwise(group):
                same = zip(self.symbols(one), self.symbols(other), strict=True)
                terms += [f"(= {first} {second})" for first, second in same]
        if constraints.formulas:
            from gpsfsm.analysis.assumptions import to_smt

            terms += [to_smt(formula, self.outcome) for formula in constraints.formulas]
        return terms

    def triggered(self, node: int) -> str:
        """The node is triggered; a join fires."""
        return f"t{node}" if self.automaton.inputs[node] else FALSE

    def happens(self, signal: Signal | None) -> str:
        """The event happens."""
        if signal is None:
            return FALSE
        return self._happens(signal, self.triggered(signal.node))

    def _happens(self, signal: Signal, triggered: str) -> str:
        kind = self.automaton.nodes[signal.node].kind
        if kind is NodeKind.START:
            return TRUE
        if kind is NodeKind.JOIN:  # only engines connect other events of a join: they never come
            return triggered if signal.event is Event.SUCCEEDED else FALSE
        number = self.automaton.runner_number(signal.node)
        if signal.event is Event.SUCCEEDED:
            return conjunction((triggered, f"s{number}"))
        if signal.event is Event.FAILED:
            return conjunction((triggered, self.emits_failed(number)))
        if signal.node in self.automaton.traits.silent:
            return FALSE
        not_started = self.outcome(number, (Outcome.NO_START,))
        return conjunction((triggered, negation(not_started)))

    def fires(self, node: int, terms: list[str]) -> str:
        """The node is triggered if enough of its inputs happen."""
        need = self.automaton.nodes[node].need or 1
        if need > 1 and node in self.automaton.traits.breaking:  # the second input breaks it
            return FALSE
        return at_least(need, terms)

    def definitions(self) -> list[str]:
        """Assertions that define ``triggered`` for all nodes."""
        return [
            f"(= t{node} {self.fires(node, [self.happens(signal) for signal in inputs])})"
            for node, inputs in enumerate(self.automaton.inputs)
            if inputs
        ]

    def variant(self, changed: Mapping[Signal, str]) -> Variant:
        """The same run if the ``changed`` events happened as these terms say."""
        self._variants += 1
        return Variant(self, self._variants, changed)


class Variant(_Runs):
    """A second run beside the first: same outcomes, but some events are changed.

    Only what depends on the changed events is defined anew (``definitions``), in topological order,
    so that each definition knows which of its inputs were.

        edges 0→1, 1→2, 0→3, the event from 1 to 2 changed
        definitions: t2_1 for node 2;  nodes 1 and 3 keep t1 and t3
    """

    def __init__(self, encoding: Encoding, name: int, changed: Mapping[Signal, str]) -> None:
        self.automaton = encoding.automaton
        self._encoding = encoding
        self._name = name
        self._changed = changed
        self._renamed: set[int] = set()
        self.definitions: list[str] = []
        for node in encoding.automaton.order:
            inputs = encoding.automaton.inputs[node]
            if not any(signal in changed or signal.node in self._renamed for signal in inputs):
                continue
            fires = encoding.fires(node, [self.happens(signal) for signal in inputs])
            self._renamed.add(node)
            self.definitions.append(f"(= {self.triggered(node)} {fires})")

    def triggered(self, node: int) -> str:
        """The node is triggered in this run."""
        return f"t{node}_{self._name}" if node in self._renamed else self._encoding.triggered(node)

    def happens(self, signal: Signal | None) -> str:
        """The event happens in this run."""
        if signal is None:
            return FALSE
        if signal in self._changed:
            return self._changed[signal]
        return self._encoding._happens(signal, self.triggered(signal.node))
