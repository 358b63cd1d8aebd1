"""Plays: the scenario of a finding as a run, its story, and where in the run each sentence stands.

The kernel runs the plan, and every outcome comes in the scenario's order. It is the kernel that
executes plans, so what is shown is what a run would do. It needs no runners: an outcome is an
input, one a second.

A scenario of a machine lists its outcomes in the order of the run, visit after visit (semantics,
9.3). What the machine stops has stopped at once, and of a loop one round is played:

    A fails, B succeeds, and so on      records  A started, A failed, B started, B succeeded, A …
    the run is shown up to the end of the first round, and has not ended then
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import chain, islice
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.compile import MachinePlan
from gpsfsm.compile.instants import CODES, GOING, Instants
from gpsfsm.errors import InternalError
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.machine_kernel import kernel_of
from gpsfsm.execution.records import Input, Kind, Load, Record, Status, Stop
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.model.story import Statement
from gpsfsm.picture.cells import failing_joins

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from gpsfsm.compile import Compiled
    from gpsfsm.execution.records import RunValue
    from gpsfsm.model.finding import Finding, Scenario
    from gpsfsm.model.story import Sentence

MOST_RECORDS = 20_000
"""Records of all plays of a document: some 200 kB of a page."""
MOST_NODES = 30_000
"""Nodes of all automata that are run for a document, each time anew: some half a second."""
_SECOND_US = 1_000_000
_SHOWN = {
    kind: kind.value
    for kind in (
        *(Kind.TRIGGERED, Kind.STARTED, Kind.SUCCEEDED, Kind.FAILED, Kind.TIMEOUT),
        *(Kind.JOINED, Kind.STOPPING, Kind.STOPPED, Kind.SILENCE, Kind.NOT_LOADED, Kind.ENDED),
    )
}
"""Loading takes no time here, so it is not shown."""
_EVENTS = {Kind(event.value): event for event in Event}
_ANSWERS = {Outcome.SUCCEEDED: Kind.SUCCEEDED, Outcome.FAILED: Kind.FAILED}


@dataclass(slots=True)
class Budget:
    """The cost that the plays of a document may have in all, in size and in time."""

    records: int = MOST_RECORDS
    nodes: int = MOST_NODES

    def take(self, records: int, nodes: int) -> None:
        """Spend so much."""
        self.records -= records
        self.nodes -= nodes

    @property
    def spent(self) -> bool:
        """True if there is room for no more."""
        return self.records <= 0 or self.nodes <= 0


@dataclass(slots=True)
class Plays:
    """The plays of one plan; ``left_out`` counts those that there was no room for.

    The first one of a plan is always there, however long it is. ``consistent``: equal actions have
    equal outcomes.
    """

    compiled: Compiled
    budget: Budget
    consistent: bool = False
    plays: list[dict[str, Any]] = field(default_factory=list)
    left_out: int = 0
    _numbers: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        plan = self.compiled.automaton.plan
        self._numbers = {plan.path(each): number for number, each in enumerate(plan.runners)}

    def add(self, finding: Finding) -> int:
        """The index of the play for a finding; -1 if it has none, or there is no room for it."""
        scenario = finding.scenario
        if scenario is None:
            return -1
        if self.budget.spent and self.plays:
            self.left_out += 1
            return -1
        title = f"{finding.rule} at line {finding.location.line}"
        if isinstance(self.compiled.automaton.plan, MachinePlan):
            data = self._of_machine(title, scenario)
        else:
            played = self._played(scenario)
            data = None if played is None else self._data(title, scenario, played)
        if data is None:
            return -1
        self.budget.take(len(data["records"]), len(self.compiled.automaton.nodes))
        self.plays.append(data)
        return len(self.plays) - 1

    def _of_machine(self, title: str, scenario: Scenario) -> dict[str, Any] | None:
        played = _played_machine(self.compiled, scenario, self._numbers)
        return played and {
            "title": title,
            "ends": scenario.ends.value,
            "story": list(scenario.story),
            "records": played.records,
            **_columns(_machine_spans(scenario, played)),
        }

    def _played(self, scenario: Scenario) -> Played | None:
        """The run; None if it is one of another automaton, where it goes another way.

        That is so for what an engine does otherwise than the paper says.
        """
        if any(path not in self._numbers for path, _ in scenario.outcomes):
            return None
        outcomes = {self._numbers[path]: outcome for path, outcome in scenario.outcomes}
        others = self._equal(outcomes) if self.consistent else {}
        trace = self._trace(scenario)
        try:
            played = play(self.compiled, Wanted(outcomes, trace, others))
        except InternalError:
            return None
        as_stated = played.status.value == scenario.ends.value and all(
            step in played.places for step in trace
        )
        return played if as_stated else None

    def _equal(self, outcomes: Mapping[int, Outcome]) -> dict[int, Outcome]:
        """The outcomes of the other instances of the same actions: the same."""
        runners = self.compiled.automaton.plan.runners
        decided = {runners[number].action: outcome for number, outcome in outcomes.items()}
        return {
            number: decided[runner.action]
            for number, runner in enumerate(runners)
            if runner.action in decided
        }

    def _trace(self, scenario: Scenario) -> list[tuple[Event, int]]:
        return [
            (step.event, self._numbers[step.element])
            for step in scenario.trace
            if step.element in self._numbers
        ]

    def _data(self, title: str, scenario: Scenario, played: Played) -> dict[str, Any]:
        return {
            "title": title,
            "ends": played.status.value,
            "story": list(scenario.story),
            "records": played.records,
            **_columns(self._spans(scenario, played)),
        }

    def _spans(self, scenario: Scenario, played: Played) -> list[_Span]:
        """The records during which each sentence of the story happens.

        Go at line 2 succeeds, and so do 2 more and Say   from the first success to that of Say
        … 3 more steps …                                  what lies between its neighbours
        the parallel_all at line 4 can no longer succeed  where its join collects the failure
        the plan is stuck                                 the end
        """
        spans: list[_Span] = []
        at = 0
        for sentence in scenario.sentences:
            event = sentence.statement.event
            if event is not None:
                numbers = (self._numbers.get(actor.element, -1) for actor in sentence.actors)
                places = [played.places.get((event, number), at) for number in numbers]
                spans.append(_Span(min(places), max(places)))
                at = max(at, *places)
            else:
                spans.append(_Span.at(self._consequence(sentence, scenario, played, at)))
        return _with_gaps(scenario.sentences, spans)

    def _consequence(self, sentence: Sentence, scenario: Scenario, played: Played, at: int) -> int:
        """The record at which a sentence holds that states no event; ``at``: those before it do."""
        records = played.records
        if sentence.statement is Statement.CANNOT_SUCCEED:
            return self._failing_join(sentence.element, records, default=at)
        is_last = sentence is scenario.sentences[-1]
        if sentence.statement.at_once or (sentence.statement is Statement.REMARK and not is_last):
            return at
        silence = (place for place, row in enumerate(records) if row["kind"] == Kind.SILENCE)
        stays = sentence.statement is Statement.WAITS_FOR_EVER
        return next(silence, len(records) - 1) if stays else len(records) - 1

    def _failing_join(self, path: str, records: Sequence[dict[str, Any]], default: int) -> int:
        """The first record at which a control has failed, by its element path."""
        automaton = self.compiled.automaton
        failing = failing_joins(automaton)
        for place, row in enumerate(records):
            if row["kind"] == Kind.JOINED and row["node"] in failing:
                origin = automaton.plan.elements[automaton.nodes[row["node"]].origin]
                if automaton.plan.path(origin) == path:
                    return place
        return default


class _Span(NamedTuple):
    """The records during which a sentence of a story happens, the last one included."""

    first: int
    last: int

    @classmethod
    def at(cls, place: int) -> _Span:
        """The span of one record."""
        return cls(place, place)


def _columns(spans: Sequence[_Span]) -> dict[str, list[int]]:
    """The spans as the view document has them."""
    return {
        "story_from": [span.first for span in spans],
        "story_at": [span.last for span in spans],
    }


def _with_gaps(sentences: Sequence[Sentence], spans: Sequence[_Span]) -> list[_Span]:
    """The spans, in which what is left out lies between its neighbours, and a loop at its start."""
    whole = list(spans)
    for place, sentence in enumerate(sentences[:-1]):
        before = whole[place - 1].last if place else -1
        after = whole[place + 1].first
        if sentence.statement is Statement.STEPS_LEFT_OUT:
            first = min(before + 1, after)
            whole[place] = _Span(first, max(first, after - 1))
        elif sentence.statement is Statement.BEGINS_LOOP:
            whole[place] = _Span.at(after)
    return whole


@dataclass(frozen=True, slots=True)
class Wanted:
    """The run that is wanted: outcomes by runner number, and the events in their order.

    ``others`` gives the outcome of an instance that ``outcomes`` leaves open; without it those
    succeed, unless their provider never does.
    """

    outcomes: Mapping[int, Outcome]
    order: Sequence[tuple[Event, int]] = ()
    others: Mapping[int, Outcome] = field(default_factory=dict)

    @property
    def no_start(self) -> bool:
        """True if an instance fails without having started."""
        return Outcome.NO_START in self.outcomes.values()


@dataclass(slots=True)
class Played:
    """A run: its records as the view document has them, and where its events are among these.

    ``places`` is the index of the record, by event and runner number. ``status``: how it has ended.
    """

    records: list[dict[str, Any]]
    places: dict[tuple[Event, int], int]
    status: Status


def play(compiled: Compiled, wanted: Wanted) -> Played:
    """Run a plan to its end; the same plan and wish give the same run."""
    return _Player(compiled, wanted).run()


class _Course(Kernel):
    """A run without what no play shows: values of parameters, and when runners are unloaded."""

    _prunes = False

    def _parameters(self, _number: int) -> dict[str, RunValue]:
        return {}


class _Player:
    def __init__(self, compiled: Compiled, wanted: Wanted) -> None:
        self._compiled = compiled
        self._wanted = wanted
        self._kernel = _Course(compiled, apart=wanted.no_start)
        self._at_us = 0
        self._unstarted: dict[int, None] = {}  # instances that will fail without having started
        self._played = Played([], {}, Status.QUEUED)
        self._order = [number for event, number in wanted.order if event is not Event.STARTED]
        self._places = {number: place for place, number in enumerate(self._order)}
        self._next = 0

    def run(self) -> Played:
        """Until nothing more happens."""
        kernel = self._kernel
        self._deliver(Input(Kind.BEGIN))
        while kernel.status is Status.RUNNING:
            self._at_us += _SECOND_US
            self._deliver(self._happening())
        while not kernel.status.ended:
            self._deliver(self._stopping())
        self._played.status = kernel.status
        return self._played

    def _happening(self) -> Input:
        """The next input: what is ordered first, and silence once all that is active hangs."""
        number = self._ordered()
        if number is None:
            waiting = chain(self._unstarted, self._kernel.active)
            number = next(filter(self._can_end, waiting), None)
        if number is None:
            return Input(Kind.SILENCE)
        if number in self._unstarted:
            del self._unstarted[number]
            return Input(Kind.NOT_LOADED, runner=number, message="the scenario says so")
        return Input(_ANSWERS.get(self._outcome(number), Kind.FAILED), number)

    def _ordered(self) -> int | None:
        """The first in the order that can end now; what has ended is behind."""
        order = self._order
        while self._next < len(order) and self._has_ended(order[self._next]):
            self._next += 1
        places, waiting = self._places, [*self._unstarted, *self._kernel.active]
        if len(waiting) < len(order) - self._next:
            rest: Iterable[int] = sorted(
                filter(places.__contains__, waiting), key=places.__getitem__
            )
        else:
            rest = islice(order, self._next, None)
        return next(filter(self._can_end, rest), None)

    def _has_ended(self, number: int) -> bool:
        places = self._played.places
        return (Event.SUCCEEDED, number) in places or (Event.FAILED, number) in places

    def _can_end(self, number: int) -> bool:
        if number in self._unstarted:
            return True
        return number in self._kernel.active and self._outcome(number) is not Outcome.HANG

    def _outcome(self, number: int) -> Outcome:
        wanted = self._wanted
        outcome = wanted.outcomes.get(number) or wanted.others.get(number)
        if outcome is not None:
            return outcome
        binding = self._compiled.bindings[number]
        never = binding is not None and binding.provider.outcomes.never_succeeds
        return Outcome.FAILED if never else Outcome.SUCCEEDED

    def _stopping(self) -> Input:
        """The input that ends a run that is stopping: loading fails, and what acts stops."""
        for number in self._unstarted:
            del self._unstarted[number]
            return Input(Kind.NOT_LOADED, runner=number, message="the scenario says so")
        return Input(Kind.STOPPED, next(reversed(self._kernel.active)))

    def _deliver(self, happened: Input) -> None:
        """Take in an input; runners that are to be loaded are there at once."""
        arrived = [happened]
        for each in arrived:
            records, commands = self._kernel.step(each)
            for record in records:
                self._keep(record)
            for command in commands:
                if isinstance(command, Load):
                    if self._refuses(command.runner):
                        self._unstarted[command.runner] = None
                    else:
                        arrived.append(Input(Kind.LOADED, runner=command.runner))

    def _refuses(self, runner: int) -> bool:
        """True if a runner does not start; then each instance has one to itself."""
        return self._kernel.apart and self._outcome(runner) is Outcome.NO_START

    def _keep(self, record: Record) -> None:
        row = _row(record, self._at_us)
        if row is None:
            return
        if record.kind is Kind.NOT_LOADED:
            row["node"] = self._kernel.automaton.runner_node(record.runner)
        event = _EVENTS.get(record.kind)
        if event is not None and record.node > 0:
            happened = event, self._kernel.automaton.runner_number(record.node)
            self._played.places.setdefault(happened, len(self._played.records))
        self._played.records.append(row)


def _row(record: Record, at_us: int) -> dict[str, Any] | None:
    """A record as the view document has it; None for one that is not shown."""
    kind = _SHOWN.get(record.kind)
    if kind is None:
        return None
    row: dict[str, Any] = {"kind": kind, "at_us": at_us, "node": record.node}
    if record.kind is Kind.ENDED and record.data:
        row["data"] = dict(record.data)
    if record.message:
        row["message"] = record.message
    return row


# --- machines -----------------------------------------------------------------------------------


_MOST_FURTHER = 50
"""So many steps a run goes on that would go on for ever."""


class _MachinePlay(NamedTuple):
    """The records of a run, and the index of the record of each of its steps."""

    records: list[dict[str, Any]]
    steps: list[int]


def _played_machine(
    compiled: Compiled, scenario: Scenario, numbers: Mapping[str, int]
) -> _MachinePlay | None:
    """The run of a scenario; None if the machine takes another course.

    ``numbers``: runners by element path.
    """
    outcomes = [(numbers[path], outcome) for path, outcome in scenario.outcomes if path in numbers]
    if len(outcomes) != len(scenario.outcomes):
        return None
    player = _MachinePlayer(compiled)
    status = player.run(outcomes, silence=scenario.ends is End.STUCK)
    endless = scenario.ends is End.ENDLESS and status is Status.RUNNING
    if status is None or not (endless or status.value == scenario.ends.value):
        return None
    return _MachinePlay(player.records, player.steps)


def play_visits(
    compiled: Compiled, outcomes: Sequence[tuple[int, Outcome]]
) -> tuple[list[dict[str, Any]], list[int], str]:
    """A run of a machine that begins so: records, the places of these steps, and the end.

    What comes after these outcomes succeeds, for a while.
    """
    instants = Instants(compiled.automaton)
    at = instants.first().configuration
    whole = [*outcomes]
    for number, outcome in outcomes:
        at = instants.after(at, number, CODES[Event(outcome.value)]).configuration
    while at.active and at.ended == GOING and len(whole) < len(outcomes) + _MOST_FURTHER:
        number = (at.active & -at.active).bit_length() - 1
        whole.append((number, Outcome.SUCCEEDED))
        at = instants.after(at, number, CODES[Event.SUCCEEDED]).configuration
    player = _MachinePlayer(compiled)
    status = player.run(whole, silence=not at.active)
    assert status is not None, "the kernel does what the instants say"
    ends = status.value if status.ended else End.ENDLESS.value
    return player.records, player.steps[: len(outcomes)], ends


def _machine_spans(scenario: Scenario, played: _MachinePlay) -> list[_Span]:
    """The records during which each sentence of the story happens."""
    spans: list[_Span] = []
    step, at = 0, 0
    for sentence in scenario.sentences:
        if sentence.statement is Statement.STEPS_LEFT_OUT:
            step += sentence.count
        elif sentence.statement.event is not None and step < len(played.steps):
            at = played.steps[step]
            step += 1
        elif not sentence.statement.at_once and sentence is scenario.sentences[-1]:
            at = len(played.records) - 1
        spans.append(_Span.at(at))
    return _with_gaps(scenario.sentences, spans)


class _MachinePlayer:
    def __init__(self, compiled: Compiled) -> None:
        self.kernel = kernel_of(compiled)
        self.records: list[dict[str, Any]] = []
        self.steps: list[int] = []
        self._at_us = 0

    def run(self, outcomes: Sequence[tuple[int, Outcome]], *, silence: bool) -> Status | None:
        """The status after these outcomes; None if one of them cannot occur."""
        kernel = self.kernel
        self._deliver(Input(Kind.BEGIN))
        hanging = set()
        for number, outcome in outcomes:
            self._at_us += _SECOND_US
            if kernel.status is not Status.RUNNING or number not in kernel.active:
                return None
            self.steps.append(len(self.records))
            if outcome in _ANSWERS:
                self._deliver(Input(_ANSWERS[outcome], number))
            else:  # it is active for ever: nothing is recorded
                hanging.add(number)
        if silence and kernel.status is Status.RUNNING and hanging.issuperset(kernel.active):
            self._at_us += _SECOND_US
            self._deliver(Input(Kind.SILENCE))
        while kernel.status is not Status.RUNNING and not kernel.status.ended:
            self._deliver(Input(Kind.STOPPED, next(reversed(kernel.active))))
        last = max(len(self.records) - 1, 0)
        self.steps = [min(step, last) for step in self.steps]
        return kernel.status

    def _deliver(self, happened: Input) -> None:
        """Take in an input; what is to be loaded is there at once, and what is to stop stops."""
        arrived = [happened]
        for each in arrived:
            records, commands = self.kernel.step(each)
            rows = (_row(record, self._at_us) for record in records)
            self.records += [row for row in rows if row is not None]
            for command in commands:
                if isinstance(command, Load):
                    arrived.append(Input(Kind.LOADED, runner=command.runner))
                elif isinstance(command, Stop) and self.kernel.status is Status.RUNNING:
                    arrived.append(Input(Kind.STOPPED, command.number))
