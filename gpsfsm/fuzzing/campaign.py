"""A campaign: many runs of one plan, held against properties."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from gpsfsm.fuzzing.drawing import draw
from gpsfsm.fuzzing.playing import play
from gpsfsm.fuzzing.shrinking import shrink

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from gpsfsm.fuzzing.acts import TimedScenario
    from gpsfsm.fuzzing.properties.base import Breach, Property
    from gpsfsm.fuzzing.record import Run
    from gpsfsm.fuzzing.subject import Subject

__all__ = ["DEFAULT_RUNS", "MOST_FOUND", "Campaign", "Found", "run_campaign"]

DEFAULT_RUNS = 1_000
MOST_FOUND = 20
"""So many breaches of one property are told; more of them say nothing new."""


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
    clock: Callable[[], float] = time.monotonic,
    tick: Callable[[int], object] = lambda _: None,
    keep: Callable[[Found], object] = lambda _: None,
) -> Campaign:
    """Play ``runs`` scenarios drawn from the seed, after those that come ``first``.

    After ``time_s`` seconds no further run begins; a scenario that fails by then is still shrunk.
    ``tick`` is told the number of runs played so far, ``keep`` what is found as soon as it is. All
    that is found depends on the arguments alone, and on how many runs there was time for.
    """
    campaign = Campaign(tuple(properties))
    began = clock()
    known: dict[tuple[str, tuple[str, ...]], None] = {}
    given = list(first)
    for index in range(len(given) + runs):
        if time_s is not None and clock() - began >= time_s:
            campaign.cut_off = True
            break
        drawn = index - len(given)
        scenario = given[index] if drawn < 0 else draw(subject, seed, drawn)
        run = play(subject, scenario, seed=seed)
        campaign.runs += 1
        for broken in properties:
            for breach in broken.check(run):
                key = (broken.name, breach.about)
                if key not in known:
                    known[key] = None
                    if _take(campaign, subject, Found(broken, breach, run), seed):
                        keep(campaign.found[-1])
        tick(campaign.runs)
    order = {broken.name: place for place, broken in enumerate(properties)}
    campaign.found.sort(
        key=lambda one: (order[one.broken.name], one.breach.numbers, one.breach.about)
    )
    return campaign


def _take(campaign: Campaign, subject: Subject, found: Found, seed: int) -> bool:
    """Take in a breach of a new kind in its plainest form, unless there are too many."""
    name = found.broken.name
    if sum(one.broken.name == name for one in campaign.found) >= MOST_FOUND:
        campaign.more[name] = campaign.more.get(name, 0) + 1
        return False
    campaign.found.append(plainest(subject, found, seed=seed))
    return True


def plainest(subject: Subject, found: Found, *, seed: int = 0) -> Found:
    """The same breach in the plainest scenario that shows it."""
    broken, about = found.broken, found.breach.about

    def shows(scenario: TimedScenario) -> Found | None:
        run = play(subject, scenario, seed=seed)
        for breach in broken.check(run):
            if breach.about == about:
                return Found(broken, breach, run)
        return None

    scenario = shrink(subject, found.run.scenario, lambda tried: shows(tried) is not None)
    return shows(scenario) or found
