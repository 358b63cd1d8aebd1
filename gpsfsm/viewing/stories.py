"""Which record of a run each sentence of its story tells of.

Stories are told by the analyses (``analysis/words.py``); a sentence names a runner with its place,
and says what it does. Long rows of the same are told in one sentence, of which the last is shown.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.words import place
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.model.plan import Plan

__all__ = ["story_places"]

_VERBS: Mapping[Event, tuple[str, ...]] = {
    Event.SUCCEEDED: ("succeeds",),
    Event.FAILED: ("fails", "does not start, and so fails"),
    Event.STARTED: ("is running", "starts and never ends"),
}
_Step = tuple[Event, int]


def story_places(
    story: Sequence[str],
    plan: Plan,
    trace: Sequence[_Step],
    places: Mapping[_Step, int],
    last: int,
) -> list[int]:
    """Per sentence the index of a record; ``last`` is that of the run's last one.

    ``trace``: the events in their order, by runner number; ``places``: their records. A sentence
    that names no event, such as what it all comes to, stands where the sentence before it does,
    and the very last one at the end.
    """
    ended = {who for event, who in trace if event is not Event.STARTED}
    told = [
        (event, who, _sentences(plan, event, who))
        for event, who in trace
        if event is not Event.STARTED or who not in ended  # else its end tells it
    ]
    found: list[int] = []
    at = 0
    for line in story:
        match = next((each for each in range(at, len(told)) if _tells(line, told[each][2])), None)
        if match is None:
            found.append(found[-1] if found else 0)
            continue
        event, _, _ = told[match]
        if " more and " in line:  # it tells of all of a row, and the last is behind the others
            while match + 1 < len(told) and told[match + 1][0] is event:
                match += 1
        at = match + 1
        here = places.get((event, told[match][1]), found[-1] if found else 0)
        found.append(max(here, found[-1]) if found else here)
    if story and not any(_tells(story[-1], sentences) for _, _, sentences in told):
        found[-1] = last
    return found


def _sentences(plan: Plan, event: Event, number: int) -> tuple[str, ...]:
    who = place(plan.runners[number])
    return tuple(f"{who} {verb}" for verb in _VERBS.get(event, ()))


def _tells(line: str, sentences: Sequence[str]) -> bool:
    return any(line == each or line.startswith(f"{each}, and so do ") for each in sentences)
