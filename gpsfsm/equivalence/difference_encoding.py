"""Differences of two plans as a problem for z3: a set of outcomes that tells them apart.

What has been triggered at some moment depends on the set of outcomes that have come by then, not
on their order (semantics, 4.3). So one Boolean per role and outcome stands for all orders. A
difference is a role that is triggered in one plan alone, or an end that is reached in one alone.

Symbols: ``s`` and ``f`` with a moment (0 before the last outcome, 1 after it) and a role: it has
succeeded, failed; ``x`` and ``y`` of a role: that is the last outcome. ``t`` with moment, plan and
node: it is triggered. ``k`` kind: actions of this kind succeed; ``o`` instance: so it does in the
scenario of its plan. ``g``: a goal, something that differs.

Example: ``A; B`` and ``A``. A is role 0 in both, B is role 1 in the first plan alone. A's success
(s1_0) triggers B's node in the first plan (t1_0_2) and completion in the second (t1_1_2):
the set {A succeeds} tells the plans apart.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.encode import at_least, conjunction, disjunction
from gpsfsm.analysis.solver import add_text
from gpsfsm.equivalence.pairs import OUTCOMES
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.event import Event
from gpsfsm.workers import Z3_MB, require_memory

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.equivalence.admission import Admission
    from gpsfsm.equivalence.pairs import Sides
    from gpsfsm.equivalence.proof import Roles
    from gpsfsm.model.automaton import Automaton, Signal

_BEFORE, _AFTER = 0, 1
_BATCH = 16

RoleOutcome = tuple[int, Event]
"""A role and its outcome."""


class LimitError(Exception):
    """Z3 met its limit."""


class Question:
    """One problem text for the roles that are known by now.

    With ``stops`` there are two moments, before and after the last outcome, and nothing has ended
    before it. Without, an end stops nothing: there are more sets, but the question is simpler.
    """

    def __init__(self, sides: Sides, roles: Roles, *, rlimit: int, stops: bool) -> None:
        require_memory(Z3_MB, module="z3")
        import z3

        self._z3: Any = z3
        self._context: Any = z3.Context()  # the answers do not depend on what was asked before
        self._sides = sides
        self._roles = roles
        self._members: dict[int, tuple[list[int], list[int]]] = {}
        for side, kinds in enumerate(sides.kinds):
            for number in range(len(kinds)):
                members = self._members.setdefault(roles.of(side, number), ([], []))
                members[side].append(number)
        self._every = [(role, event) for role in self._members for event in OUTCOMES]
        self._symbols: dict[str, Any] = {}
        self._solver: Any = z3.SolverFor("QF_FD", ctx=self._context)
        self._solver.set("random_seed", 0)
        self._solver.set("rlimit", rlimit)
        self._solver.set("ctrl_c", False)
        self.outcomes: set[RoleOutcome] = set()
        self.last: RoleOutcome | None = None
        self._stops = stops
        self._count = 0
        terms = [*self._events(), *self._triggers()]
        if stops:
            terms += self._last_outcome()
        if sides.consistent:
            terms += self._same_outcomes()
        if sides.admission is not None:
            terms += self._admitted(sides.admission)
        self._goals = []
        for number, term in enumerate(self._differences()):
            self._goals.append(self._name(f"g{number}"))
            terms.append(f"(=> {self._goals[-1]} {term})")
        declared = "".join(f"(declare-const {name} Bool)" for name in self._symbols)
        add_text(self._solver, declared + "\n".join(f"(assert {term})" for term in terms))

    # -- the problem --------------------------------------------------------------------------

    def _name(self, name: str) -> str:
        if name not in self._symbols:
            self._symbols[name] = self._z3.Bool(name, self._context)
        return name

    def _event(self, moment: int, outcome: RoleOutcome) -> str:
        """The outcome has come."""
        role, event = outcome
        return self._name(f"{'s' if event is Event.SUCCEEDED else 'f'}{moment}_{role}")

    def _is_last(self, outcome: RoleOutcome) -> str:
        role, event = outcome
        return self._name(f"{'x' if event is Event.SUCCEEDED else 'y'}{role}")

    def _triggered(self, moment: int, side: int, node: int) -> str:
        return self._name(f"t{moment}_{side}_{node}")

    def _automaton(self, side: int) -> Automaton:
        return (self._sides.first, self._sides.second)[side].compiled.automaton

    def _happens(self, moment: int, side: int, signal: Signal) -> str:
        automaton = self._automaton(side)
        kind = automaton.nodes[signal.node].kind
        if kind is NodeKind.START:
            return "true"
        triggered = self._triggered(moment, side, signal.node)
        if kind is NodeKind.JOIN:
            return triggered
        role = self._roles.of(side, automaton.runner_number(signal.node))
        return conjunction((triggered, self._event(moment, (role, signal.event))))

    def _triggers(self) -> Iterator[str]:
        for side in (0, 1):
            automaton = self._automaton(side)
            for node, inputs in enumerate(automaton.inputs):
                if node == 0:
                    continue
                need = automaton.nodes[node].need or 1
                for moment in (_BEFORE, _AFTER) if self._stops else (_AFTER,):
                    terms = [self._happens(moment, side, signal) for signal in inputs]
                    yield f"(= {self._triggered(moment, side, node)} {at_least(need, terms)})"

    def _role_triggered(self, moment: int, side: int, role: int) -> str:
        node = self._automaton(side).runner_node
        return disjunction(
            self._triggered(moment, side, node(number)) for number in self._members[role][side]
        )

    def _events(self) -> Iterator[str]:
        """Outcomes come to what has been triggered, one to each."""
        for role in self._members:
            active = self._role_triggered(_BEFORE if self._stops else _AFTER, 0, role)
            names = [self._event(_AFTER, (role, event)) for event in OUTCOMES]
            yield from (f"(=> {name} {active})" for name in names)
            yield f"(not (and {' '.join(names)}))"

    def _last_outcome(self) -> Iterator[str]:
        """Exactly one outcome is the last, and nothing has ended before it."""
        last: list[str] = []
        for outcome in self._every:
            before, after = self._event(_BEFORE, outcome), self._event(_AFTER, outcome)
            last.append(self._is_last(outcome))
            yield f"(= {after} (or {before} {last[-1]}))"
            yield f"(not (and {before} {last[-1]}))"
        yield disjunction(last)
        yield f"((_ at-most 1) {' '.join(last)})"
        for side in (0, 1):
            for end in self._ends(side):
                yield f"(not {self._triggered(_BEFORE, side, end)})"

    def _same_outcomes(self) -> Iterator[str]:
        for role, members in self._members.items():
            if members[0]:
                good = self._name(f"k{self._sides.kinds[0][members[0][0]]}")
                yield f"(=> {self._event(_AFTER, (role, Event.SUCCEEDED))} {good})"
                yield f"(=> {self._event(_AFTER, (role, Event.FAILED))} (not {good}))"

    def _admitted(self, admission: Admission) -> Iterator[str]:
        """The terms by which what has come is part of an admitted scenario, in either plan.

        The outcome of a role is that of one of its instances that has been triggered.
        """
        for side in (0, 1):
            yield from admission.terms(side, partial(self._good, side))
            node = self._automaton(side).runner_node
            for role, members in self._members.items():
                for event in OUTCOMES:
                    terms = []
                    for number in members[side]:
                        triggered = self._triggered(_AFTER, side, node(number))
                        terms.append(conjunction((triggered, self._has(side, number, event))))
                    if members[0]:
                        has_come = self._event(_AFTER, (role, event))
                        yield f"(=> {has_come} {disjunction(terms)})"

    def _good(self, side: int, number: int) -> str:
        """In the scenario of this plan the instance succeeds."""
        return self._name(f"o{side}_{number}")

    def _has(self, side: int, number: int, event: Event) -> str:
        """The scenario of this plan gives the instance this outcome."""
        admission = self._sides.admission
        assert admission is not None
        if not admission.permits(side, number, event):
            return "false"
        if not admission.tied(side, number):
            return "true"
        good = self._good(side, number)
        return good if event is Event.SUCCEEDED else f"(not {good})"

    def _differences(self) -> Iterator[str]:
        """The signs that the plans differ, or that roles prove nothing; causes come first."""
        for role, members in sorted(self._members.items()):
            mine, theirs = (self._role_triggered(_AFTER, side, role) for side in (0, 1))
            together = [each for side in (0, 1) for each in self._together(side, members[side])]
            yield disjunction([f"(not (= {mine} {theirs}))", *together])
        for first, second in zip(self._ends(0), self._ends(1), strict=True):
            mine, theirs = (self._triggered(_AFTER, s, n) for s, n in ((0, first), (1, second)))
            yield f"(not (= {mine} {theirs}))"

    def _ends(self, side: int) -> tuple[int, int]:
        return self._automaton(side).complete, self._automaton(side).give_up

    def _together(self, side: int, members: Sequence[int]) -> list[str]:
        """Two instances of one plan in one role are triggered: then roles prove nothing."""
        if len(members) <= 1:
            return []
        node = self._automaton(side).runner_node
        names = [self._triggered(_AFTER, side, node(number)) for number in members]
        return [f"((_ at-least 2) {' '.join(names)})"]

    # -- the answers ----------------------------------------------------------------------------

    def differs(self) -> bool:
        """True if a set of outcomes tells the plans apart; it is kept. Raises LimitError.

        Asked in the order of the plan, so that what is known of causes helps with what follows.
        """
        for place in range(0, len(self._goals), _BATCH):
            batch = self._goals[place : place + _BATCH]
            if self._check(self._any_of(batch)):
                return True
            self._solver.add(*(self._z3.Not(self._symbols[goal]) for goal in batch))
        return False

    def require(self, *, rlimit: int) -> None:
        """From now on only sets count that tell the plans apart; with a limit of its own."""
        self._solver.set("rlimit", rlimit)
        self._solver.add(self._z3.Or(*(self._symbols[goal] for goal in self._goals)))

    def at_most(self, most: int) -> bool:
        """True if so few outcomes are enough; they are kept. Raises LimitError."""
        names = [self._symbols[self._event(_AFTER, outcome)] for outcome in self._every]
        bound = self._fresh()
        self._solver.add(self._z3.Implies(bound, self._z3.AtMost(*names, most)))
        return self._check(bound)

    def keep(self, most: int) -> None:
        """From now on there are no more outcomes than these."""
        assert most >= 0
        names = [self._symbols[self._event(_AFTER, outcome)] for outcome in self._every]
        self._solver.add(self._z3.AtMost(*names, most))

    def can_begin_with(self, outcomes: Sequence[RoleOutcome], *, last: bool) -> bool:
        """True if one of these outcomes may come (as the ``last``). Raises LimitError."""
        return self._check(self._any_of([self._term(each, last=last) for each in outcomes]))

    def fix(self, outcome: RoleOutcome, *, last: bool) -> None:
        """From now on this outcome comes."""
        self._solver.add(self._symbols[self._term(outcome, last=last)])

    def _term(self, outcome: RoleOutcome, *, last: bool) -> str:
        if not self._stops:
            return self._event(_AFTER, outcome)
        return self._is_last(outcome) if last else self._event(_BEFORE, outcome)

    def _any_of(self, names: Sequence[str]) -> Any:
        fresh = self._fresh()
        self._solver.add(self._z3.Implies(fresh, self._z3.Or(*map(self._symbols.get, names))))
        return fresh

    def _fresh(self) -> Any:
        self._count += 1
        return self._z3.Bool(f"a{self._count}", self._context)

    def _check(self, assumed: Any) -> bool:
        answer = self._solver.check(assumed)
        if answer == self._z3.unknown:
            raise LimitError
        if answer == self._z3.unsat:
            return False
        model = self._solver.model()
        self.outcomes = {
            outcome for outcome in self._every if self._holds(model, self._event(_AFTER, outcome))
        }
        if self._stops:
            self.last = next(
                outcome for outcome in self._every if self._holds(model, self._is_last(outcome))
            )
            assert self.last in self.outcomes, "the last outcome has come"
        return True

    def _holds(self, model: Any, name: str) -> bool:
        return bool(self._z3.is_true(model[self._symbols[name]]))
