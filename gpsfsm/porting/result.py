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
    FABRIC_V1: "fabric-v1 starts them with the runner before them and counts its success too",
    **{
        engine: f"{engine} starts a unit on STARTED from the runner before it, which hardly "
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
    """A part of the plan that the engine cannot run as the paper specifies.

    ``lost`` describes it and the reason; ``instead`` is what the unsafe plan does ("": none).
    """

    line: int
    column: int
    lost: str
    instead: str = ""


@dataclass(frozen=True, slots=True)
class Change:
    """The change of behaviour by the unsafe text, with the plans that show it.

    ``difference`` is None if the behaviour is the same in all scenarios, or, with ``decided``
    False, in all those that gpsfsm searched within the limits.
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

    ``original`` is the decoded input. ``text`` is the proved text for the engine, None if the
    engine cannot run the plan as the paper specifies. With ``losses``, ``text`` is the closest
    plan, and ``change`` describes how it differs. ``changed``: the text differs from the input, or
    must be written in another encoding (UTF-8).
    """

    original: str
    text: str | None
    notes: tuple[Note, ...] = ()
    losses: tuple[Loss, ...] = ()
    change: Change | None = None
    changed: bool = False

    def to_dict(self) -> dict[str, Any]:
        """The result as data: the text, the losses, and a scenario that shows them."""
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
        "{steps} steps run at the same time, and the first failure is enough; {parallel}, and "
        "continues to wait after a unit has failed",
        "the steps run in sequence, each after the one before it has succeeded",
    ),
    Reason.ANY: (
        "{steps} steps run at the same time, and the first success is enough; {parallel}, and "
        "crashes at the second success",
        "the steps run in sequence, each after the one before it has failed",
    ),
    Reason.BACKGROUND: (
        "the plan continues at once, and the content of this control runs in parallel with all "
        "that follows; {parallel}",
        "the plan waits for the content, and stops if it fails",
    ),
    Reason.ALTERNATIVE_ROW: (
        "{steps} steps in sequence are one alternative; {engine} starts the next alternative only "
        "for the failure of a single runner",
        "the other alternatives replace only the last of these steps; if an earlier one fails, "
        "the plan stops",
    ),
    Reason.GUARDS_ROW: (
        "it guards {steps} steps in sequence; on {engine} a recovery guards only the one runner "
        "before it",
        "it guards only the last of these steps; if an earlier one fails, the plan stops",
    ),
    Reason.ROW_IN_RECOVERY: (
        "after a failure, {steps} steps run in sequence; {engine} runs each further runner of a "
        "recovery only when the one before it has failed",
        "they and everything after them in the recovery are removed; where they would begin, the "
        "plan stops",
    ),
    Reason.IGNORES_FAILURE: (
        "the plan continues after a failure without running anything instead; {engine} continues "
        "only after a success",
        "it is removed; if the step that it guards fails, the plan stops",
    ),
    Reason.BEHIND_LEFT_OUT: (
        "it runs after the failure of steps that {engine} cannot run",
        "it is removed as well; where it would begin, the plan stops",
    ),
    Reason.GUARDS_BEFORE_LAST: (
        "it guards {steps} steps in sequence, the last of which cannot fail; on {engine} a "
        "recovery guards only the one runner before it",
        "it is removed; if one of these steps fails, the plan stops",
    ),
    Reason.ALTERNATIVE_LEFT_OUT: ("", "an alternative of {steps} steps is removed"),
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
