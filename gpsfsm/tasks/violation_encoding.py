"""Violations of a task as a problem for z3: all runs of a plan beside a machine (SMT-LIB).

Only where the state of the machine changes does the order of events matter. So a run is told by a
few *cuts*: cut m is the moment right after the m-th change, the last cut is the end of the run. At
each cut it is known which instances have begun and whose outcomes have come. Which sets can be
there at a moment depends on causes alone, since triggers are monotone: the outcome that came last
(the *latest*) is told apart, for what it triggers begins at this very instant, in any order, and
everything that was triggered before has begun. All events between two cuts, other than the change,
must leave the state as it is; so their order does not matter.

Symbols, for instance or node i and cut m: ``d`` the outcome has come, ``e`` it is not the latest,
``y`` it is the latest, ``u`` it came since the cut before; ``b`` it has begun, ``i`` since the cut
before; ``c`` its beginning is the change. ``t`` with 2m is "triggered by then", with 2m+1
"triggered before the instant of the latest outcome". For cut m: ``k`` the latest outcome is the
change, ``o`` there is a change, ``g`` outcomes came since the cut before, ``p`` some outcome has
come, ``j`` the task has been left. ``z`` state, ``a`` class of letters between the cuts, ``x`` of
the change. ``w`` key of a violation, ``f`` instance fails.

Example: the plan is ``B; A``, and the task wants A first. The first event, B's start, changes the
state from "A is due" (z0_0) to the violation. So one change is enough: c0_1, i0_1 and b0_1 hold for
instance 0, o1 and j1 do, nothing happens between cut 1 and the end, and the key w0 can hold.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.encode import (
    FALSE,
    TRUE,
    Encoding,
    at_least,
    conjunction,
    disjunction,
    negation,
)
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.event import End, Event, Outcome

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.model.automaton import Automaton, Signal
    from gpsfsm.tasks.machine import Key, Machine


class Slots:
    """The problem with ``changes`` changes of the state, or fewer.

    ``problem`` are the assertions; ``keys`` the violations, each with the symbol that implies it.
    """

    def __init__(
        self, automaton: Automaton, constraints: Constraints, machine: Machine, changes: int
    ) -> None:
        assert machine.size, "without states no run leaves the task"
        assert len(machine.targets) == len(machine.ends)
        assert changes >= 0
        self.automaton = automaton
        self.encoding = Encoding(automaton, constraints)
        self.machine = machine
        self.changes = changes
        self.last = changes + 1
        self.numbers = range(len(automaton.runners))
        starts = (Event.STARTED, Outcome.NO_START)
        self._starting = {number for event, number in machine.classes if event in starts}
        kinds = [*machine.broken.values(), *(key for ends in machine.ends for key in ends.values())]
        self.keys = {key: f"w{number}" for number, key in enumerate(dict.fromkeys(kinds))}

    @property
    def failing(self) -> list[str]:
        """Symbols: the instance fails, or does not start, before the task is left."""
        return [f"f{number}" for number in self.numbers]

    @property
    def more(self) -> str:
        """Some run changes the state so often without having left the task."""
        return conjunction((f"o{self.changes}", f"(not j{self.changes})"))

    def happenings(self) -> Iterator[str]:
        """Symbols that tell one run from another, the end first, the last instances first."""
        for cut in (self.last, *range(1, self.last)):
            for n in reversed(self.numbers):
                yield f"d{n}_{cut}"
                yield f"b{n}_{cut}"
                if cut < self.last and n in self._starting:
                    yield f"c{n}_{cut}"
                yield f"y{n}_{cut}"

    def begins(self, number: int, cut: int) -> str:
        """The instance has begun."""
        return f"b{number}_{cut}" if cut else FALSE

    def comes(self, number: int, cut: int) -> str:
        """The outcome of the instance has come."""
        return f"d{number}_{cut}" if cut else FALSE

    def changing_start(self, number: int, cut: int) -> str:
        """The beginning of the instance is the change right before the cut."""
        return f"c{number}_{cut}" if cut < self.last and number in self._starting else FALSE

    def changing_outcome(self, cut: int) -> str:
        """The latest outcome is the change right before the cut."""
        return f"k{cut}" if cut < self.last else FALSE

    def problem(self) -> Iterator[str]:
        """The assertions."""
        yield from self.encoding.scenarios()
        yield "z0_0"
        for cut in range(1, self.last + 1):
            yield from self._sets(cut)
            yield from self._instants(cut)
            yield from self._triggers(cut)
            yield from self._segment(cut)
            if cut < self.last:
                yield from self._change(cut)
            yield from self._states(cut)
        yield from self._violations()

    # -- which sets there can be --------------------------------------------------------------

    def _sets(self, cut: int) -> Iterator[str]:
        for n in self.numbers:
            node = self.automaton.runner_node(n)
            b, d, e, y = f"b{n}_{cut}", f"d{n}_{cut}", f"e{n}_{cut}", f"y{n}_{cut}"
            now, before = self._triggered(node, 2 * cut), self._triggered(node, 2 * cut + 1)
            yield f"(=> {b} {now})"
            yield f"(=> {before} {b})"
            yield f"(=> {d} {b})"
            yield f"(=> {e} {d})"
            yield f"(= {y} (and {d} (not {e})))"
            yield f"(=> {d} {before})"
            yield f"(=> {d} {negation(self._hangs(n))})"
            b0, d0 = self.begins(n, cut - 1), self.comes(n, cut - 1)
            if cut > 1:
                yield f"(=> {b0} {b})"
                yield f"(=> {d0} {d})"
            yield f"(= u{n}_{cut} {conjunction((d, negation(d0)))})"
            yield f"(= i{n}_{cut} {conjunction((b, negation(b0)))})"

    def _instants(self, cut: int) -> Iterator[str]:
        """One outcome is the latest; what it triggers is the only thing that may not have begun."""
        come = [f"d{n}_{cut}" for n in self.numbers]
        latest = [f"y{n}_{cut}" for n in self.numbers]
        yield f"(= p{cut} {disjunction(come)})"
        yield f"(=> p{cut} {disjunction(latest)})"
        if latest:
            yield f"((_ at-most 1) {' '.join(latest)})"
        yield f"(= g{cut} {disjunction([f'u{n}_{cut}' for n in self.numbers])})"
        for end in (self.automaton.complete, self.automaton.give_up):
            yield negation(self._triggered(end, 2 * cut + 1))
        if cut > 1:
            for n in self.numbers:
                yield f"(=> (and g{cut} d{n}_{cut - 1}) e{n}_{cut})"
                yield f"(or g{cut} (= e{n}_{cut} e{n}_{cut - 1}))"

    def _triggers(self, cut: int) -> Iterator[str]:
        for node, inputs in enumerate(self.automaton.inputs):
            if inputs:
                need = self.automaton.nodes[node].need or 1
                for copy in (2 * cut, 2 * cut + 1):
                    terms = [self._happens(signal, copy) for signal in inputs]
                    yield f"(= t{node}_{copy} {at_least(need, terms)})"

    def _triggered(self, node: int, copy: int) -> str:
        return f"t{node}_{copy}" if self.automaton.inputs[node] else FALSE

    def _happens(self, signal: Signal, copy: int) -> str:
        cut, before = divmod(copy, 2)
        kind = self.automaton.nodes[signal.node].kind
        if kind is NodeKind.START:
            return f"p{cut}" if before else TRUE
        triggered = self._triggered(signal.node, copy)
        if kind is NodeKind.JOIN:
            return triggered
        number = self.automaton.runner_number(signal.node)
        if signal.event is Event.STARTED:
            begun = triggered
            if not before:  # the change itself comes after all of this
                begun = conjunction(
                    (f"b{number}_{cut}", negation(self.changing_start(number, cut)))
                )
            return conjunction((begun, negation(self._will_not_start(number))))
        come = f"{'e' if before else 'd'}{number}_{cut}"
        good = self.encoding.succeeds(number)
        return conjunction((come, good if signal.event is Event.SUCCEEDED else negation(good)))

    def _will_not_start(self, number: int) -> str:
        if not self.encoding.constraints.no_start:
            return FALSE
        return self.encoding.outcome(number, (Outcome.NO_START,))

    # -- what happens between the cuts ----------------------------------------------------------

    def _segment(self, cut: int) -> Iterator[str]:
        """The classes of the events since the cut before, and that of the change."""
        changing: dict[int, list[str]] = {}
        for (event, n), number in self.machine.classes.items():
            if event in (Event.STARTED, Outcome.NO_START):
                silent = self._will_not_start(n)
                kind = negation(silent) if event is Event.STARTED else silent
                changed, new = self.changing_start(n, cut), f"i{n}_{cut}"
                change = conjunction((changed, kind))
            else:
                good = self.encoding.succeeds(n)
                kind = good if event is Event.SUCCEEDED else negation(good)
                changed, new = self.changing_outcome(cut), f"u{n}_{cut}"
                change = conjunction((changed, f"y{n}_{cut}", kind))
                if changed != FALSE:
                    changed = f"(and {changed} y{n}_{cut})"
            if kind == FALSE:
                continue
            yield f"(=> {conjunction((new, kind, negation(changed)))} a{number}_{cut})"
            changing.setdefault(number, []).append(change)
        if cut < self.last:
            for number, terms in changing.items():
                yield f"(=> x{number}_{cut} {disjunction(terms)})"

    def _change(self, cut: int) -> Iterator[str]:
        changes = [f"k{cut}", *(f"c{n}_{cut}" for n in sorted(self._starting))]
        yield f"(= o{cut} {disjunction(changes)})"
        yield f"((_ at-most 1) {' '.join(changes)})"
        yield f"(=> k{cut} g{cut})"
        if cut > 1:
            yield f"(=> o{cut} o{cut - 1})"
        yield f"(or o{cut} (not g{cut}))"
        for n in self.numbers:
            before = self._triggered(self.automaton.runner_node(n), 2 * cut + 1)
            yield f"(or o{cut} (not i{n}_{cut}))"
            yield f"(=> (and k{cut} b{n}_{cut}) {before})"
            if n in self._starting:
                yield f"(=> c{n}_{cut} i{n}_{cut})"
                yield f"(=> (and c{n}_{cut} g{cut}) {negation(before)})"

    def _states(self, cut: int) -> Iterator[str]:
        """The transitions of the state from the cut before."""
        machine = self.machine
        for state, targets in enumerate(machine.targets):
            here = f"z{state}_{cut - 1}"
            bad = [f"a{number}_{cut}" for number, after in targets.items() if state not in after]
            if bad:
                yield f"(=> {here} (not {disjunction(bad)}))"
            if cut == self.last:
                continue
            after = machine.after(state)
            yield f"(=> (and {here} o{cut}) {disjunction([f'z{one}_{cut}' for one in after])})"
            yield f"(=> (and {here} (not o{cut})) z{state}_{cut})"
            for one, classes in after.items():
                why = disjunction([f"x{number}_{cut}" for number in classes])
                yield f"(=> (and {here} z{one}_{cut}) {why})"
        states = [f"z{state}_{cut - 1}" for state in range(machine.size)]
        if cut > 1:
            yield disjunction(states)
        yield f"((_ at-most 1) {' '.join(states)})"
        yield f"(= j{cut - 1} {disjunction([states[state] for state in machine.broken])})"
        yield f"(=> j{cut - 1} (not g{cut}))"
        for n in self.numbers:
            yield f"(=> j{cut - 1} (not i{n}_{cut}))"

    # -- what is asked ----------------------------------------------------------------------------

    def _violations(self) -> Iterator[str]:
        last = self.last
        ends = {End.COMPLETED: self.automaton.complete, End.GAVE_UP: self.automaton.give_up}
        done = {end: self._triggered(node, 2 * last) for end, node in ends.items()}
        pending: list[str] = []
        open_, hanging = [], []
        for n in self.numbers:
            now = self._triggered(self.automaton.runner_node(n), 2 * last)
            pending.append(f"(and {now} (not b{n}_{last}))")
            hangs = self._hangs(n)
            open_.append(conjunction((f"b{n}_{last}", f"(not d{n}_{last})", negation(hangs))))
            hanging.append(f"(and b{n}_{last} (not d{n}_{last}))")
        yield f"(= q0 (not {disjunction(pending)}))"
        yield f"(= q1 (not {disjunction(hanging)}))"
        stuck = [negation(disjunction(open_)), *map(negation, done.values())]
        yield f"(= q2 {conjunction(stuck)})"
        terms: dict[Key, list[str]] = {key: [] for key in self.keys}
        for state, key in self.machine.broken.items():
            terms[key].append(f"z{state}_{self.changes}")
        for state, endings in enumerate(self.machine.ends):
            for (end, hangs_), key in endings.items():
                how = done.get(end) or conjunction(("q2", negation("q1") if hangs_ else "q1"))
                terms[key].append(conjunction((f"z{state}_{self.changes}", "q0", how)))
        for key, name in self.keys.items():
            yield f"(=> {name} {disjunction(terms[key])})"
        for n in self.numbers:
            silent = self._will_not_start(n)
            bad = conjunction((f"d{n}_{last}", negation(self.encoding.succeeds(n))))
            yield f"(= f{n} {disjunction((bad, conjunction((f'b{n}_{last}', silent))))})"

    def _hangs(self, number: int) -> str:
        if not self.encoding.constraints.hang:
            return FALSE
        return self.encoding.outcome(number, (Outcome.HANG,))
