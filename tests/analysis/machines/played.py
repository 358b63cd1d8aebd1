"""The exploration of a machine that plays every instant: simple, and as slow as that."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.machines.search import Step
from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.compile.instants import FAILED, HANG, SUCCEEDED, Instants, bits
from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.model.automaton import Automaton, Tie

CODES = {Outcome.SUCCEEDED: SUCCEEDED, Outcome.FAILED: FAILED, Outcome.HANG: HANG}


class Played:
    """All configurations and steps of a machine, breadth-first; every instant is played.

    Raises InconclusiveError for a machine of more than ``most`` configurations.
    """

    def __init__(
        self,
        automaton: Automaton,
        allowed: Sequence[frozenset[Outcome]],
        rows: Sequence[Tie] = (),
        *,
        most: int = 600,
    ) -> None:
        instants = Instants(automaton, rows)
        self.configurations = [instants.first().configuration]
        self.steps: list[list[Step]] = []
        self.origins: list[Any] = [None]
        numbers = {self.configurations[0]: 0}
        for at, before in enumerate(self.configurations):  # grows while it is read
            if at == most:
                raise InconclusiveError
            self.steps.append([])
            for number in bits(before.active):
                for outcome in sorted(CODES[each] for each in allowed[number]):
                    if outcome == HANG:
                        after, moved, joined = instants.hanging(before, number), 1 << number, 0
                    elif instants.fixed(before, number) in (None, outcome):
                        instant = instants.after(before, number, outcome)
                        after, moved, joined = (
                            instant.configuration,
                            instant.moved,
                            instant.joined,
                        )
                    else:
                        continue
                    new = after not in numbers
                    target = numbers.setdefault(after, len(numbers))
                    step = Step(number, outcome, target, moved, joined)
                    self.steps[at].append(step)
                    if new:
                        self.configurations.append(after)
                        self.origins.append((at, step))
