"""How runners, units and runs are named in messages."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import Event, Outcome
from gpsfsm.model.plan import Element, Kind
from gpsfsm.model.words import action, brief

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

__all__ = ["action", "listed", "place", "story"]

_MAX_STEPS = 8


def place(element: Element) -> str:
    """An element with its line: ``WaypointRunner (x=1.0, y=3.0) at line 5``.

    Where other elements like it begin on the line, the column is named too.
    """
    if element.kind is Kind.RUNNER:
        what = action(element)
    elif element.kind is Kind.CONTROL:
        name = element.text("name")
        what = f"the {element.words}" + (f" '{brief(name)}'" if name else "")
    else:
        what = f"the {element.tag or 'plan'}"
    return f"{what} at {element.where}"


def listed(items: Sequence[str], *, most: int = 3) -> str:
    """``a``, ``a and b``, ``a, b and c``, ``a, b, c and 4 more``."""
    shown = list(items[:most])
    if len(items) > most:
        return f"{', '.join(shown)} and {len(items) - most} more"
    if len(shown) <= 1:
        return "".join(shown)
    return f"{', '.join(shown[:-1])} and {shown[-1]}"


def story(
    automaton: Automaton,
    trace: Iterable[Signal],
    closing: Sequence[str],
    outcomes: Mapping[int, Outcome],
) -> tuple[str, ...]:
    """A trace as numbered sentences would tell it, with what it comes to at the end.

    ``outcomes``: by node, of the runners whose outcome matters.
    """
    plan = automaton.plan
    steps: list[tuple[str, str]] = []
    ended = {signal.node for signal in trace if signal.event is not Event.STARTED}
    for signal in trace:
        if automaton.nodes[signal.node].kind is not NodeKind.RUNNER:
            continue
        who = place(plan.elements[automaton.nodes[signal.node].origin])
        if signal.event is Event.SUCCEEDED:
            steps.append(("succeeds", who))
        elif signal.event is Event.FAILED:
            no_start = outcomes.get(signal.node) is Outcome.NO_START
            steps.append(("does not start, and so fails" if no_start else "fails", who))
        elif outcomes.get(signal.node) is Outcome.HANG:
            steps.append(("starts and never ends", who))
        elif signal.node not in ended:
            steps.append(("is running", who))
    return (*_shortened(steps), *closing)


def _shortened(steps: list[tuple[str, str]]) -> list[str]:
    """Sentences; long rows of the same are told in one."""
    told: list[str] = []
    position = 0
    while position < len(steps):
        verb, who = steps[position]
        length = 1
        while position + length < len(steps) and steps[position + length][0] == verb:
            length += 1
        if length > (3 if verb == "succeeds" else 6):  # failures are what matters
            last = steps[position + length - 1][1]
            told.append(f"{who} {verb}, and so do {length - 2} more and {last}")
            position += length
        else:
            told.append(f"{who} {verb}")
            position += 1
    if len(told) > _MAX_STEPS:
        hidden = len(told) - _MAX_STEPS
        told = [*told[:2], f"… {hidden} more steps …", *told[2 + hidden :]]
    return told
