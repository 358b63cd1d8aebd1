"""z3's fixed points about a machine: what no run does, refuted without exploring it.

The configurations that runs reach are the least relation with the first configuration and all
steps from members (Horn clauses over Booleans). z3's Spacer engine looks for an invariant that
excludes what is claimed never to happen. All such claims of one kind are one question. That takes
much longer than the proof of an exploration (``benchmarks/machines.py``), and needs none.

That a run goes on for ever is a claim about loops. It becomes one about reaching a configuration:
at some instant the configuration is saved, and the claim is that it comes again after all runners
that were active have come to an end (nobody waits any more).

    A FAILED → A    saved: A active, A waits;  A FAILED: A active again, nobody waits: a loop
"""

from __future__ import annotations

from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.encode import FALSE, TRUE, conjunction, disjunction, negation
from gpsfsm.analysis.machines.proof import EVENT, Formulas, State
from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from gpsfsm.model.automaton import Automaton


class Fixpoint(Formulas):
    """Questions about all runs of a machine. ``allowed``: per runner the possible outcomes."""

    def __init__(
        self, automaton: Automaton, allowed: Sequence[Collection[Outcome]], *, rlimit: int
    ) -> None:
        super().__init__(automaton, allowed)
        self.rlimit = rlimit

    # -- what is asked ----------------------------------------------------------------------

    def ever(self, claims: Iterable[str]) -> bool:
        """True if a run reaches a configuration in which one of the claims holds.

        Raises InconclusiveError at the limit.
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
        events = dict.fromkeys(EVENT.findall(text))
        declarations = "".join(f"(declare-var {name} Bool)" for name in (*names, *events))
        sorts = " ".join("Bool" for _ in names)
        program = f"(declare-rel reach ({sorts}))(declare-rel bad ()){declarations}\n{text}"
        engine: Any = z3.Fixedpoint()
        engine.set(engine="spacer", rlimit=self.rlimit)
        query = engine.parse_string(f"{program}\n(query bad)")
        try:
            answer = engine.query(query[0])
        except z3.Z3Exception:  # the limit of steps
            raise InconclusiveError from None
        if answer == z3.unknown:
            raise InconclusiveError
        return bool(answer == z3.sat)


def _reach(terms: Iterable[str]) -> str:
    return f"(reach {' '.join(terms)})"


def _rule(body: Iterable[str], head: str) -> str:
    return f"(rule (=> {conjunction(body)} {head}))"
