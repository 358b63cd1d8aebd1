"""The result of a port: notes, losses in words, the text and what it changes."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import IntEnum
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.equivalence.difference_text import comparison_as_data
from gpsfsm.model.printable import clip
from gpsfsm.model.story import FABRIC_V1, FABRIC_V2, FABRIC_V3

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from gpsfsm.equivalence import Difference
    from gpsfsm.model.plan import Element, Plan

_PARALLEL = {
    FABRIC_V1: "fabric-v1 starts them beside the runner before them, whose success it counts too",
    **{
        engine: f"{engine} starts a unit with the STARTED of the runner before it, which hardly "
        "any runner emits"
        for engine in (FABRIC_V2, FABRIC_V3)
    },
}


@dataclass(frozen=True, slots=True)
class Note:
    """A note on what was done to the text; line and column are those of the original."""

    line: int
    column: int
    text: str


@dataclass(frozen=True, slots=True)
class Loss:
    """A part of the plan that the engine cannot do as the paper says.

    ``lost`` says what and why, ``instead`` what the unsafe reading does ("": there is none).
    """

    line: int
    column: int
    lost: str
    instead: str = ""


@dataclass(frozen=True, slots=True)
class Change:
    """The change of behaviour by the unsafe text, with the plans that show it.

    ``difference`` is None where it does the same in every scenario that was looked at within the
    limits (``decided`` False), or in all of them.
    """

    original: Plan
    ported: Plan
    difference: Difference | None
    decided: bool = True

    def to_dict(self) -> dict[str, Any]:
        """The outcome of the comparison, as ``gpsfsm diff --format json`` has it."""
        data = comparison_as_data(self.original, self.ported, self.difference)
        return {"decided": self.decided, "difference": data["difference"]}


@dataclass(frozen=True, slots=True)
class Ported:
    """The result of porting a text.

    ``original`` is the decoded text as it was given, ``text`` the one for the engine: proved, or
    None where the engine cannot do what the plan says. With ``losses`` it is the unsafe reading,
    and ``change`` says what that changes. ``changed``: the text is another one, or has to be
    written in another encoding, which is UTF-8.
    """

    original: str
    text: str | None
    notes: tuple[Note, ...] = ()
    losses: tuple[Loss, ...] = ()
    change: Change | None = None
    changed: bool = False

    def to_dict(self) -> dict[str, Any]:
        """The result for programs: the text, what is lost, and a scenario that shows it."""
        return {
            "text": self.text,
            "changed": self.changed,
            "notes": [asdict(each) for each in self.notes],
            "losses": [asdict(each) for each in self.losses],
            "change": None if self.change is None else self.change.to_dict(),
        }


class Reason(IntEnum):
    """The reasons for which a unit cannot be ported."""

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


def losses_of(
    plan: Plan, all_lost: Iterable[Lost], place: Callable[[Element], tuple[int, int]], engine: str
) -> Iterator[Loss]:
    """The losses in words, one per element; ``place`` tells line and column of an element."""
    for index, group in groupby(sorted(all_lost, key=_order), key=lambda lost: lost.element):
        element = plan.elements[index]
        here = list(group)
        words = [_words(lost, engine) for lost in here]
        # What else is wrong with units beside each other follows from how they are read instead.
        what = [lost for lost, _ in words][: 1 if here[0].reason <= Reason.BACKGROUND else None]
        line, column = place(element)
        instead = "; ".join(instead for _, instead in words)
        yield Loss(line, column, f"{_named(element)}: {'; '.join(what)}", instead)


def _order(lost: Lost) -> tuple[int, int]:
    return lost.element, lost.reason.value


def _words(lost: Lost, engine: str) -> tuple[str, str]:
    what, instead = _LOST[lost.reason]
    values = {"steps": lost.steps, "engine": engine, "parallel": _PARALLEL[engine]}
    return what.format(**values), instead.format(**values)


def _named(element: Element) -> str:
    name = element.text("name")
    return f"{element.words} '{clip(name, 60)}'" if name else element.words
