"""Differences of a plan on an engine from what the paper says (GP703).

Both sides are the same plan, so an instance of the one is that instance of the other. They are
played side by side, fewest failures first, then fewest outcomes, then in document order: the first
difference that is met is the one that is told.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import TYPE_CHECKING

from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.counterexamples import explain
from gpsfsm.analysis.encode import conjunction
from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.analysis.rules import rule
from gpsfsm.analysis.words import actor, listed, place
from gpsfsm.compile import compile_plan
from gpsfsm.equivalence.pairs import OUTCOMES, Behaviour
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.model.finding import Scenario, TraceStep
from gpsfsm.model.story import Sentence, Statement, remark

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.analysis.context import Context
    from gpsfsm.compile import Compiled
    from gpsfsm.equivalence.pairs import Reaction, State
    from gpsfsm.model.finding import Finding

MOST_STATES = 100_000
"""How many pairs of states are visited before the question is given up."""

Admits = Callable[[Mapping[int, Event]], bool]
"""Whether some scenario has these outcomes, by runner number."""

_MAX_TRACE = 200
_MAX_STORY = 8
_STATEMENTS = {Event.SUCCEEDED: Statement.SUCCEEDS, Event.FAILED: Statement.FAILS}

_Step = tuple[int, Event]
_ENDS = {
    End.COMPLETED: "the plan completes",
    End.GAVE_UP: "the plan gives up",
    End.STUCK: "the plan is stuck",
    End.HANG: "the plan hangs",
    End.ABORT: "the engine crashes",
}
_AT_WORST: Mapping[End | None, End] = {End.GAVE_UP: End.HANG, End.STUCK: End.HANG}
"""The ends that engines do not know, and what they do instead. All others must be the same."""


@dataclass(frozen=True, slots=True)
class EngineDifference:
    """After ``steps``, outcomes of active instances, the two do not react in the same way."""

    steps: tuple[_Step, ...]
    paper: Reaction
    engine: Reaction


_Joint = tuple["State", "State", tuple[_Step, ...]]


@dataclass(frozen=True, slots=True)
class Compared:
    """``decided`` is False if there are too many states to visit and no difference was met."""

    difference: EngineDifference | None
    decided: bool = True


def difference_on_engine(
    paper: Compiled,
    engine: Compiled,
    *,
    admits: Admits | None = None,
    most: int = MOST_STATES,
) -> Compared:
    """The first difference between two automata of one plan.

    That the one gives up where the other hangs is none. After the end of a run nothing is observed.
    ``admits`` None: outcomes are free, and what has been does not matter for what comes.
    """
    sides = Behaviour(paper), Behaviour(engine)
    (here, begun), (there, beside) = sides[0].begin(), sides[1].begin()
    if not _alike(begun, beside):
        return Compared(EngineDifference((), begun, beside))
    # By failures, outcomes and the order of discovery: a difference waits for its turn too.
    waiting: list[tuple[int, int, int, _Joint | EngineDifference]] = []
    seen: set[tuple[State, State, frozenset[_Step]]] = set()
    differences = 0
    if begun.end is None:
        heappush(waiting, (0, 0, 0, (here, there, ())))
    while waiting:
        failures, length, _, next_ = heappop(waiting)
        if isinstance(next_, EngineDifference):
            return Compared(next_)
        here, there, steps = next_
        for (number, event), outcomes in _moves(here, steps, admits):
            after, mine = sides[0].after(here, number, event)
            other, theirs = sides[1].after(there, number, event)
            further = (*steps, (number, event))
            alike, key = _alike(mine, theirs), (after, other, outcomes)
            if alike and (mine.end is not None or key in seen):
                continue
            if len(seen) >= most:
                return Compared(None, decided=False)
            differences += 1
            more = failures + (event is Event.FAILED)
            if not alike:
                difference = EngineDifference(further, mine, theirs)
                heappush(waiting, (more, length + 1, differences, difference))
                continue
            seen.add(key)
            heappush(waiting, (more, length + 1, differences, (after, other, further)))
    return Compared(None)


def _moves(
    here: State, steps: tuple[_Step, ...], admits: Admits | None
) -> Iterator[tuple[_Step, frozenset[_Step]]]:
    """The outcomes that can come next, and all that have come by then."""
    for event in OUTCOMES:
        for number in here.active:
            step = number, event
            outcomes = frozenset((*steps, step)) if admits else frozenset()
            if admits is None or admits(dict(outcomes)):
                yield step, outcomes


def _alike(paper: Reaction, engine: Reaction) -> bool:
    if paper.triggered != engine.triggered:
        return False
    return _AT_WORST.get(paper.end, paper.end) is engine.end


def differs_on_engine(
    paper: Context, engine: Context, name: str
) -> tuple[list[Finding], list[str]]:
    """At most one finding GP703, and the name of what could not be decided."""
    constraints = paper.deciders.constraints
    allowed = constraints.allowed
    free = constraints.separate and all(
        {Outcome.SUCCEEDED, Outcome.FAILED} <= set(each) for each in allowed
    )

    def admits(outcomes: Mapping[int, Event]) -> bool:
        if any(Outcome(event.value) not in allowed[number] for number, event in outcomes.items()):
            return False
        return constraints.separate or paper.deciders.solver.decide([_term(paper, outcomes)])[0]

    chained = paper.deciders.constraints.no_start
    compiled = compile_plan(paper.plan) if chained else paper.compiled
    try:
        compared = difference_on_engine(compiled, engine.compiled, admits=None if free else admits)
    except InconclusiveError:  # whether some scenario has such outcomes
        compared = Compared(None, decided=False)
    if not compared.decided:
        return [], [f"whether the plan differs on {name}"]
    if compared.difference is None:
        return [], []
    return [_finding(paper, engine, compared.difference, name)], []


def hangs_without_start(engine: Context, name: str) -> tuple[list[Finding], list[str]]:
    """At most one finding GP703: a runner does not start, and the engine waits for it for ever.

    On paper that is a failure. It is told of the first runner for which a run hangs; the run needs
    no story, since nothing happens any more. Second, the name of what could not be decided.
    """
    solver = engine.deciders.solver
    encoding, automaton, runners = solver.encoding, solver.automaton, engine.plan.runners
    terms = [
        conjunction(
            (
                encoding.triggered(automaton.runner_node(number)),
                encoding.outcome(number, (Outcome.NO_START,)),
                encoding.ending(End.HANG),
            )
        )
        for number in range(len(runners))
    ]
    try:
        lost = [each for each, hangs in zip(runners, solver.decide(terms), strict=True) if hangs]
    except InconclusiveError:
        return [], [f"whether the plan differs on {name}"]
    if not lost:
        return [], []
    message = (
        f"this plan behaves differently on {name} than in the paper: if {place(lost[0])} does not "
        f"start, it has failed according to the paper, but {name} waits for it for ever"
    )
    hint = "check without --faults no-start if you are sure that all runners start"
    location = engine.plan.location(lost[0])
    related = tuple(engine.related(each, "the same holds here") for each in lost[1:])
    return [rule("GP703").finding(message, location, hint=hint, related=related)], []


def _term(context: Context, outcomes: Mapping[int, Event]) -> str:
    encoding = context.deciders.solver.encoding
    return conjunction(
        encoding.outcome(number, (Outcome(event.value),)) for number, event in outcomes.items()
    )


def _finding(context: Context, engine: Context, difference: EngineDifference, name: str) -> Finding:
    plan = context.plan
    on_paper = _contrast(context, difference.paper, difference.engine)
    on_engine = _contrast(context, difference.engine, difference.paper)
    named = [*difference.paper.triggered, *difference.engine.triggered]
    last = [number for number, _ in difference.steps[-1:]]
    element = plan.runners[(last or named)[0]].index if last or named else 0
    return rule("GP703").finding(
        f"this plan behaves differently on {name} than in the paper: "
        f"{_after(context, difference.steps)}in the paper {on_paper}; on {name} {on_engine}",
        plan.location(element),
        related=tuple(
            context.related(
                plan.runners[number],
                f"starts only on {name}"
                if number in difference.engine.triggered
                else "starts only in the paper",
            )
            for number in dict.fromkeys(named)
            if (number in difference.engine.triggered) != (number in difference.paper.triggered)
        ),
        scenario=_scenario(
            engine, difference, (f"in the paper {on_paper}", f"on {name} {on_engine}")
        ),
    )


def _after(context: Context, steps: Sequence[_Step]) -> str:
    if not steps:
        return "at the beginning, "
    number, event = steps[-1]
    verb = "has succeeded" if event is Event.SUCCEEDED else "has failed"
    return f"when {place(context.runner(number))} {verb}, "


def _contrast(context: Context, mine: Reaction, other: Reaction) -> str:
    """The reaction of one side, in words."""
    extra = [number for number in mine.triggered if number not in other.triggered]
    parts: list[str] = []
    if extra:
        names = listed([place(context.runner(number)) for number in extra])
        parts.append(f"{names} {'starts' if len(extra) == 1 else 'start'}")
    if mine.end is not None:
        parts.append(_ENDS[mine.end])
    if not parts:
        parts.append("nothing else starts" if mine.triggered else "nothing starts")
    return ", and ".join(parts)


def _scenario(
    engine: Context, difference: EngineDifference, closing: tuple[str, ...]
) -> Scenario | None:
    """The run on the engine in which nothing else fails, with both stories behind it."""
    if not engine.options.max_scenarios:
        return None
    plan, evaluator = engine.plan, engine.deciders.evaluator
    outcome_of = {number: Outcome(event.value) for number, event in difference.steps}
    outcomes = [outcome_of.get(number, Outcome.SUCCEEDED) for number in range(len(plan.runners))]
    explained = explain(Claim(), evaluator, outcomes.__getitem__, no_start=False)
    numbers = sorted({*outcome_of, *explained.decisions})
    steps = list(difference.steps)
    # What has to come before the engine dies belongs to it; the order of the rest is free.
    automaton = engine.automaton
    for signal in explained.trace if explained.ends is End.ABORT else ():
        step = automaton.runner_number(signal.node), signal.event
        if signal.event in OUTCOMES and step not in steps:
            steps.append(step)
    locations = [
        (event, plan.location(engine.runner(number))) for number, event in steps[-_MAX_TRACE:]
    ]
    sentences = [
        Sentence(_STATEMENTS[event], (actor(plan, engine.runner(number).index),))
        for number, event in difference.steps[-_MAX_STORY:]
    ]
    before = len(difference.steps) - len(sentences)
    if before:
        sentences.insert(0, Sentence(Statement.OUTCOMES_BEFORE, count=before))
    return Scenario(
        outcomes=tuple((plan.path(engine.runner(number)), outcomes[number]) for number in numbers),
        ends=explained.ends,
        trace=tuple(TraceStep(event, at.element, at.line, at.file) for event, at in locations),
        trace_truncated=len(steps) > _MAX_TRACE,
        sentences=(*sentences, *map(remark, closing)),
    )
