"""Counterexamples by z3 (``violation_encoding`` says how runs are put to it), and their replay.

Numbers of changes are tried upwards, until no run changes the state of the demand more often. So
the answer is exact over all runs, whatever their length. What z3 says is played event by event:
that is the proof that there is such a run.
"""

from __future__ import annotations

from contextlib import suppress
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.analysis.encode import conjunction, disjunction, negation, symbols_of
from gpsfsm.analysis.options import DEFAULT_RLIMIT
from gpsfsm.analysis.solver import InconclusiveError, add_text
from gpsfsm.errors import InternalError
from gpsfsm.model.event import Event, Outcome
from gpsfsm.tasks.counterexample import Plays, left_at_end, left_by
from gpsfsm.tasks.machine import machine_of
from gpsfsm.tasks.monitor import Violation
from gpsfsm.tasks.violation_encoding import Slots
from gpsfsm.workers import Z3_MB, require_memory

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.compile import Compiled
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.tasks.counterexample import Left, Move, Position, Trail
    from gpsfsm.tasks.machine import Key, Machine
    from gpsfsm.tasks.monitor import Demand, Monitor, MState

_CHANGES = (2, 6, 16, 40, 100, 250)
_MAX_SIZE = 1_500_000
_SMALL = 20_000
_SMALL_TABLE = 10_000
"""Up to these sizes of problem and machine a second opinion takes some tenths of a second."""
_PLAIN_RLIMIT = 2_000_000
"""Per question on the way to the plainest run; one that is less plain is certain too."""


def leaving_runs(
    compiled: Compiled,
    constraints: Constraints,
    demand: Demand,
    *,
    but: Collection[Key] = (),
    rlimit: int = DEFAULT_RLIMIT,
) -> Iterator[Left]:
    """A plain run for every kind of violation but some, those with the fewest failures first.

    Raises InconclusiveError at a limit and TooLargeError where the demand has too many states.
    """
    machine = machine_of(demand.branching(), constraints)
    if not machine.size:
        return
    query = _complete(compiled.automaton, constraints, machine, but, rlimit)
    while query is not None and query.plainest():
        left = retell(query.solution(), compiled, constraints, demand)
        query.leave_out(left.violation.key)
        yield left


def some_run_leaves(
    compiled: Compiled,
    constraints: Constraints,
    demand: Demand,
    *,
    rlimit: int = DEFAULT_RLIMIT,
) -> bool:
    """True if some run leaves the task.

    Raises InconclusiveError where that would take long, at a limit, and TooLargeError as
    ``leaving_runs`` does.
    """
    machine = machine_of(demand.branching(), constraints, most=_SMALL_TABLE)
    if not machine.size:
        return False
    if machine.depth is None or _size(compiled.automaton, machine, machine.depth) > _SMALL:
        raise InconclusiveError
    query = _Query(Slots(compiled.automaton, constraints, machine, machine.depth), (), rlimit)
    return query.leaves()


def _size(automaton: Automaton, machine: Machine, changes: int) -> int:
    """Roughly how long the problem is."""
    table = sum(map(len, machine.targets)) + 3 * len(machine.classes)
    return (table + 20 * len(automaton.runners) + 5 * len(automaton.nodes)) * (changes + 1)


def _complete(
    automaton: Automaton,
    constraints: Constraints,
    machine: Machine,
    but: Collection[Key],
    rlimit: int,
) -> _Query | None:
    """The question of as many changes as there can be; None: nothing leaves the task.

    Where that many are too many, but fewer do leave the task, the question of fewer.
    """
    candidate: _Query | None = None
    for most in _CHANGES:
        changes = most if machine.depth is None else min(most, machine.depth)
        if _size(automaton, machine, changes) > _MAX_SIZE:
            break
        try:
            query = _Query(Slots(automaton, constraints, machine, changes), but, rlimit)
            some = query.leaves()
            if changes == machine.depth or not query.goes_on():
                return query if some else None
        except InconclusiveError:
            break
        candidate = query if some else candidate
    if candidate is None:
        raise InconclusiveError
    return candidate


_Happening = tuple[bool, int]
"""Whether an outcome comes (else an instance begins), and the number of the instance."""


class Solution(NamedTuple):
    """A run by its cuts: what has begun at each, whose outcomes have come, what was the change.

    ``latest`` is whose outcome came last, if any; ``outcomes`` is the scenario.
    """

    outcomes: tuple[Outcome, ...]
    begun: tuple[frozenset[int], ...]
    come: tuple[frozenset[int], ...]
    latest: tuple[int | None, ...]
    changes: tuple[_Happening | None, ...]


class _Query:
    """Questions about one problem."""

    def __init__(self, slots: Slots, but: Collection[Key], rlimit: int) -> None:
        require_memory(Z3_MB, module="z3")
        import z3

        self._z3: Any = z3
        self._slots = slots
        self._solver: Any = z3.SolverFor("QF_FD")
        self._solver.set("random_seed", 0)
        self._solver.set("ctrl_c", False)
        self._rlimit = rlimit
        self._declared: set[str] = set()
        self._count = 0
        self._model: Any = None
        self._symbols: dict[str, Any] = {}
        self._declarations: dict[str, Any] = {}
        self._true = z3.BoolVal(True).as_ast().value
        self._open = {key: name for key, name in slots.keys.items() if key not in but}
        self._tell([*slots.problem(), f"(=> l0 {slots.more})"])
        self._limit(rlimit)

    # -- asking ---------------------------------------------------------------------------------

    def leaves(self, *, failures: int | None = None) -> bool:
        """True if some run leaves the task in an open way, with so few failures.

        Raises InconclusiveError.
        """
        term = disjunction(self._open.values())
        if failures is not None:
            term = conjunction((term, _at_most(failures, self._slots.failing)))
        return bool(self._open) and self._can(term)

    def goes_on(self) -> bool:
        """True if some run goes on with more changes."""
        return self._can("l0")

    def leave_out(self, key: Key) -> None:
        """From now on other kinds of violations are asked for."""
        del self._open[key]

    def plainest(self) -> bool:
        """Find the plainest run that leaves the task; False: there is none."""
        if not self.leaves():
            return False
        self._solver.push()
        self._tell([disjunction(self._open.values())])
        self._limit(min(self._rlimit, _PLAIN_RLIMIT))
        with suppress(InconclusiveError):
            self._settle()
        self._solver.pop()
        self._limit(self._rlimit)
        return True

    def _settle(self) -> None:
        """Fewest failures, then document order; the rest so that there is one run only."""
        failing = self._slots.failing
        low, high = 0, self._number(failing)
        step = 1
        while low < high:
            middle = min(low + step, high) - 1
            if self._can(_at_most(middle, failing)):
                high, step = min(middle, self._number(failing)), 1
            else:
                low, step = middle + 1, step * 2
        self._tell([_at_most(high, failing)])
        self._prefer(failing)
        self._prefer(list(self._open.values()))
        self._avoid(list(self._slots.happenings()))

    def _prefer(self, names: Sequence[str]) -> None:
        """Make the first of the names true that can be, and so on; all others are false."""
        place = 0
        while place < len(names):
            true = next((at for at in range(place, len(names)) if self._holds(names[at])), None)
            earlier = names[place:true]
            if earlier and self._can(disjunction(earlier)):
                continue
            self._fix([], earlier)
            if true is None:
                return
            self._fix([names[true]], [])
            place = true + 1

    def _avoid(self, names: Sequence[str]) -> None:
        """Make names false, one after the other, as far as that is possible.

        Neighbours mostly go together, so several are asked about at once.
        """
        place, free, forced = 0, 1, 1
        while True:
            first = next((at for at in range(place, len(names)) if self._holds(names[at])), None)
            self._fix([], names[place:first])
            if first is None:
                return
            place = first
            several = names[place : place + free]
            if free > 1 and self._can(conjunction(map(negation, several))):
                self._fix([], several)
                place, free = place + free, 2 * free
                continue
            all_true = (at for at in range(place, len(names)) if self._holds(names[at]))
            true = list(islice(all_true, forced))
            if self._can(disjunction(negation(names[at]) for at in true)):
                free, forced = (2 if forced == 1 else 1), 1
                continue
            settled = names[place : true[-1] + 1]
            self._fix([names[at] for at in true], [n for n in settled if not self._holds(n)])
            place, free, forced = true[-1] + 1, 1, 2 * forced

    def solution(self) -> Solution:
        """The run that was found last."""
        slots, named = self._slots, self._slots.encoding.named.items()
        outcomes = tuple(
            next(
                (outcome for outcome, letter in named if self._holds(f"{letter}{number}")),
                Outcome.FAILED,
            )
            for number in slots.numbers
        )
        cuts = range(1, slots.last + 1)
        return Solution(
            outcomes,
            tuple(self._those(slots.begins, cut) for cut in cuts),
            tuple(self._those(slots.comes, cut) for cut in cuts),
            tuple(self._latest(cut) for cut in cuts),
            tuple(self._change(cut) for cut in cuts),
        )

    def _those(self, name: Any, cut: int) -> frozenset[int]:
        return frozenset(n for n in self._slots.numbers if self._holds(name(n, cut)))

    def _latest(self, cut: int) -> int | None:
        return next((n for n in self._slots.numbers if self._holds(f"y{n}_{cut}")), None)

    def _change(self, cut: int) -> tuple[bool, int] | None:
        slots = self._slots
        if self._holds(slots.changing_outcome(cut)):
            latest = self._latest(cut)
            assert latest is not None
            return True, latest
        starts = [n for n in slots.numbers if self._holds(slots.changing_start(n, cut))]
        return (False, starts[0]) if starts else None

    # -- z3 ---------------------------------------------------------------------------------------

    def _limit(self, rlimit: int) -> None:
        self._solver.set("rlimit", rlimit)

    def _tell(self, assertions: Sequence[str]) -> None:
        text = "".join(f"(assert {each})" for each in assertions)
        names = [name for name in symbols_of(text) if name not in self._declared]
        self._declared.update(names)
        declared = "".join(f"(declare-const {name} Bool)" for name in names)
        add_text(self._solver, declared + text)

    def _fix(self, true: Sequence[str], false: Sequence[str]) -> None:
        """From now on these hold, and those do not."""
        self._solver.add(*map(self._symbol, true))
        self._solver.add(*(self._z3.Not(self._symbol(name)) for name in false))

    def _can(self, term: str) -> bool:
        """True if the term can hold; then what is looked at next is a run in which it does."""
        self._count += 1
        name = f"v{self._count}"
        self._tell([f"(=> {name} {term})"])
        answer = self._solver.check(self._symbol(name))
        if answer == self._z3.unknown:
            raise InconclusiveError
        if answer == self._z3.unsat:
            return False
        self._model = self._solver.model()
        return True

    def _number(self, names: Sequence[str]) -> int:
        return sum(map(self._holds, names))

    def _symbol(self, name: str) -> Any:
        if name not in self._symbols:
            self._symbols[name] = self._z3.Bool(name)
        return self._symbols[name]

    def _holds(self, name: str) -> bool:
        # z3's own accessors take 40 times as long; equal terms have equal addresses
        if name not in self._declarations:
            self._declarations[name] = self._symbol(name).decl()
        model, declaration = self._model, self._declarations[name]
        value = self._z3.Z3_model_get_const_interp(model.ctx.ref(), model.model, declaration.ast)
        return bool(value) and value.value == self._true


def _at_most(number: int, names: Sequence[str]) -> str:
    return f"((_ at-most {number}) {' '.join(names)})" if names else "true"


def retell(
    solution: Solution, compiled: Compiled, constraints: Constraints, monitor: Monitor
) -> Left:
    """The run, as far as to where it leaves the task. Raises InternalError if it does not.

    Of the events between two changes those come first that stand first in the document.
    """
    telling = _Telling(solution, Plays(compiled, constraints), monitor)
    for left in telling.along():
        return left
    raise InternalError("z3 has found a run that does not leave the task")


class _Telling:
    def __init__(self, solution: Solution, plays: Plays, monitor: Monitor) -> None:
        self._solution = solution
        self._plays = plays
        self._monitor = monitor
        self._position: Position = plays.first()
        self._state: MState = monitor.start
        self._trail: Trail = None

    def along(self) -> Iterator[Left]:
        """The run, if it leaves the task: first along the cuts, then on to an end."""
        begun: frozenset[int] = frozenset()
        come: frozenset[int] = frozenset()
        solution = self._solution
        cuts = zip(solution.begun, solution.come, solution.latest, solution.changes, strict=True)
        for now_begun, now_come, latest, change in cuts:
            todo = {(False, number) for number in now_begun - begun}
            todo |= {(True, number) for number in now_come - come}
            begun, come = now_begun, now_come
            late = [None if latest is None else (True, latest), change]
            while todo:
                move = self._next(todo, late)
                if move is None:
                    raise InternalError("z3 has found a run that cannot be played")
                todo.discard(_happening(move))
                yield from self._go(move)
        while True:
            left = left_at_end(self._plays, self._monitor, self._position, self._state, self._trail)
            if left is not None:
                yield left
            move = self._next(None, [])
            if move is None:
                return
            yield from self._go(move)

    def _next(self, todo: set[_Happening] | None, late: Sequence[_Happening | None]) -> Move | None:
        """The first move of those that are to come, those in ``late`` after all others."""
        if self._position.end is not None and not self._position.waiting:
            return None
        moves = [move for move in self._plays.moves(self._position) if self._fits(move)]
        if todo is not None:
            moves = [move for move in moves if _happening(move) in todo]
        return min(moves, key=lambda move: _rank(_happening(move), late), default=None)

    def _fits(self, move: Move) -> bool:
        """True if the scenario has it so."""
        event, number = move
        outcome = self._solution.outcomes[number]
        if event is Event.STARTED:
            return outcome is not Outcome.NO_START
        if event is Event.FAILED:
            return outcome in (Outcome.FAILED, Outcome.NO_START)
        return event.value == outcome.value

    def _go(self, move: Move) -> Iterator[Left]:
        event, number = move
        self._trail = (self._trail, event, number)
        after = self._monitor.after(self._state, event, number)
        if isinstance(after, Violation):
            yield left_by(after, self._trail)
        if after is None:
            raise InternalError("z3 has found a run that nothing can be wrong with")
        self._position = self._plays.after(self._position, move)
        self._state = after


def _rank(happening: _Happening, late: Sequence[_Happening | None]) -> int:
    return max((rank for rank, each in enumerate(late, start=1) if each == happening), default=0)


def _happening(move: Move) -> _Happening:
    event, number = move
    begins = event is Event.STARTED or event is Outcome.NO_START
    return not begins, number
