"""A campaign: many runs of one plan, held against properties, in one process or in several.

``run_campaign`` hands out jobs and collects what breaks; ``Work`` is what a worker does: play runs
and say what breaks a property, or make a run plainer.
"""

from __future__ import annotations

import math
import os
import pickle
import time
from collections import deque
from dataclasses import dataclass, field
from itertools import chain
from typing import TYPE_CHECKING, TypeAlias

from gpsfsm.errors import (
    DEBUG_VARIABLE,
    GpsfsmError,
    InternalError,
    UsageError,
    is_out_of_memory,
    misused,
)
from gpsfsm.execution.records import Status
from gpsfsm.fuzzing.runs import play
from gpsfsm.fuzzing.shrinking import shrink
from gpsfsm.fuzzing.subject import TimedScenario, draw
from gpsfsm.workers import LATER, engine_of, map_items
from gpsfsm.workers.builtin.serial import Serial

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from gpsfsm.fuzzing.properties import Breach, Property
    from gpsfsm.fuzzing.runs import Run
    from gpsfsm.fuzzing.subject import Subject
    from gpsfsm.progress import Tick
    from gpsfsm.workers import Engine, Later

DEFAULT_RUNS = 1_000
MOST_BREACHES = 20
"""So many breaches of one property are told; more of them say nothing new."""
_RUNS_AT_ONCE = 32
"""So many runs are handed to a worker at once, and fewer of a large plan."""
_WORK_AT_ONCE = 8_000
"""The elements that these runs have together."""
_ROUNDS = 4
"""Each worker gets so many chunks at least, so that all end at about the same time."""


@dataclass(frozen=True, slots=True)
class Failure:
    """A property is broken: the breach, and the plainest run that shows it."""

    broken: Property
    breach: Breach
    run: Run


@dataclass(slots=True)
class Campaign:
    """The outcome of a campaign.

    - ``runs``: the number of runs, not counting those for shrinking.
    - ``cut_off``: the time ran out before all runs were done.
    - ``unended``: the number of runs of a machine that were cut off after their visits.
    - ``failures``: sorted by property, then by document order.
    - ``more``: for each property, the number of kinds of breaches that are not reported.
    """

    properties: tuple[Property, ...]
    runs: int = 0
    cut_off: bool = False
    unended: int = 0
    failures: list[Failure] = field(default_factory=list)
    more: dict[str, int] = field(default_factory=dict)

    @property
    def held(self) -> tuple[str, ...]:
        """The names of the properties that no run broke."""
        broken = {one.broken.name for one in self.failures}
        return tuple(one.name for one in self.properties if one.name not in broken)

    def broken_kinds(self, broken: Property) -> int:
        """The number of kinds of breaches of this property."""
        shown = sum(one.broken.name == broken.name for one in self.failures)
        return shown + self.more.get(broken.name, 0)


def run_campaign(
    subject: Subject,
    properties: Sequence[Property],
    *,
    seed: int = 0,
    runs: int = DEFAULT_RUNS,
    time_s: float | None = None,
    first: Iterable[TimedScenario] = (),
    jobs: int | str = 1,
    clock: Callable[[], float] = time.monotonic,
    progress: Tick | None = None,
    keep: Callable[[Failure], object] = lambda _: None,
) -> Campaign:
    """Play ``runs`` scenarios drawn from the seed, after those that come ``first``.

    After ``time_s`` seconds no further run begins, or, where ``jobs`` names several workers
    (docs/scale.md), no further chunk of runs; a scenario that fails by then is still shrunk.
    ``progress`` is called with the number of runs played so far, and of all (None: as many as the
    time allows); ``keep`` with each failure at once. All that is found depends on the
    arguments, ``jobs`` not among them, and on how many runs there was time for. Raises UsageError
    for a property that cannot be checked, or cannot be checked there.
    """
    if progress is not None and not callable(progress):
        raise misused("run_campaign", "a function or None as progress", progress)
    began = clock()
    earlier = tuple(first)
    engine = engine_of(jobs, None if time_s is not None else len(earlier) + runs)
    if not isinstance(engine, Serial):
        refuse_unsendable(properties)
    work = Work(subject, tuple(properties), seed)
    course = _Course(work, earlier, runs, progress, bounded=time_s is None)
    items = course.items(engine, lambda: time_s is not None and clock() - began >= time_s)
    for answer in map_items(engine, work, items, lost=_lost):
        course.take(answer, keep)
    order = {broken.name: place for place, broken in enumerate(properties)}
    course.campaign.failures.sort(
        key=lambda one: (order[one.broken.name], one.breach.numbers, one.breach.about)
    )
    return course.campaign


def _lost(item: Job, how: str) -> Answer:
    what = f"played {len(item)} runs" if isinstance(item, Runs) else "made a run plainer"
    return Failed(f"the process that {what} {how}; use fewer --jobs")


class _Course:
    """The progress of a campaign. Answers come in the order of the items."""

    def __init__(
        self,
        work: Work,
        earlier: tuple[TimedScenario, ...],
        runs: int,
        progress: Tick | None,
        *,
        bounded: bool,
    ) -> None:
        self._work = work
        self._earlier = earlier
        self._total = len(earlier) + runs
        self._progress, self._sure = progress, self._total if bounded else None
        self._begun = 0
        self._running: deque[Job] = deque()
        self._plainer: deque[Plainer] = deque()
        self._seen_kinds: set[tuple[str, tuple[str, ...]]] = set()
        self._kinds: dict[str, int] = {}
        self.campaign = Campaign(work.properties)

    def items(self, engine: Engine, over: Callable[[], bool]) -> Iterator[Job | Later]:
        """The items to be done: breaches to be shrunk first, then runs until there are enough."""
        size = self._size(engine)
        while True:
            if self._plainer:
                self._running.append(self._plainer.popleft())
                yield self._running[-1]
            elif self._begun < self._total and not self.campaign.cut_off:
                if over():
                    self.campaign.cut_off = True
                    continue
                self._running.append(self._next_runs(size))
                yield self._running[-1]
            elif self._running:
                yield LATER  # what comes in may have to be made plainer
            else:
                return

    def _size(self, engine: Engine) -> int:
        """The number of runs in an item; one, where everything is done here."""
        if isinstance(engine, Serial):
            return 1
        elements = max(1, len(self._work.subject.plan.elements))
        at_once = max(1, min(_RUNS_AT_ONCE, _WORK_AT_ONCE // elements) // engine.chunk_size)
        return min(at_once, math.ceil(self._total / (_ROUNDS * engine.ahead)))

    def _next_runs(self, size: int) -> Runs:
        begin, end = self._begun, min(self._begun + size, self._total)
        self._begun = end
        earlier = self._earlier[begin:end]
        first = max(0, begin - len(self._earlier))
        return Runs(earlier, first, end - begin - len(earlier))

    def take(self, answer: Answer, keep: Callable[[Failure], object]) -> None:
        """Take in the next answer. Raises GpsfsmError if there is none."""
        item = self._running.popleft()
        if isinstance(answer, Failed):
            raise (InternalError if answer.defect else GpsfsmError)(answer.message)
        if isinstance(item, Plainer):
            assert isinstance(answer, TimedScenario)
            self.campaign.failures.append(self._failure(item, answer))
            keep(self.campaign.failures[-1])
            return
        assert isinstance(answer, Played)
        for broken in answer.broken:
            self._note(broken)
        self.campaign.unended += answer.unended
        assert isinstance(item, Runs)
        for _ in range(len(item)):
            self.campaign.runs += 1
            if self._progress is not None:
                self._progress(self.campaign.runs, self._sure)

    def _note(self, broken: Broken) -> None:
        """Have a breach of a new kind made plainer, unless there are too many."""
        name = self._work.properties[broken.number].name
        if (name, broken.breach.about) in self._seen_kinds:
            return
        self._seen_kinds.add((name, broken.breach.about))
        if self._kinds.setdefault(name, 0) >= MOST_BREACHES:
            self.campaign.more[name] = self.campaign.more.get(name, 0) + 1
            return
        self._kinds[name] += 1
        self._plainer.append(Plainer(broken.number, broken.breach, broken.scenario))

    def _failure(self, item: Plainer, scenario: TimedScenario) -> Failure:
        """The breach in the plainest run, or where it was found, should it not be there again."""
        work, broken = self._work, self._work.properties[item.number]
        run = play(work.subject, scenario, seed=work.seed)
        for breach in broken.check(run):
            if breach.about == item.breach.about:
                return Failure(broken, breach, run)
        first = play(work.subject, item.scenario, seed=work.seed)
        return Failure(broken, item.breach, first)


class Job:
    """Something for a worker to do."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Runs(Job):
    """Runs to be played: scenarios of earlier runs, then ``count`` drawn ones from ``first`` on."""

    earlier: tuple[TimedScenario, ...]
    first: int
    count: int

    def __len__(self) -> int:
        return len(self.earlier) + self.count


@dataclass(frozen=True, slots=True)
class Broken:
    """A run breaks a property, which is named by its number."""

    number: int
    breach: Breach
    scenario: TimedScenario


@dataclass(frozen=True, slots=True)
class Played:
    """The results of runs: the breaches, and how many of a machine were cut off."""

    broken: tuple[Broken, ...]
    unended: int


@dataclass(frozen=True, slots=True)
class Plainer(Job):
    """A scenario to be made as plain as can be."""

    number: int
    breach: Breach
    scenario: TimedScenario


@dataclass(frozen=True, slots=True)
class Failed:
    """It could not be done; ``message`` says why. ``defect``: gpsfsm is wrong."""

    message: str
    defect: bool = False


Answer: TypeAlias = "Played | TimedScenario | Failed"


@dataclass(frozen=True, slots=True)
class Work:
    """Everything that is the same for the whole campaign."""

    subject: Subject
    properties: tuple[Property, ...]
    seed: int

    def __call__(self, item: Job) -> Answer:
        """Do it. Raises UsageError for a property that cannot be checked."""
        try:
            if isinstance(item, Plainer):
                return self._plainest(item)
            assert isinstance(item, Runs)
            return self._played(item)
        except UsageError:
            raise
        except GpsfsmError as error:
            return Failed(str(error), defect=isinstance(error, InternalError))
        except Exception as error:
            if is_out_of_memory(error):
                return Failed("memory ran out during a run", defect=False)
            if os.environ.get(DEBUG_VARIABLE):
                raise
            return Failed(f"a run failed ({type(error).__name__}: {error})", defect=True)

    def _played(self, item: Runs) -> Played:
        """The breaches in order, of each kind the first one."""
        broken_ones: dict[tuple[int, tuple[str, ...]], Broken] = {}
        drawn = (draw(self.subject, self.seed, item.first + n) for n in range(item.count))
        unended = 0
        for scenario in chain(item.earlier, drawn):
            run = play(self.subject, scenario, seed=self.seed)
            unended += run.status is Status.CANCELLED
            for number, broken in enumerate(self.properties):
                for breach in broken.check(run):
                    key = (number, breach.about)
                    if key not in broken_ones:
                        broken_ones[key] = Broken(number, breach, scenario)
        return Played(tuple(broken_ones.values()), unended)

    def _plainest(self, item: Plainer) -> TimedScenario:
        about, broken = item.breach.about, self.properties[item.number]

        def shows(scenario: TimedScenario) -> bool:
            run = play(self.subject, scenario, seed=self.seed)
            return any(breach.about == about for breach in broken.check(run))

        return shrink(self.subject, item.scenario, shows)


def refuse_unsendable(properties: Sequence[Property]) -> None:
    """Raise UsageError for a property that no other process can be told of."""
    for each in properties:
        try:
            pickle.dumps(each)
        except Exception as error:  # its kinds are as many as there are objects
            raise UsageError(
                f"the property {each.name:.100} cannot be handed to other processes; use a "
                "function of a module or of a file, or --jobs 1"
            ) from error
