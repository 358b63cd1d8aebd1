"""What workers do in a campaign: play runs and say what breaks a property, or make a run plainer.

It travels to other processes, so it holds the subject and the properties, and answers in data.
"""

from __future__ import annotations

import os
import pickle
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING, TypeAlias

from gpsfsm.errors import (
    DEBUG_VARIABLE,
    GpsfsmError,
    InternalError,
    UsageError,
    is_out_of_memory,
)
from gpsfsm.fuzzing.drawing import draw
from gpsfsm.fuzzing.playing import play
from gpsfsm.fuzzing.shrinking import shrink

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.fuzzing.acts import TimedScenario
    from gpsfsm.fuzzing.properties.base import Breach, Property
    from gpsfsm.fuzzing.subject import Subject

__all__ = ["Answer", "Broken", "Failed", "Job", "Plainer", "Runs", "Work", "refuse_unsendable"]


class Job:
    """Something for a worker to do."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Runs(Job):
    """Runs to be played: scenarios that are given, then ``count`` drawn ones from ``first`` on."""

    given: tuple[TimedScenario, ...]
    first: int
    count: int

    def __len__(self) -> int:
        return len(self.given) + self.count


@dataclass(frozen=True, slots=True)
class Broken:
    """A run breaks a property, which is named by its number."""

    number: int
    breach: Breach
    scenario: TimedScenario


@dataclass(frozen=True, slots=True)
class Plainer(Job):
    """A scenario to be made as plain as can be."""

    number: int
    breach: Breach
    scenario: TimedScenario


@dataclass(frozen=True, slots=True)
class Failed:
    """It could not be done; ``told`` says why. ``defect``: gpsfsm is wrong."""

    told: str
    defect: bool = False


Answer: TypeAlias = "tuple[Broken, ...] | TimedScenario | Failed"


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
                return Failed("the memory has run out during a run", defect=False)
            if os.environ.get(DEBUG_VARIABLE):
                raise
            return Failed(f"a run failed ({type(error).__name__}: {error})", defect=True)

    def _played(self, item: Runs) -> tuple[Broken, ...]:
        """The breaches in order, of each kind the first one."""
        found: dict[tuple[int, tuple[str, ...]], Broken] = {}
        drawn = (draw(self.subject, self.seed, item.first + n) for n in range(item.count))
        for scenario in chain(item.given, drawn):
            run = play(self.subject, scenario, seed=self.seed)
            for number, broken in enumerate(self.properties):
                for breach in broken.check(run):
                    key = (number, breach.about)
                    if key not in found:
                        found[key] = Broken(number, breach, scenario)
        return tuple(found.values())

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
