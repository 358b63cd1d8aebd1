"""Swallowed failures: goals that a run misses although the plan completes (semantics, 5.8).

A unit *is to achieve* something if a runner in it does; it is *done* if enough of those runners
have succeeded. A goal is a guarded unit that is to achieve something; it is swallowed if the plan
completes while neither the goal nor a guard or parallel_any around it is done.

The structural pass keeps for each unit, by its end, by whether it is done and whether a goal in it
is missed, the fewest runners that must fail for that (at the same number the first ones in the
document). A pass from the leaves finds these; one from the root adds what must fail around a unit.

    Go a, recovery(Log)         done: nothing fails            missed: a fails, and Log succeeds
    Go a, recovery(Go b, Log)   done: nothing, or a fails      missed: a and b fail
    Go a, recovery(Go b)        done as above; a and b failed: the plan gives up, so never missed
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.decisions import Analysis
from gpsfsm.analysis.encode import TRUE, conjunction, disjunction, negation
from gpsfsm.analysis.proof.refutation import UnprovedError
from gpsfsm.compile import TreePlan, UnitKind
from gpsfsm.model.automaton import PAPER, Signal
from gpsfsm.model.event import End, Event, Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

    from gpsfsm.analysis.evaluate import Evaluator, OutcomeOf
    from gpsfsm.analysis.proof.refutation import Refutation
    from gpsfsm.analysis.proof.witnesses import Witnesses
    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled

Answer = tuple[int, ...]
"""The units that are goals (the outermost guards), those that a completed run may miss."""


class Goals:
    """The goals of a plan. ``achieves``: per unit, whether it is to achieve something.

    ``guards`` are the goals, each the outermost guard around what it guards; ``holds`` says of a
    unit that it is a goal or has one in it. Nothing of this is asked of trees, of machines and of
    what an engine makes of a plan.
    """

    def __init__(self, compiled: Compiled) -> None:
        self.units = units = compiled.units
        self.automaton = compiled.automaton
        size = len(units)
        self.achieves = [False] * size
        self.holds = [False] * size
        self.guards: list[int] = []
        plan = compiled.automaton.plan
        self.number = {runner.index: number for number, runner in enumerate(plan.runners)}
        applies = compiled.automaton.traits == PAPER and not isinstance(plan, TreePlan)
        achieving = {
            plan.runners[number].index
            for number, binding in enumerate(compiled.bindings)
            if applies and binding is not None and binding.provider.achieves
        }
        if not achieving:
            return
        for unit in reversed(range(size)):
            kind, children = units.kinds[unit], units.children[unit]
            if kind is UnitKind.RUNNER:
                self.achieves[unit] = units.elements[unit] in achieving
            elif kind is UnitKind.GUARD:
                self.achieves[unit] = self.achieves[children[0]]
            elif kind is not UnitKind.DEAD:
                self.achieves[unit] = any(self.achieves[child] for child in children)
            self.holds[unit] = self._is_goal(unit) or any(self.holds[child] for child in children)
            if self._is_goal(unit):
                self.guards.append(unit)
        self.guards.sort(key=self.first_element)

    @cached_property
    def goal_set(self) -> frozenset[int]:
        """The goals as a set."""
        return frozenset(self.guards)

    def _is_goal(self, unit: int) -> bool:
        units, parent = self.units, self.units.parents[unit]
        if units.kinds[unit] is not UnitKind.GUARD or not self.achieves[unit]:
            return False
        inner = parent >= 0 and units.kinds[parent] is UnitKind.GUARD
        return not (inner and units.positions[unit] == 0)

    def first_element(self, goal: int) -> int:
        """The index of the element that is guarded."""
        while self.units.kinds[goal] is UnitKind.GUARD:
            goal = self.units.children[goal][0]
        return self.units.elements[goal]

    def excuses(self, unit: int) -> bool:
        """True if a goal in the unit is no longer missed once the unit is done."""
        kind = self.units.kinds[unit]
        return self.achieves[unit] and kind in (UnitKind.GUARD, UnitKind.ANY)

    def done(self, unit: int, done: Callable[[int], Any]) -> tuple[bool, list[Any]]:
        """(whether all of these are needed, of the units in it that are to achieve something)."""
        inside = [done(child) for child in self.units.children[unit] if self.achieves[child]]
        return self.units.kinds[unit] in (UnitKind.SEQUENCE, UnitKind.ALL), inside

    def around(self, goal: int) -> Iterator[int]:
        """The units around a goal that could excuse it, from the inside."""
        unit = self.units.parents[goal]
        while unit >= 0:
            if self.excuses(unit):
                yield unit
            unit = self.units.parents[unit]


class _Cost(NamedTuple):
    """Runners that fail: so many; a number, or the two parts of which they are put together."""

    number: int
    parts: tuple[_Cost, _Cost] | int | None

    def runners(self) -> list[int]:
        runners, pending = [], [self]
        while pending:
            parts = pending.pop().parts
            if isinstance(parts, int):
                runners.append(parts)
            elif parts is not None:
                pending += parts
        return sorted(runners)


class _State(NamedTuple):
    """``succeeds``: how a unit that was triggered ends. ``missed``: so is a goal in it."""

    succeeds: bool
    done: bool
    missed: bool


class _So(NamedTuple):
    """The children up to some place. ``on``: the next one is triggered, if they run in order.

    ``any``, ``all``: what holds of the ones that are to achieve something; ``succeeds``: of all
    so far (sequence, parallel_all), or of any of them.
    """

    on: bool
    succeeds: bool
    any: bool
    all: bool
    missed: bool


_FREE = _Cost(0, None)
_Costs = dict[_State, _Cost]
_Sofar = dict[_So, _Cost]


def _both(one: _Cost, other: _Cost) -> _Cost:
    if one.number and other.number:
        return _Cost(one.number + other.number, (one, other))
    return one if one.number else other


def _keep(costs: dict[Any, _Cost], key: Any, cost: _Cost) -> None:
    """Keep the fewest runners; of as many those that come first in the document."""
    other = costs.get(key)
    if (
        other is None
        or cost.number < other.number
        or (cost.number == other.number and cost.number and cost.runners() < other.runners())
    ):
        costs[key] = cost


class _Pass:
    """The two passes over a plan."""

    def __init__(self, structure: Structure, goals: Goals) -> None:
        self.structure = structure
        self.units = structure.units
        self.goals = goals
        self.inside: list[_Costs] = [{}] * len(self.units)
        self.missed: dict[int, _Costs] = {}  # by goal: it is missed, and no other one in it
        for unit in reversed(range(len(self.units))):
            self.inside[unit] = self._inside(unit)
        self.outside: list[_Costs] = [{}] * len(self.units)
        self.outside[0] = {_State(True, done, False): _FREE for done in (False, True)}
        for unit in range(len(self.units)):
            if goals.holds[unit] and self.outside[unit]:
                self._spread(unit)

    def failing(self, goal: int) -> _Cost | None:
        """The runners that fail in the canonical scenario in which the goal is missed."""
        best: dict[None, _Cost] = {}
        for state, cost in self.missed[goal].items():
            around = self.outside[goal].get(state._replace(missed=False))
            if around is not None:
                _keep(best, None, _both(cost, around))
        return best.get(None)

    def _inside(self, unit: int) -> _Costs:
        kind = self.units.kinds[unit]
        if kind is UnitKind.RUNNER:
            number, achieves = self.structure.number[unit], self.goals.achieves[unit]
            ends = {_State(True, achieves, False): _FREE}
            if Outcome.FAILED in self.structure.constraints.allowed[number]:
                ends[_State(False, False, False)] = _Cost(1, number)
            return ends
        sofar = self._begin(unit)
        for child in self.units.children[unit]:
            sofar = self._after(unit, sofar, child, self.inside[child])
        costs: _Costs = {}
        own: _Costs = {}
        is_goal = unit in self.goals.goal_set
        for so, cost in sofar.items():
            state = self._ended(unit, so)
            if is_goal and not state.done:
                if not state.missed:
                    _keep(own, state, cost)
                state = state._replace(missed=True)
            _keep(costs, state, cost)
        if is_goal:
            self.missed[unit] = own
        return costs

    def _after(self, unit: int, before: _Sofar, child: int, costs: _Costs) -> _Sofar:
        """The children so far and the next one."""
        after: _Sofar = {}
        for so, cost in before.items():
            for following, more in self._steps(unit, so, child, costs):
                _keep(after, following, _both(cost, more))
        return after

    def _begin(self, unit: int) -> _Sofar:
        return {_So(True, self._needs_all(unit), False, True, False): _FREE}

    def _needs_all(self, unit: int) -> bool:
        kind = self.units.kinds[unit]
        return kind in (UnitKind.SEQUENCE, UnitKind.ALL, UnitKind.EMPTY)

    def _steps(self, unit: int, so: _So, child: int, costs: _Costs) -> Iterator[tuple[_So, _Cost]]:
        """The children so far and the next one, by how that can end."""
        if not so.on:
            yield (so._replace(all=False) if self.goals.achieves[child] else so), _FREE
            return
        for state, cost in costs.items():
            yield self._step(unit, so, child, state), cost

    def _step(self, unit: int, so: _So, child: int, state: _State) -> _So:
        kind, achieves = self.units.kinds[unit], self.goals.achieves[child]
        all_needed = self._needs_all(unit)
        if kind is UnitKind.SEQUENCE:
            on = state.succeeds
        else:
            on = kind not in (UnitKind.GUARD, UnitKind.DEAD) or not state.succeeds
        return _So(
            on,
            so.succeeds and state.succeeds if all_needed else so.succeeds or state.succeeds,
            so.any or (achieves and state.done),
            so.all and (state.done or not achieves),
            so.missed or state.missed,
        )

    def _ended(self, unit: int, so: _So) -> _State:
        all_needed = self._needs_all(unit)
        done = self.goals.achieves[unit] and (so.all if all_needed else so.any)
        missed = so.missed and not (done and self.goals.excuses(unit))
        return _State(so.succeeds, done, missed)

    def _spread(self, unit: int) -> None:
        """The failures outside each child that holds a goal with which the plan completes.

        Nothing around the goal is done that would excuse it. ``behind`` is what must fail in the
        children behind one and around the unit, by what the children so far came to.
        """
        children = self.units.children[unit]
        before = [self._begin(unit)]
        plain = [self._plain(child) for child in children]
        for child, costs in zip(children, plain, strict=True):
            before.append(self._after(unit, before[-1], child, costs))
        behind = {so: self._beyond(unit, so) for so in before[-1]}
        for place in reversed(range(len(children))):
            child, costs = children[place], plain[place]
            if self.goals.holds[child]:
                self.outside[child] = self._around(unit, child, before[place], behind, costs)
            earlier: dict[_So, _Cost | None] = {}
            for so in before[place]:
                best: dict[_So, _Cost] = {}
                for following, more in self._steps(unit, so, child, costs):
                    rest = behind[following]
                    if rest is not None:
                        _keep(best, so, _both(more, rest))
                earlier[so] = best.get(so)
            behind = earlier

    def _around(
        self,
        unit: int,
        child: int,
        before: _Sofar,
        behind: Mapping[_So, _Cost | None],
        ends: Iterable[_State],
    ) -> _Costs:
        """The failures outside the child, by how it ends."""
        outside: _Costs = {}
        for so, cost in before.items():
            for state in ends if so.on else ():
                rest = behind[self._step(unit, so, child, state)]
                if rest is not None:
                    _keep(outside, state, _both(cost, rest))
        return outside

    def _plain(self, unit: int) -> _Costs:
        """The costs of a unit where it does not matter which goals in it are missed."""
        costs: _Costs = {}
        for state, cost in self.inside[unit].items():
            _keep(costs, state._replace(missed=False), cost)
        return costs

    def _beyond(self, unit: int, so: _So) -> _Cost | None:
        """The failures around the unit that has ended so; None: it excuses, or cannot be."""
        state = self._ended(unit, so)
        if state.done and self.goals.excuses(unit):
            return None
        return self.outside[unit].get(state)


def by_structure(structure: Structure) -> Answer:
    """Each goal with runners whose failures make the plan complete without it."""
    goals = Goals(structure.compiled)
    if not goals.guards:
        return ()
    costs = _Pass(structure, goals)
    return tuple(goal for goal in goals.guards if costs.failing(goal) is not None)


class _Logic(NamedTuple):
    """Formulas of one kind: terms of z3's language, or literals of a circuit."""

    every: Callable[[Iterable[Any]], Any]
    some: Callable[[Iterable[Any]], Any]
    opposite: Callable[[Any], Any]
    happens: Callable[[Signal | None], Any]
    named: Callable[[str, Any], Any]
    true: Any


class _Formulas:
    """Per unit: whether it is done, and whether a goal in it is missed; per goal ``missed``."""

    def __init__(self, compiled: Compiled, goals: Goals, logic: _Logic) -> None:
        units = goals.units
        size = len(units)
        done: list[Any] = [None] * size
        inside: list[Any] = [None] * size  # some goal in it is missed, as far as it can tell
        nested: dict[int, Any] = {}
        for unit in reversed(range(size)):
            if units.kinds[unit] is UnitKind.RUNNER and goals.achieves[unit]:
                node = compiled.automaton.runner_node(goals.number[units.elements[unit]])
                done[unit] = logic.happens(Signal(node, Event.SUCCEEDED))
            elif goals.achieves[unit]:
                every, parts = goals.done(unit, done.__getitem__)
                combined = logic.every(parts) if every else logic.some(parts)
                done[unit] = logic.named(f"y{unit}", combined)
            if goals.holds[unit]:
                holding = [inside[child] for child in units.children[unit] if goals.holds[child]]
                missed = logic.some(holding)
                if unit in goals.goal_set:
                    nested[unit] = missed
                    here = logic.happens(compiled.triggers[unit]), logic.opposite(done[unit])
                    missed = logic.some((missed, logic.every(here)))
                if goals.excuses(unit):
                    missed = logic.every((missed, logic.opposite(done[unit])))
                inside[unit] = logic.named(f"z{unit}", missed)
        unexcused: list[Any] = [logic.true] * size
        for unit in range(size):
            if goals.holds[unit]:
                free = unexcused[unit]
                if goals.excuses(unit):
                    free = logic.named(f"u{unit}", logic.every((free, logic.opposite(done[unit]))))
                for child in units.children[unit]:
                    unexcused[child] = free
        self.missed = {
            goal: logic.every(
                (
                    logic.happens(compiled.triggers[goal]),
                    logic.opposite(done[goal]),
                    logic.opposite(nested[goal]),
                    unexcused[goal],
                )
            )
            for goal in goals.guards
        }


def _terms(solver: Solver, goals: Goals) -> Mapping[int, str]:
    """For each goal the term that says that a completed run misses it, and no smaller one."""
    encoding = solver.encoding
    definitions: list[str] = []

    def named(name: str, term: str) -> str:
        if term.startswith("("):
            definitions.append(f"(= {name} {term})")
            return name
        return term

    logic = _Logic(conjunction, disjunction, negation, encoding.happens, named, TRUE)
    missed = _Formulas(solver.compiled, goals, logic).missed
    solver.tell(definitions)
    completed = encoding.ending(End.COMPLETED)
    return {goal: conjunction((completed, term)) for goal, term in missed.items()}


def by_solver(solver: Solver) -> Answer:
    """Ask for each goal whether a completed run misses it."""
    goals = Goals(solver.compiled)
    if not goals.guards:
        return ()
    terms = _terms(solver, goals)
    answers = solver.decide([terms[goal] for goal in goals.guards])
    return tuple(goal for goal, missed in zip(goals.guards, answers, strict=True) if missed)


def facts(answer: Answer | None, compiled: Compiled) -> Mapping[str, Any]:
    """The fact ``swallowed``."""
    if not answer:
        return {}
    goals, plan = Goals(compiled), compiled.automaton.plan
    return {"swallowed": tuple(plan.path(goals.first_element(goal)) for goal in answer)}


def swallowed_claim(compiled: Compiled, goal: int) -> Claim:
    """A run that completes and misses the goal; the smaller goals in it are not missed."""
    goals = Goals(compiled)

    def failing(structure: Structure) -> Iterable[int]:
        cost = _Pass(structure, goals).failing(goal)
        assert cost is not None, "only what can be missed is claimed"
        return cost.runners()

    def shown(evaluator: Evaluator, outcome_of: OutcomeOf) -> Claim:
        run = evaluator.run(outcome_of)
        done = _done(goals, range(len(goals.units)), run.happens)
        happens: list[Signal] = []
        absent: list[int] = []
        for node in _undone(goals, goal, done):
            events = [Signal(node, event) for event in (Event.FAILED, Event.STARTED)]
            came = [signal for signal in events if run.happens(signal)]
            happens += came[:1]
            if node not in run.triggered:
                absent.append(node)
        trigger = compiled.triggers[goal]
        if trigger is not None:
            happens.append(trigger)
        return Claim(happens=tuple(happens), absent=tuple(absent), ends=End.COMPLETED)

    return Claim(
        ends=End.COMPLETED,
        more=lambda solver: _terms(solver, goals)[goal],
        failing=failing,
        shown=shown,
    )


def _done(goals: Goals, order: Sequence[int], happens: Callable[[Signal], bool]) -> dict[int, bool]:
    """True for those of the units that are done in a run; parents come before their children."""
    done: dict[int, bool] = {}
    for unit in reversed(order):
        if not goals.achieves[unit]:
            continue
        if goals.units.kinds[unit] is UnitKind.RUNNER:
            node = goals.automaton.runner_node(goals.number[goals.units.elements[unit]])
            done[unit] = happens(Signal(node, Event.SUCCEEDED))
        else:
            every, parts = goals.done(unit, done.__getitem__)
            done[unit] = all(parts) if every else any(parts)
    return done


def _undone(goals: Goals, goal: int, done: Mapping[int, bool]) -> list[int]:
    """The nodes of the runners that show that the goal, and what could excuse it, is not done."""
    nodes: list[int] = []
    pending = [goal, *goals.around(goal)]
    seen: set[int] = set()
    while pending:
        unit = pending.pop()
        if unit in seen:
            continue
        seen.add(unit)
        assert not done[unit]
        if goals.units.kinds[unit] is UnitKind.RUNNER:
            nodes.append(goals.automaton.runner_node(goals.number[goals.units.elements[unit]]))
            continue
        undone = [
            child
            for child in goals.units.children[unit]
            if goals.achieves[child] and not done[child]
        ]
        every, _ = goals.done(unit, done.__getitem__)
        pending += undone[:1] if every else undone
    return sorted(nodes)


_MOST_STEPS = 2_000_000
"""Goals times nodes that one refutation may take: it follows the plan back from its completion once
for each goal. Larger plans are asked goal by goal, or rest on the structural pass, as their proof
says; no verdict rests on this."""


def refute(answer: Answer, refutation: Refutation) -> None:
    """No completed run misses one of the other goals."""
    goals = Goals(refutation.compiled)
    others = [goal for goal in goals.guards if goal not in answer]
    if not others:
        return
    if len(others) * len(refutation.automaton.nodes) > _MOST_STEPS:
        raise UnprovedError
    circuit, whole = refutation.circuit, refutation.whole
    logic = _Logic(
        circuit.all, circuit.any, lambda each: -each, whole.happens, lambda _, each: each, 1
    )
    missed = _Formulas(refutation.compiled, goals, logic).missed
    completed = whole.fired[refutation.automaton.complete]
    refutation.never(*(circuit.all((completed, missed[goal])) for goal in others))


def show(answer: Answer, witnesses: Witnesses) -> None:
    """A run that completes, and in which no runner succeeds that would have done the goal."""
    if not answer:
        return
    structure, compiled = witnesses.structure, witnesses.structure.compiled
    goals = Goals(compiled)
    costs = _Pass(structure, goals)
    for goal in answer:
        cost = costs.failing(goal)
        assert cost is not None
        failing = cost.runners()
        happens, absent = _seen(structure, goals, goal, frozenset(failing))
        trigger = compiled.triggers[goal]
        witnesses.expect(
            witnesses.lane(failing),
            happens=(*happens, *(() if trigger is None else (trigger,))),
            triggered=(compiled.automaton.complete,),
            absent=absent,
        )


def _seen(
    structure: Structure, goals: Goals, goal: int, failing: Collection[int]
) -> tuple[list[Signal], list[int]]:
    """The failures, and the runners not triggered, that show that the goal is not done."""
    top = max((goal, *goals.around(goal)), key=lambda unit: -unit)
    order = [top]
    for unit in order:
        order += goals.units.children[unit]
    ends: dict[int, bool] = {}  # the end of a unit if it is triggered
    for unit in reversed(order):
        kind, children = goals.units.kinds[unit], goals.units.children[unit]
        if kind is UnitKind.RUNNER:
            ends[unit] = structure.number[unit] not in failing
        elif kind in (UnitKind.ANY, UnitKind.GUARD):
            ends[unit] = any(ends[child] for child in children)
        else:
            ends[unit] = all(ends[child] for child in children)
    triggered = {top}
    succeeded: set[int] = set()
    for unit in order:
        going_on = {UnitKind.SEQUENCE: True, UnitKind.GUARD: False}.get(goals.units.kinds[unit])
        if unit not in triggered:
            continue
        if goals.units.kinds[unit] is UnitKind.RUNNER and ends[unit]:
            succeeded.add(goals.automaton.runner_node(structure.number[unit]))
        for child in goals.units.children[unit]:
            triggered.add(child)
            if going_on is not None and ends[child] is not going_on:
                break
    done = _done(goals, order, lambda signal: signal.node in succeeded)
    nodes = _undone(goals, goal, done)
    started = {
        goals.automaton.runner_node(structure.number[unit])
        for unit in triggered
        if structure.number[unit] >= 0
    }
    happens = [Signal(node, Event.FAILED) for node in nodes if node in started]
    return happens, [node for node in nodes if node not in started]


ANALYSIS = Analysis(
    "swallowed",
    by_structure,
    by_solver,
    facts,
    refute=refute,
    show=show,
    matters=lambda _: False,
)
