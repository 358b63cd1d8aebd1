"""z3's fixed points about a machine: what no run does, refuted without exploring it.

The configurations that runs reach are the least relation with the first configuration and all
steps from members (Horn clauses over Booleans). z3's Spacer engine looks for an invariant that
excludes what is claimed never to happen. All such claims of one kind are one question.

An instant is a formula: the events are defined in the order of immediate causes, each by those
before it, so that no time within an instant is needed.

That a run goes on for ever is a claim about loops. It becomes one about reaching a configuration:
at some instant the configuration is saved, and the claim is that it comes again after all runners
that were active have come to an end (nobody waits any more).

    A FAILED → A    saved: A active, A waits;  A FAILED: A active again, nobody waits: a loop
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.encode import FALSE, TRUE, at_least, conjunction, disjunction, negation
from gpsfsm.analysis.options import Inconclusive
from gpsfsm.compile.instants import (
    CODES,
    FAILED,
    STARTED,
    STOPPED,
    SUCCEEDED,
    Instants,
    immediate_causes,
)
from gpsfsm.late import pattern
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from gpsfsm.model.automaton import Automaton

State = dict[str, str]
"""A term for each component of a configuration, by the name of the component."""

Events = dict[int, str]
"""A term for each event of an instant that has been looked at: it happens."""

_EVENT = pattern(r"\be\d+\b")


@dataclass(frozen=True, slots=True)
class _After:
    """The state after an instant: terms over the components before it and its events.

    ``definitions`` define the events (``e`` and the number of the event), each by those before it.
    ``moved`` are the runners that come to an end, ``joined`` the joins that fire, are armed again
    or stopped.
    """

    state: State
    definitions: tuple[str, ...]
    moved: Mapping[int, str]
    joined: Mapping[int, str]


class Fixpoint:
    """Questions about all runs of a machine. ``allowed``: per runner the possible outcomes."""

    def __init__(
        self, automaton: Automaton, allowed: Sequence[Collection[Outcome]], *, rlimit: int
    ) -> None:
        import networkx

        self.automaton = automaton
        self.allowed = allowed
        self.rlimit = rlimit
        causes = immediate_causes(automaton)
        self.order = tuple(networkx.lexicographical_topological_sort(causes))
        self.inputs = Instants(automaton).inputs
        self.runners = range(len(automaton.runners))
        joins = [node.index for node in automaton.nodes if node.kind is NodeKind.JOIN]
        self.hangs = any(Outcome.HANG in outcomes for outcomes in allowed)
        names = [f"a{number}" for number in self.runners]
        names += [f"h{number}" for number in self.runners] if self.hangs else []
        names += [f"i{place}" for place in range(len(self.inputs))]
        self.names = (*names, *(f"f{node}" for node in joins), "completed", "gave_up")
        self._stops: dict[int, list[int]] = {}
        self._triggers: dict[int, list[int]] = {}
        for kept, edges in ((self._stops, automaton.stops), (self._triggers, automaton.edges)):
            for source, event, target in edges:
                kept.setdefault(target, []).append(source * 4 + CODES[event])
        plain = {name: name for name in self.names}
        self.first = self._instant(
            dict.fromkeys(self.names, FALSE),
            [start * 4 + SUCCEEDED for start in automaton.starts],
            {},
        )
        self.steps: dict[tuple[int, Outcome], _After] = {}
        for number in self.runners:
            idle = plain | {f"a{number}": FALSE}
            code = automaton.runner_node(number) * 4
            for outcome in sorted(allowed[number]):
                if outcome is Outcome.HANG:
                    after = _After(idle | {f"h{number}": TRUE}, (), {number: TRUE}, {})
                else:
                    emitted = code + (SUCCEEDED if outcome is Outcome.SUCCEEDED else FAILED)
                    after = self._instant(idle, [emitted], {number: TRUE})
                self.steps[number, outcome] = after

    # -- one instant ------------------------------------------------------------------------

    def _instant(self, before: State, causes: Sequence[int], moved: dict[int, str]) -> _After:
        state = dict(before)
        joined: dict[int, str] = {}
        happens = dict.fromkeys(causes, TRUE)
        definitions: list[str] = []
        for vertex in self.order:
            node, code = divmod(vertex, 4)
            stopped = self._any_of(self._stops, node, happens)
            if code == SUCCEEDED:
                term, joined[node] = self._join(state, node, stopped, happens)
            else:
                number = self.automaton.runner_number(node)
                term = self._runner(state, number, stopped, happens, starts=code == STARTED)
                if code == STOPPED:
                    moved[number] = disjunction((moved.get(number, FALSE), term))
            if term not in (TRUE, FALSE):
                definitions.append(f"(= e{vertex} {term})")
                term = f"e{vertex}"
            happens[vertex] = term
        going = negation(disjunction((before["completed"], before["gave_up"])))
        gives_up = self._any_of(self._triggers, self.automaton.give_up, happens)
        completes = self._any_of(self._triggers, self.automaton.complete, happens)
        completed = conjunction((completes, negation(gives_up), going))
        state["completed"] = disjunction((before["completed"], completed))
        state["gave_up"] = disjunction((before["gave_up"], conjunction((gives_up, going))))
        return _After(state, tuple(definitions), moved, joined)

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

    # -- what is asked ----------------------------------------------------------------------

    def ever(self, claims: Iterable[str]) -> bool:
        """True if a run reaches a configuration in which one of the claims holds.

        Raises Inconclusive at the limit.
        """
        rules = self._rules(self.names, {}, {})
        rules += [f"(rule (=> (and {_reach(self.names)} {claim}) bad))" for claim in claims]
        return self._answer(self.names, rules)

    def orphaned(self, numbers: Iterable[int]) -> bool:
        """True if one of these is active, or hangs, after an instant of completion."""
        names = (*self.names, "just")
        now = {outcome: after.state["completed"] for outcome, after in self.steps.items()}
        just = {key: conjunction((term, "(not completed)")) for key, term in now.items()}
        rules = self._rules(
            names,
            {"just": self.first.state["completed"]},
            {key: {"just": term} for key, term in just.items()},
        )
        acting = disjunction(
            name for number in numbers for name in (f"a{number}", f"h{number}") if name in names
        )
        rules.append(f"(rule (=> (and {_reach(names)} just {acting}) bad))")
        return self._answer(names, rules)

    def endless(self, *, fair: bool = False, join: int | None = None, going: bool = True) -> bool:
        """True if a run goes on for ever without an end; ``fair``: a fair one.

        With a ``join``: one in which it has inputs and neither fires nor is armed from some instant
        on. Without ``going``: whether the run has ended or not.
        """
        copies = {f"c_{name}": name for name in self.names}
        waits = {f"w{number}": f"a{number}" for number in self.runners}
        taken = {
            f"g{number}_{outcome}": (number, outcome)
            for number in self.runners
            for outcome in self.allowed[number]
            if fair and outcome is not Outcome.HANG
        }
        names = (*self.names, "saved", "stepped", *copies, *waits, *taken)
        nothing = dict.fromkeys(names[len(self.names) :], FALSE)
        updates: dict[tuple[int, Outcome], State] = {}
        for key, after in self.steps.items():
            update = {name: name for name in nothing} | {"stepped": "saved"}
            for number in self.runners:
                moved = after.moved.get(number, FALSE)
                parts = (f"w{number}", after.state[f"a{number}"], negation(moved))
                update[f"w{number}"] = conjunction(parts)
            if f"g{key[0]}_{key[1]}" in taken:
                update[f"g{key[0]}_{key[1]}"] = "saved"
            updates[key] = update
        guards = {
            key: disjunction(("(not saved)", negation(after.joined.get(join, FALSE))))
            for key, after in self.steps.items()
            if join is not None
        }
        rules = self._rules(names, nothing, updates, guards)
        saves = ["(not saved)"]
        saves += ["(not completed)", "(not gave_up)"] if going else []
        saves += [self.partial(join)] if join is not None else []
        after_saving = {name: name for name in names} | copies | waits | {"saved": TRUE}
        rules.append(
            f"(rule (=> (and {_reach(names)} {' '.join(saves)}) "
            f"{_reach(after_saving[name] for name in names)}))"
        )
        closed = [f"(= {copy} {name})" for copy, name in copies.items()]
        closed += [f"(not {name})" for name in waits]
        for number in self.runners if fair else ():
            seen = [name for name, (each, _) in taken.items() if each == number]
            closed += [f"(= {one} {other})" for one, other in pairwise(seen)]
        rules.append(f"(rule (=> (and {_reach(names)} saved stepped {' '.join(closed)}) bad))")
        return self._answer(names, rules)

    @property
    def still(self) -> str:
        """Nothing is active."""
        return negation(disjunction(f"a{number}" for number in self.runners))

    def partial(self, join: int) -> str:
        """A join has inputs and has not fired."""
        places = [f"i{place}" for place, (_, node) in enumerate(self.inputs) if node == join]
        return conjunction((disjunction(places), f"(not f{join})"))

    # -- the text for z3 --------------------------------------------------------------------

    def _rules(
        self,
        names: Sequence[str],
        first: State,
        updates: Mapping[tuple[int, Outcome], State],
        guards: Mapping[tuple[int, Outcome], str] = MappingProxyType({}),
    ) -> list[str]:
        """The rules of the runs; ``first`` and ``updates`` are for names that are not ours."""
        start = self.first.state | first
        rules = [_rule(self.first.definitions, _reach(start[name] for name in names))]
        for key, after in self.steps.items():
            state = after.state | updates.get(key, {})
            body = [_reach(names), f"a{key[0]}", guards.get(key, TRUE), *after.definitions]
            rules.append(_rule(body, _reach(state[name] for name in names)))
        return rules

    def _answer(self, names: Sequence[str], rules: Sequence[str]) -> bool:
        import z3

        text = "\n".join(rules)
        events = dict.fromkeys(_EVENT.findall(text))
        declarations = "".join(f"(declare-var {name} Bool)" for name in (*names, *events))
        sorts = " ".join("Bool" for _ in names)
        program = f"(declare-rel reach ({sorts}))(declare-rel bad ()){declarations}\n{text}"
        engine: Any = z3.Fixedpoint()
        engine.set(engine="spacer", rlimit=self.rlimit)
        query = engine.parse_string(f"{program}\n(query bad)")
        try:
            answer = engine.query(query[0])
        except z3.Z3Exception:  # the limit of steps
            raise Inconclusive from None
        if answer == z3.unknown:
            raise Inconclusive
        return bool(answer == z3.sat)


def _reach(terms: Iterable[str]) -> str:
    return f"(reach {' '.join(terms)})"


def _rule(body: Iterable[str], head: str) -> str:
    return f"(rule (=> {conjunction(body)} {head}))"
