"""What an engine cannot do as the paper says, in words."""

from __future__ import annotations

from enum import IntEnum
from itertools import groupby
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.model.engine import FABRIC_V1, FABRIC_V2
from gpsfsm.porting.result import Loss

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from gpsfsm.model.plan import Element, Plan

__all__ = ["Lost", "Reason", "losses_of"]


class Reason(IntEnum):
    """Why a unit cannot be ported."""

    ALL = 1
    ANY = 2
    BACKGROUND = 3
    ALTERNATIVE_ROW = 4
    GUARDS_ROW = 5
    ROW_IN_RECOVERY = 6
    IGNORES_FAILURE = 7
    BEHIND_LEFT_OUT = 8
    ALTERNATIVE_LEFT_OUT = 9
    GUARDS_BEFORE_LAST = 10


class Lost(NamedTuple):
    """A loss, by the element of the plan that it is about; ``steps`` is how many are concerned."""

    element: int
    reason: Reason
    steps: int


_LOST = {
    Reason.ALL: (
        "{steps} steps run at the same time, and the first failure is enough; {parallel}, and it "
        "goes on waiting when one has failed",
        "one after the other: each step begins when the one before it has succeeded",
    ),
    Reason.ANY: (
        "{steps} steps run at the same time, and the first success is enough; {parallel}, and it "
        "dies at the second success",
        "one after the other: each step begins when the one before it has failed",
    ),
    Reason.BACKGROUND: (
        "the plan goes on at once, and what is in this control runs beside all that follows; "
        "{parallel}",
        "the plan waits for it, and stops if it fails",
    ),
    Reason.ALTERNATIVE_ROW: (
        "{steps} steps are an alternative to others; {engine} starts an alternative for the "
        "failure of one runner only",
        "the other alternatives stand in for the last of these steps only; if an earlier one "
        "fails, the plan stops",
    ),
    Reason.GUARDS_ROW: (
        "it guards {steps} steps that come one after the other; on {engine} a recovery guards the "
        "one runner before it",
        "it guards the last of these steps only; if an earlier one fails, the plan stops",
    ),
    Reason.ROW_IN_RECOVERY: (
        "after a failure {steps} steps are to run one after the other; {engine} runs each runner "
        "of a recovery when the one before it has failed",
        "they and all behind them are left out of the recovery; where they would begin, the plan "
        "stops",
    ),
    Reason.IGNORES_FAILURE: (
        "the plan goes on after a failure although nothing is run instead; on {engine} only a "
        "runner that succeeds goes on",
        "if that step fails, the plan stops",
    ),
    Reason.BEHIND_LEFT_OUT: (
        "it begins when steps have failed that {engine} cannot run",
        "it is left out as well: where it would begin, the plan stops",
    ),
    Reason.GUARDS_BEFORE_LAST: (
        "it guards {steps} steps that come one after the other, of which the last cannot fail; on "
        "{engine} a recovery guards the one runner before it",
        "it is left out; if one of these steps fails, the plan stops",
    ),
    Reason.ALTERNATIVE_LEFT_OUT: ("", "an alternative of {steps} steps is left out"),
}
_PARALLEL = {
    FABRIC_V1: "fabric-v1 starts them beside the runner before them, whose success it counts too",
    FABRIC_V2: (
        "fabric-v2 starts a unit with the STARTED of the runner before it, which hardly any runner "
        "emits"
    ),
}


def losses_of(
    plan: Plan, all_lost: Iterable[Lost], place: Callable[[Element], tuple[int, int]], engine: str
) -> Iterator[Loss]:
    """The losses in words, one per element; ``place`` tells line and column of an element."""
    for index, group in groupby(sorted(all_lost, key=_order), key=lambda lost: lost.element):
        element = plan.elements[index]
        found = list(group)
        told = [_told(lost, engine) for lost in found]
        # What else is wrong with units beside each other follows from how they are read instead.
        what = [lost for lost, _ in told][: 1 if found[0].reason <= Reason.BACKGROUND else None]
        line, column = place(element)
        instead = "; ".join(instead for _, instead in told)
        yield Loss(line, column, f"{_named(element)}: {'; '.join(what)}", instead)


def _order(lost: Lost) -> tuple[int, int]:
    return lost.element, lost.reason.value


def _told(lost: Lost, engine: str) -> tuple[str, str]:
    what, instead = _LOST[lost.reason]
    known = {"steps": lost.steps, "engine": engine, "parallel": _PARALLEL[engine]}
    return what.format(**known), instead.format(**known)


def _named(element: Element) -> str:
    from gpsfsm.model.printable import clip  # noqa: PLC0415  (few plans need it)

    name = element.text("name")
    return f"{element.words} '{clip(name, 60)}'" if name else element.words
