"""z3's proof of an exploration: there is no configuration and no step but those that were explored.

What a machine never does is what no run through the explored configurations does, provided that
nothing was missed. The exploration plays instants by a program (``compile/instants.py``). z3 gets
the same instants as formulas: the events are defined in the order of immediate causes, each by
those before it, so that no time within an instant is needed. And it gets a table of what was
explored. One question says all at once: is the first configuration another one; is there a listed
configuration from which a step leads elsewhere than listed, or ends another visit, or moves another
join; or does a listed one show what is claimed never to happen? If z3 refutes it, the listed
configurations are an inductive invariant, and the graph on which all facts are read is complete.

``p7`` says that the run is in configuration 7. A component of the configuration after a step is
mostly what it was before, so that only the rows in which it changes are named:

    0: a active    1: nothing active, completed      step a SUCCEEDED: 0 → 1
    p0 implies a0, not completed;  p1 implies not a0, completed;  p0 or p1 holds
    wrong: a0 and (completed after the step differs from (completed xor p0))
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.encode import FALSE, TRUE, at_least, conjunction, disjunction, negation
from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.analysis.solver import PER_CHARACTER, add_text
from gpsfsm.compile.instants import (
    CODES,
    COMPLETED,
    FAILED,
    GAVE_UP,
    STARTED,
    STOPPED,
    SUCCEEDED,
    Instants,
    bits,
    immediate_causes,
)
from gpsfsm.errors import InternalError
from gpsfsm.late import pattern
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.event import Outcome
from gpsfsm.workers import Z3_MB, require_memory

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from gpsfsm.analysis.machines.search import Exploration, Step
    from gpsfsm.compile.instants import Configuration
    from gpsfsm.model.automaton import Automaton, Tie

State = dict[str, str]
"""A term for each component of a configuration, by the name of the component."""

Events = dict[int, str]
"""A term for each event of an instant that has been looked at: it happens."""

EVENT = pattern(r"\be\d+\b")


@dataclass(frozen=True, slots=True)
class After:
    """The state after an instant: terms over the components before it and its events.

    ``definitions`` define the events (``e`` and the number of the event), each by those before it.
    ``moved`` are the runners that come to an end, ``joined`` the joins that fire, are armed again
    or stopped.
    """

    state: State
    definitions: tuple[str, ...]
    moved: Mapping[int, str]
    joined: Mapping[int, str]


class Formulas:
    """The instants of a machine as formulas. ``allowed``: per runner the possible outcomes.

    Of the tie with number t, ``k<t>``: its outcome is fixed, and ``v<t>``: it is SUCCEEDED; without
    ``k<t>`` no outcome counts now.
    """

    def __init__(
        self,
        automaton: Automaton,
        allowed: Sequence[Collection[Outcome]],
        ties: Sequence[Tie] = (),
    ) -> None:
        import networkx

        self.automaton = automaton
        self.allowed = allowed
        self.ties = ties
        causes = immediate_causes(automaton)
        self.order = tuple(networkx.lexicographical_topological_sort(causes))
        self.inputs = Instants(automaton).inputs
        self.runners = range(len(automaton.runners))
        joins = [node.index for node in automaton.nodes if node.kind is NodeKind.JOIN]
        self.hangs = any(Outcome.HANG in outcomes for outcomes in allowed)
        names = [f"a{number}" for number in self.runners]
        names += [f"h{number}" for number in self.runners] if self.hangs else []
        names += [f"i{place}" for place in range(len(self.inputs))]
        names += [f"f{node}" for node in joins]
        names += [name for place in range(len(ties)) for name in (f"k{place}", f"v{place}")]
        self.names = (*names, "completed", "gave_up")
        self._stops: dict[int, list[int]] = {}
        self._triggers: dict[int, list[int]] = {}
        for kept, edges in ((self._stops, automaton.stops), (self._triggers, automaton.edges)):
            for source, event, target in edges:
                kept.setdefault(target, []).append(source * 4 + CODES[event])
        self._effects: dict[int, list[int]] = {}  # what an event is an immediate cause of
        for edges, caused in ((automaton.stops, STOPPED), (automaton.edges, STARTED)):
            for source, event, target in edges:
                what = SUCCEEDED if automaton.nodes[target].kind is NodeKind.JOIN else caused
                effects = self._effects.setdefault(source * 4 + CODES[event], [])
                effects.append(target * 4 + what)
        self.first = self._instant(
            dict.fromkeys(self.names, FALSE),
            [start * 4 + SUCCEEDED for start in automaton.starts],
            {},
        )
        self.steps = {
            (number, outcome): self.after(number, outcome)
            for number in self.runners
            for outcome in sorted(allowed[number])
        }

    # -- one instant ------------------------------------------------------------------------

    def after(self, number: int, outcome: Outcome) -> After:
        """The state after a runner had this outcome, over the components before."""
        idle = {name: name for name in self.names} | {f"a{number}": FALSE}
        if outcome is Outcome.HANG:
            return After(idle | {f"h{number}": TRUE}, (), {number: TRUE}, {})
        event = SUCCEEDED if outcome is Outcome.SUCCEEDED else FAILED
        emitted = self.automaton.runner_node(number) * 4 + event
        return self._instant(idle, [emitted], {number: TRUE})

    def possible(self, number: int, outcome: Outcome) -> str:
        """The tie of a runner, if it has one, does not rule out this outcome."""
        for place, tie in enumerate(self.ties):
            if number in tie.runners and outcome is not Outcome.HANG:
                value = f"v{place}" if outcome is Outcome.SUCCEEDED else negation(f"v{place}")
                return disjunction((negation(f"k{place}"), value))
        return TRUE

    def _instant(self, before: State, causes: Sequence[int], moved: dict[int, str]) -> After:
        state = dict(before)
        joined: dict[int, str] = {}
        happens = dict.fromkeys(causes, TRUE)
        definitions: list[str] = []
        touched = {effect for cause in causes for effect in self._effects.get(cause, ())}
        for vertex in self.order:
            if vertex not in touched:  # it has no cause at this instant, and stays as it was
                continue
            node, code = divmod(vertex, 4)
            stopped = self._any_of(self._stops, node, happens)
            if code == SUCCEEDED:
                term, joined[node] = self._join(state, node, stopped, happens)
            else:
                number = self.automaton.runner_number(node)
                term = self._runner(state, number, stopped, happens, starts=code == STARTED)
                if code == STOPPED:
                    moved[number] = disjunction((moved.get(number, FALSE), term))
            if term != FALSE:
                touched.update(self._effects.get(vertex, ()))
            if term not in (TRUE, FALSE):
                definitions.append(f"(= e{vertex} {term})")
                term = f"e{vertex}"
            happens[vertex] = term
        for place in range(len(self.ties)):
            self._tied(place, state, causes, happens, moved)
        going = negation(disjunction((before["completed"], before["gave_up"])))
        gives_up = self._any_of(self._triggers, self.automaton.give_up, happens)
        completes = self._any_of(self._triggers, self.automaton.complete, happens)
        completed = conjunction((completes, negation(gives_up), going))
        state["completed"] = disjunction((before["completed"], completed))
        state["gave_up"] = disjunction((before["gave_up"], conjunction((gives_up, going))))
        return After(state, tuple(definitions), moved, joined)

    def _any_of(self, causes: Mapping[int, list[int]], node: int, happens: Events) -> str:
        """Some event happens whose connection leads to the node."""
        return disjunction(happens.get(event, FALSE) for event in causes.get(node, ()))

    def _runner(
        self, state: State, number: int, stopped: str, happens: Events, *, starts: bool
    ) -> str:
        """A runner is stopped, or else triggered."""
        active, hanging = state[f"a{number}"], state.get(f"h{number}", FALSE)
        if starts:
            triggered = self._any_of(self._triggers, self.automaton.runner_node(number), happens)
            state[f"a{number}"] = disjunction((active, conjunction((triggered, negation(hanging)))))
            return conjunction((triggered, negation(active), negation(hanging)))
        state[f"a{number}"] = conjunction((active, negation(stopped)))
        if self.hangs:
            state[f"h{number}"] = conjunction((hanging, negation(stopped)))
        return conjunction((stopped, disjunction((active, hanging))))

    def _join(self, state: State, node: int, stopped: str, happens: Events) -> tuple[str, str]:
        """A join at an instant: it fires; it fires, is armed again or stopped."""
        fired = conjunction((state[f"f{node}"], negation(stopped)))
        arrived: State = {}
        for place, (signal, join) in enumerate(self.inputs):
            if join == node:
                comes = happens.get(signal.node * 4 + CODES[signal.event], FALSE)
                earlier = conjunction((state[f"i{place}"], negation(stopped)))
                arrived[f"i{place}"] = disjunction((earlier, comes))
        terms = list(arrived.values())
        enough = at_least(self.automaton.nodes[node].need, terms) if terms else FALSE
        fires = conjunction((enough, negation(fired)))
        fired = disjunction((fired, fires))
        armed = conjunction((fired, *terms))
        state |= {name: conjunction((term, negation(armed))) for name, term in arrived.items()}
        state[f"f{node}"] = conjunction((fired, negation(armed)))
        return fires, disjunction((fires, armed, stopped))

    def _tied(
        self,
        place: int,
        state: State,
        causes: Sequence[int],
        happens: Events,
        moved: Mapping[int, str],
    ) -> None:
        """A tie at an instant, whose other components are those after it already."""
        tie, (fixed, value) = self.ties[place], (f"k{place}", f"v{place}")
        resets, at_once = [], []
        for (node, event), before in tie.resets:
            resets.append(happens.get(node * 4 + CODES[event], FALSE))
            starts = [self.automaton.runner_node(number) * 4 + STARTED for number in before]
            first = disjunction(happens.get(start, FALSE) for start in starts)
            at_once.append(conjunction((resets[-1], first)))
        unsure = conjunction((negation(state[fixed]), state[value]))
        writers = disjunction(
            term
            for number in tie.writers
            for term in (
                state[f"a{number}"],
                state.get(f"h{number}", FALSE),
                moved.get(number, FALSE),
            )
        )
        keeps = negation(disjunction((unsure, *resets, writers)))
        active = disjunction(state[f"a{number}"] for number in tie.runners)
        unsure = conjunction((disjunction((unsure, *at_once)), active))
        nodes = {self.automaton.runner_node(number) for number in tie.runners}
        emitted = [cause % 4 for cause in causes if cause // 4 in nodes]
        said = state[value] if not emitted else TRUE if emitted[0] == SUCCEEDED else FALSE
        keeps = conjunction((keeps, TRUE if emitted else state[fixed]))
        state[fixed] = keeps
        state[value] = disjunction((conjunction((keeps, said)), unsure))

    @property
    def still(self) -> str:
        """Nothing is active."""
        return negation(disjunction(f"a{number}" for number in self.runners))


_OUTCOMES = {Outcome.SUCCEEDED: SUCCEEDED, Outcome.FAILED: FAILED, Outcome.HANG: 3}


class Completeness:
    """The question whether an exploration is complete and right, and z3's answer to it."""

    def __init__(self, exploration: Exploration, formulas: Formulas) -> None:
        self.exploration = exploration
        self.formulas = formulas
        self.rows = [self._row(each) for each in exploration.configurations]
        self.asserted: list[str] = []

    def require(self, claims: Iterable[str], *, rlimit: int) -> None:
        """Have z3 refute that anything was missed, or that a claim ever holds.

        Raises InconclusiveError at the limit of steps, and InternalError if z3 does not refute it.
        """
        require_memory(Z3_MB, module="z3")
        import z3

        text = self.text(claims)
        rlimit -= PER_CHARACTER * len(text)
        if rlimit <= 0:
            raise InconclusiveError
        solver: Any = z3.SolverFor("QF_FD")
        solver.set("random_seed", 0)
        solver.set("rlimit", rlimit)
        solver.set("ctrl_c", False)
        add_text(solver, text)
        answer = solver.check()
        if answer == z3.sat:
            raise InternalError("z3 and the search disagree about the runs of this machine")
        if answer != z3.unsat:
            raise InconclusiveError

    def text(self, claims: Iterable[str]) -> str:
        """The question, in SMT-LIB."""
        places = [f"p{at}" for at in range(len(self.rows))]
        wrong = [self._wrong_first()]
        wrong += (self._wrong_steps(*key) for key in self.formulas.steps)
        others: dict[tuple[int, int], dict[int, int]] = {}
        for (at, number, outcome), target in self.exploration.others.items():
            others.setdefault((number, outcome), {})[at] = target
        wrong += (self._wrong_others(*key, targets) for key, targets in others.items())
        runs = disjunction(places[: self.exploration.reached])
        wrong += (conjunction((runs, claim)) for claim in claims)
        names = self.formulas.names
        lines = [f"(declare-const {name} Bool)" for name in (*names, *places)]
        for place, row in zip(places, self.rows, strict=True):
            literals = (
                name if value else negation(name) for name, value in zip(names, row, strict=True)
            )
            lines.append(f"(assert (=> {place} {conjunction(literals)}))")
        lines.append(f"(assert {disjunction(places)})")
        lines += self.asserted
        lines.append(f"(assert {disjunction(wrong)})")
        return "\n".join(lines)

    def _row(self, configuration: Configuration) -> tuple[bool, ...]:
        """The components of a configuration, in the order of the formulas' names."""
        instants, runners = self.exploration.instants, self.formulas.runners
        active, hanging, arrived, fired, ended, said = configuration
        row = [bool(active >> number & 1) for number in runners]
        if self.formulas.hangs:
            row += [bool(hanging >> number & 1) for number in runners]
        row += [bool(arrived >> place & 1) for place in range(len(instants.inputs))]
        row += [bool(fired >> place & 1) for place in range(len(instants.joins))]
        row += [bool(said >> place & 1) for place in range(2 * len(instants.ties))]
        return (*row, ended == COMPLETED, ended == GAVE_UP)

    def _wrong_first(self) -> str:
        """The first configuration is another one."""
        after = self._named(self.formulas.first, "first")
        return disjunction(
            negation(after.state[name]) if value else after.state[name]
            for name, value in zip(self.formulas.names, self.rows[0], strict=True)
        )

    def _wrong_steps(self, number: int, outcome: Outcome) -> str:
        """A step with this outcome leads elsewhere, or ends or moves something else."""
        after = self._named(self.formulas.steps[number, outcome], f"{number}{outcome[0]}")
        code = _OUTCOMES[outcome]
        steps = [
            (at, step)
            for at, each in enumerate(self.exploration.steps)
            for step in each
            if step.number == number and step.outcome == code
        ]
        targets = {at: step.target for at, step in steps}
        wrong = [*self._wrong_targets(targets, after), *self._wrong_marks(steps, after, number)]
        possible = self.formulas.possible(number, outcome)
        if possible == TRUE:
            return conjunction((f"a{number}", disjunction(wrong)))
        # A step that is listed though it cannot be is wrong, too; one that cannot be is left out.
        listed = disjunction(f"p{at}" for at in targets)
        missed = conjunction((f"a{number}", possible, disjunction(wrong)))
        return disjunction((missed, conjunction((listed, negation(possible)))))

    def _wrong_others(self, number: int, code: int, targets: Mapping[int, int]) -> str:
        """An outcome that is only compared with would lead elsewhere."""
        outcome = Outcome.SUCCEEDED if code == SUCCEEDED else Outcome.FAILED
        after = self._named(self.formulas.after(number, outcome), f"{number}{outcome[0]}o")
        wrong = disjunction(self._wrong_targets(targets, after))
        return conjunction((disjunction(f"p{at}" for at in targets), wrong))

    def _wrong_targets(self, targets: Mapping[int, int], after: After) -> Iterator[str]:
        for column, name in enumerate(self.formulas.names):
            changed = [
                f"p{at}"
                for at, target in targets.items()
                if self.rows[at][column] != self.rows[target][column]
            ]
            term = after.state[name]
            if term != name or changed:
                yield _differs(term, _differs(name, disjunction(changed)))

    def _wrong_marks(
        self, steps: list[tuple[int, Step]], after: After, number: int
    ) -> Iterator[str]:
        """Other visits come to an end, or other joins fire, are armed or stopped, than listed."""
        moved: dict[int, list[str]] = {}
        joined: dict[int, list[str]] = {}
        for at, step in steps:
            for marks, kept in ((step.moved, moved), (step.joined, joined)):
                for mark in bits(marks):
                    kept.setdefault(mark, []).append(f"p{at}")
        for other in self.formulas.runners:
            term = after.moved.get(other, FALSE)
            listed = TRUE if other == number else disjunction(moved.get(other, ()))
            if term != listed:
                yield _differs(term, listed)
        for place, join in enumerate(self.exploration.instants.joins):
            term, listed = after.joined.get(join, FALSE), disjunction(joined.get(place, ()))
            if term != listed:
                yield _differs(term, listed)

    def _named(self, after: After, suffix: str) -> After:
        """The same with events of its own: each instant has others."""
        events: dict[str, None] = {}
        for definition in after.definitions:
            events |= dict.fromkeys(EVENT.findall(definition))

        def renamed(term: str) -> str:
            return EVENT.sub(lambda match: f"{match[0]}_{suffix}", term)

        self.asserted += [f"(declare-const {event}_{suffix} Bool)" for event in events]
        self.asserted += [f"(assert {renamed(each)})" for each in after.definitions]
        return After(
            {name: renamed(term) for name, term in after.state.items()},
            (),
            {number: renamed(term) for number, term in after.moved.items()},
            {join: renamed(term) for join, term in after.joined.items()},
        )


def _differs(one: str, other: str) -> str:
    if FALSE in (one, other):
        return one if other == FALSE else other
    if TRUE in (one, other):
        return negation(one if other == TRUE else other)
    return f"(xor {one} {other})"
