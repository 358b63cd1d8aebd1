"""The comparison of two plans: they do the same, or a scenario shows a difference.

``compare`` asks the normal forms, then the lockstep search, in which both plans play all runs side
by side, then z3. The search is exact for plans whose states can all be visited: where one thing
happens after the other these are few, whatever the length. Every state is visited once, those after
fewer outcomes first.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Literal

from gpsfsm.analysis.solver import InconclusiveError
from gpsfsm.compile import Compiled, MachinePlan, compile_plan
from gpsfsm.equivalence.alignment import sides_of
from gpsfsm.equivalence.pairs import OUTCOMES, Behaviour, Difference, Joint, Step
from gpsfsm.equivalence.proof import NotProvedError, prove
from gpsfsm.equivalence.set_observer import difference_of_late_pairs, difference_of_sets
from gpsfsm.errors import GpsfsmError, InternalError, UsageError
from gpsfsm.model.automaton import PAPER

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.equivalence.pairs import Meeting, Sides
    from gpsfsm.model.plan import Plan


class TooManyStatesError(Exception):
    """Not all states could be visited: nothing follows from those that were."""


@dataclass(frozen=True, slots=True)
class _Edge:
    """A step of the observer in a state, and the states that it leads to, one per pairing.

    Without ways the plans differ.
    """

    state: int
    step: Step | None
    meeting: Meeting
    ways: tuple[int, ...]


@dataclass(slots=True)
class _Graph:
    numbers: dict[Joint | None, int] = field(default_factory=dict)
    states: list[Joint | None] = field(default_factory=list)
    edges: list[_Edge] = field(default_factory=list)
    outgoing: list[list[int]] = field(default_factory=list)
    incoming: list[list[int]] = field(default_factory=list)

    def number(self, state: Joint | None) -> int:
        """The number of a state; None is the state before the beginning."""
        index = self.numbers.get(state)
        if index is None:
            index = self.numbers[state] = len(self.states)
            self.states.append(state)
            self.outgoing.append([])
            self.incoming.append([])
        return index

    def add(self, state: int, step: Step | None, meeting: Meeting) -> None:
        ways = tuple(dict.fromkeys(map(self.number, meeting.ways)))
        self.outgoing[state].append(len(self.edges))
        for target in ways:
            self.incoming[target].append(len(self.edges))
        self.edges.append(_Edge(state, step, meeting, ways))


def lockstep(sides: Sides, *, max_work: int) -> Difference | None:
    """The first difference in the canonical order, or None if the plans are equal.

    ``max_work`` bounds the sum of the sizes of all states that are visited. Beyond it a difference
    that is found all the same is certain, but perhaps not the first.
    Raises TooManyStatesError if there is none by then, or where too many ways to pair would have
    to be tried.
    """
    graph = _Graph()
    root = graph.number(None)
    layer, work = [root], 0
    while layer:
        seen, differs = len(graph.states), False
        for state in layer:
            for step, meeting in _moves(sides, graph.states[state]):
                graph.add(state, step, meeting)
                differs |= not meeting.ways
                work += 2 + sum(2 + len(joint.pairs) for joint in meeting.ways)
            if work > max_work:
                return _certain(graph, root)
        if differs and root in (values := _values(graph)):
            return _difference_along(graph, root, values)
        layer = list(range(seen, len(graph.states)))
    return None if root not in _values(graph, suspected=True) else _certain(graph, root)


def _certain(graph: _Graph, root: int) -> Difference:
    """The difference that is certain by now."""
    values = _values(graph)
    if root not in values:
        raise TooManyStatesError
    return _difference_along(graph, root, values).perhaps_not_first()


def _moves(sides: Sides, state: Joint | None) -> Iterator[tuple[Step | None, Meeting]]:
    if state is None:
        yield None, sides.begin()
        return
    for pair in state.pairs:
        for event in OUTCOMES:
            step = Step(pair, event)
            if sides.allows(state, step):
                yield step, sides.after(state, step)


def _values(graph: _Graph, *, suspected: bool = False) -> dict[int, int]:
    """In how many steps the observer finds a difference, whichever way the pairs are made.

    States without an entry are not known to be different. A step with more ways than are listed
    leads to no certain difference; ``suspected`` asks for those too that the listed ways show.
    """
    values: dict[int, int] = {}
    missing = [len(edge.ways) + (not edge.meeting.every and not suspected) for edge in graph.edges]
    ready = deque((0, number) for number, count in enumerate(missing) if not count)
    while ready:  # in ascending order: an edge is ready with the last of its ways
        value, number = ready.popleft()
        state = graph.edges[number].state
        if state in values:
            continue
        values[state] = value + 1
        for other in graph.incoming[state]:
            missing[other] -= 1
            if not missing[other]:
                ready.append((value + 1, other))
    return values


def _difference_along(graph: _Graph, root: int, values: dict[int, int]) -> Difference:
    """Follow the difference: in each state the first of the best steps, then the longest way."""
    steps: list[Step] = []
    state = root
    while True:
        edge = next(
            edge
            for edge in map(graph.edges.__getitem__, graph.outgoing[state])
            if edge.meeting.every
            and all(target in values for target in edge.ways)
            and max((values[target] for target in edge.ways), default=0) + 1 == values[state]
        )
        if edge.step is not None:
            steps.append(edge.step)
        if not edge.ways:
            return Difference(tuple(steps), edge.meeting.first, edge.meeting.second)
        state = max(edge.ways, key=values.__getitem__)


Decider = Literal["auto", "lockstep", "z3"]
"""``auto``: the normal forms, then the search, and z3 where the search meets its limit."""

DEFAULT_RLIMIT = 50_000_000
"""z3's own steps per question."""

_WORK = 300_000
_WORK_PER_RUNNER = 40
_MORE_WORK = 4
_SECOND_OPINION_UP_TO = 200
_SECOND_WORK = 60_000
_SECOND_RLIMIT = 5_000_000
_CONTRADICTION = "the two deciders differ on whether the plans do the same"


class UndecidedError(GpsfsmError):
    """The limits were reached before the plans were shown to be equal or different."""


def compare(
    first: Plan | Compiled,
    second: Plan | Compiled,
    *,
    consistent: bool = False,
    assumptions: Sequence[str] = (),
    tolerance: float = 0.0,
    decider: Decider = "auto",
    second_opinion: bool = False,
    rlimit: int = DEFAULT_RLIMIT,
) -> Difference | None:
    """The first difference in behaviour, or None if no observer can tell the plans apart.

    Either may be a machine; then the search alone decides (semantics, 9.5).
    ``consistent``: equal actions have equal outcomes, in either plan. ``assumptions``: only
    outcomes count that these admit in both plans. ``tolerance``: numbers of a parameter that differ
    by no more are equal. ``second_opinion``: of plans of up to 200 runners another decider is asked
    too. Raises UndecidedError; AssumptionError, or GpsfsmError where the assumptions contradict
    each other; and InternalError if the deciders do. The meaning is defined in docs/tasks.md.

    >>> from gpsfsm.syntax import parse
    >>> go = '<Runner interface="a/Go" x="1"/>'
    >>> one = parse(f"<Plan>{go}</Plan>").plan
    >>> other = parse(f"<Plan><Control type='sequential'>{go}</Control></Plan>").plan
    >>> compare(one, other) is None
    True
    """
    one, other = _compiled(first), _compiled(second)
    if any(isinstance(each.automaton.plan, MachinePlan) for each in (one, other)):
        if consistent:
            raise UndecidedError("machines are not compared under --consistent")
        return _compare_machines(one, other, assumptions, tolerance)
    admission = None
    if assumptions:
        from gpsfsm.equivalence.admission import admission_of

        admission = admission_of(one, other, assumptions, consistent=consistent)
    sides = sides_of(
        Behaviour(one),
        Behaviour(other),
        tolerance=tolerance,
        consistent=consistent,
        admission=admission,
    )
    try:
        return _decide(sides, decider, rlimit, second_opinion=second_opinion)
    except InconclusiveError:
        raise UndecidedError("z3 reached its limit on the assumptions") from None


def _compare_machines(
    one: Compiled, other: Compiled, assumptions: Sequence[str], tolerance: float
) -> Difference | None:
    """The difference between two machines, of which one may be a plan."""
    from gpsfsm.equivalence.machines import machine_sides  # loads networkx

    sides = machine_sides(one, other, tolerance=tolerance, assumptions=assumptions)
    if sides.same_form:
        return None
    size = len(sides.kinds[0]) + len(sides.kinds[1])
    try:
        return lockstep(sides, max_work=max(_WORK, _WORK_PER_RUNNER * size))
    except TooManyStatesError:
        raise UndecidedError(
            "neither a proof that the machines do the same nor a difference was found within the "
            "limits: they have too many configurations, or too many equal actions side by side"
        ) from None


def _compiled(plan: Plan | Compiled) -> Compiled:
    compiled = plan if isinstance(plan, Compiled) else compile_plan(plan)
    if compiled.automaton.traits != PAPER:
        raise UsageError(
            "plans are compared by the semantics of docs/semantics.md, not by those of an engine"
        )
    return compiled


def _decide(
    sides: Sides, decider: Decider, rlimit: int, *, second_opinion: bool
) -> Difference | None:
    size = len(sides.kinds[0]) + len(sides.kinds[1])
    confirms = second_opinion and size <= 2 * _SECOND_OPINION_UP_TO
    max_work = max(_WORK, _WORK_PER_RUNNER * size)
    if decider == "z3":
        return _by_z3(sides, rlimit)
    if decider == "auto" and sides.same_form:
        if confirms and not _searched(sides):
            _confirm(sides, min(rlimit, _SECOND_RLIMIT), None)
        return None
    try:
        difference = lockstep(sides, max_work=max_work)
    except TooManyStatesError:
        if decider == "lockstep":
            raise UndecidedError(
                "the plans have more states than are searched; z3 may decide it"
            ) from None
        return _beyond(sides, max_work, rlimit)
    if confirms:
        _confirm(sides, min(rlimit, _SECOND_RLIMIT), difference)
    return difference


def _beyond(sides: Sides, max_work: int, rlimit: int) -> Difference | None:
    """The answer where there are too many states for the search."""
    for search in (difference_of_sets, difference_of_late_pairs):
        difference = search(sides, max_work=max_work // 2)
        if difference is not None:
            return difference
    try:
        return _by_z3(sides, rlimit)
    except UndecidedError as undecided:
        try:
            return lockstep(sides, max_work=max_work * _MORE_WORK)
        except TooManyStatesError:
            raise undecided from None


def _by_z3(sides: Sides, rlimit: int) -> Difference | None:
    try:
        return prove(sides, rlimit=rlimit)
    except NotProvedError:
        raise UndecidedError(
            "it could not be decided within the limits whether the plans do the "
            "same: they have too many states, or too many equal actions side by side"
        ) from None


def _searched(sides: Sides) -> bool:
    """True if the search, too, finds that plans of one normal form do the same."""
    try:
        difference = lockstep(sides, max_work=_SECOND_WORK)
    except TooManyStatesError:
        return False
    if difference is not None:
        raise InternalError(_CONTRADICTION)
    return True


def _confirm(sides: Sides, rlimit: int, difference: Difference | None) -> None:
    """Ask z3 too; that it does not decide says nothing. Raises InternalError if it differs."""
    try:
        other = prove(sides, rlimit=rlimit)
    except NotProvedError:
        return
    same = (other is None) == (difference is None)
    if (
        same
        and other is not None
        and difference is not None
        and other.shortest
        and difference.shortest
    ):
        same = len(other.steps) == len(difference.steps)
    if not same:
        raise InternalError(_CONTRADICTION)


class Echo(Enum):
    """SAME behaviour, OTHER behaviour, or UNDECIDED."""

    SAME = "same"
    OTHER = "other"
    UNDECIDED = "undecided"


def echo_of(plan: Compiled, example: Compiled) -> Echo:
    """The likeness of a plan to an example (docs/tasks.md, "Equivalence")."""
    one, other = plan.automaton, example.automaton
    if one.fingerprint == other.fingerprint:
        return Echo.SAME
    try:
        return Echo.SAME if compare(plan, example) is None else Echo.OTHER
    except UndecidedError:
        return Echo.UNDECIDED


# -- conversion, which compares what it has written ----------------------------------------


DRAWN = ("graphml", "json", "mermaid", "dot")
"""The formats that show the automaton; ``gpsfsm convert`` writes them without a comparison."""


def targets() -> tuple[str, ...]:
    """The names of the formats that can be written."""
    from gpsfsm.compile.formats import formats

    return tuple(name for name, each in formats().items() if each.write is not None)


def convert_plan(plan: Plan, to: str) -> str:
    """The text in another format that does the same as a plan, which is proved by comparing both.

    Raises UsageError for a format that is not there, CannotSayError for a node that it cannot say,
    UndecidedError if the comparison meets a limit, and InternalError if the text does something
    else.
    """
    from gpsfsm.compile.formats import formats
    from gpsfsm.compile.plan_text import read_plan_or_machine

    chosen = formats().get(to)
    if chosen is None or chosen.write is None:
        names = ", ".join(sorted({*targets(), *DRAWN}))
        raise UsageError(f"there is no format '{to}'; the formats are: {names}")
    text = chosen.write(compile_plan(plan).automaton)
    again = read_plan_or_machine(text, file=plan.file)
    if again.plan is None:
        reasons = "; ".join(problem.message for problem in again.problems[:3])
        raise InternalError(f"what was written as {to} cannot be read: {reasons}")
    if compare(plan, again.plan) is not None:
        raise InternalError(f"what was written as {to} does something else")
    return text
