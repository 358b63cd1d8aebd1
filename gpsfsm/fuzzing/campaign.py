"""A campaign: many runs of one plan, held against properties, in one process or in several."""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from gpsfsm.errors import GpsfsmError, InternalError
from gpsfsm.fuzzing.playing import play
from gpsfsm.fuzzing.work import Answer, Broken, Failed, Job, Plainer, Runs, Work, refuse_unsendable
from gpsfsm.workers import LATER, engine_of, run
from gpsfsm.workers.known.serial import Serial

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from gpsfsm.fuzzing.acts import TimedScenario
    from gpsfsm.fuzzing.properties.base import Breach, Property
    from gpsfsm.fuzzing.record import Run
    from gpsfsm.fuzzing.subject import Subject
    from gpsfsm.workers import Engine, Later

__all__ = ["DEFAULT_RUNS", "MOST_FOUND", "Campaign", "Found", "run_campaign"]

DEFAULT_RUNS = 1_000
MOST_FOUND = 20
"""So many breaches of one property are told; more of them say nothing new."""
_RUNS_AT_ONCE = 32
"""So many runs are handed to a worker at once, and fewer of a large plan."""
_WORK_AT_ONCE = 8_000
"""The elements that these runs have together."""
_ROUNDS = 4
"""Each worker gets so many chunks at least, so that all end at about the same time."""


@dataclass(frozen=True, slots=True)
class Found:
    """A property is broken: the breach, and the plainest run that shows it."""

    broken: Property
    breach: Breach
    run: Run


@dataclass(slots=True)
class Campaign:
    """What a campaign came to.

    ``runs`` were played, those of shrinking not counted. ``cut_off``: the time was over before all
    were. ``found`` is in the order of the properties, then of document order; ``more`` counts by
    property the kinds of breaches that are not told.
    """

    properties: tuple[Property, ...]
    runs: int = 0
    cut_off: bool = False
    found: list[Found] = field(default_factory=list)
    more: dict[str, int] = field(default_factory=dict)

    @property
    def held(self) -> tuple[str, ...]:
        """The names of the properties that no run has broken."""
        broken = {one.broken.name for one in self.found}
        return tuple(one.name for one in self.properties if one.name not in broken)


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
    tick: Callable[[int], object] = lambda _: None,
    keep: Callable[[Found], object] = lambda _: None,
) -> Campaign:
    """Play ``runs`` scenarios drawn from the seed, after those that come ``first``.

    After ``time_s`` seconds no further run begins, or, where ``jobs`` names several workers
    (docs/scale.md), no further chunk of runs; a scenario that fails by then is still shrunk.
    ``tick`` is told the number of runs played so far, ``keep`` what is found as soon as it is. All
    that is found depends on the arguments, ``jobs`` not among them, and on how many runs there was
    time for. Raises UsageError for a property that cannot be checked, or cannot be checked there.
    """
    began = clock()
    given = tuple(first)
    engine = engine_of(jobs, None if time_s is not None else len(given) + runs)
    if not isinstance(engine, Serial):
        refuse_unsendable(properties)
    work = Work(subject, tuple(properties), seed)
    course = _Course(work, given, runs)
    items = course.items(engine, lambda: time_s is not None and clock() - began >= time_s)
    for answer in run(engine, work, items, lost=_lost):
        course.take(answer, tick, keep)
    order = {broken.name: place for place, broken in enumerate(properties)}
    course.campaign.found.sort(
        key=lambda one: (order[one.broken.name], one.breach.numbers, one.breach.about)
    )
    return course.campaign


def _lost(item: Job, how: str) -> Answer:
    what = f"played {len(item)} runs" if isinstance(item, Runs) else "made a run plainer"
    return Failed(f"the process that {what} {how}; use fewer --jobs")


class _Course:
    """How far a campaign is. Answers come in the order of the items."""

    def __init__(self, work: Work, given: tuple[TimedScenario, ...], runs: int) -> None:
        self._work = work
        self._given = given
        self._total = len(given) + runs
        self._begun = 0
        self._under_way: deque[Job] = deque()
        self._plainer: deque[Plainer] = deque()
        self._known: set[tuple[str, tuple[str, ...]]] = set()
        self._kinds: dict[str, int] = {}
        self.campaign = Campaign(work.properties)

    def items(self, engine: Engine, over: Callable[[], bool]) -> Iterator[Job | Later]:
        """What is to be done: what was found first, then runs until there are enough."""
        size = self._size(engine)
        while True:
            if self._plainer:
                self._under_way.append(self._plainer.popleft())
                yield self._under_way[-1]
            elif self._begun < self._total and not self.campaign.cut_off:
                if over():
                    self.campaign.cut_off = True
                    continue
                self._under_way.append(self._next_runs(size))
                yield self._under_way[-1]
            elif self._under_way:
                yield LATER  # what comes in may have to be made plainer
            else:
                return

    def _size(self, engine: Engine) -> int:
        """How many runs there are in an item; one, where everything is done here."""
        if isinstance(engine, Serial):
            return 1
        elements = max(1, len(self._work.subject.plan.elements))
        at_once = max(1, min(_RUNS_AT_ONCE, _WORK_AT_ONCE // elements) // engine.chunk_size)
        return min(at_once, math.ceil(self._total / (_ROUNDS * engine.ahead)))

    def _next_runs(self, size: int) -> Runs:
        begin, end = self._begun, min(self._begun + size, self._total)
        self._begun = end
        given = self._given[begin:end]
        first = max(0, begin - len(self._given))
        return Runs(given, first, end - begin - len(given))

    def take(
        self, answer: Answer, tick: Callable[[int], object], keep: Callable[[Found], object]
    ) -> None:
        """Take in the next answer. Raises GpsfsmError if there is none."""
        item = self._under_way.popleft()
        if isinstance(answer, Failed):
            raise (InternalError if answer.defect else GpsfsmError)(answer.told)
        if isinstance(item, Plainer):
            assert not isinstance(answer, tuple)
            self.campaign.found.append(self._found(item, answer))
            keep(self.campaign.found[-1])
            return
        assert isinstance(answer, tuple)
        for broken in answer:
            self._note(broken)
        assert isinstance(item, Runs)
        for _ in range(len(item)):
            self.campaign.runs += 1
            tick(self.campaign.runs)

    def _note(self, broken: Broken) -> None:
        """Have a breach of a new kind made plainer, unless there are too many."""
        name = self._work.properties[broken.number].name
        if (name, broken.breach.about) in self._known:
            return
        self._known.add((name, broken.breach.about))
        if self._kinds.setdefault(name, 0) >= MOST_FOUND:
            self.campaign.more[name] = self.campaign.more.get(name, 0) + 1
            return
        self._kinds[name] += 1
        self._plainer.append(Plainer(broken.number, broken.breach, broken.scenario))

    def _found(self, item: Plainer, scenario: TimedScenario) -> Found:
        """The breach in the plainest run, or where it was found, should it not be there again."""
        work, broken = self._work, self._work.properties[item.number]
        run = play(work.subject, scenario, seed=work.seed)
        for breach in broken.check(run):
            if breach.about == item.breach.about:
                return Found(broken, breach, run)
        first = play(work.subject, item.scenario, seed=work.seed)
        return Found(broken, item.breach, first)
