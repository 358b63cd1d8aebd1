"""What becomes of a plan that is ported."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gpsfsm.model.plan import Plan
    from gpsfsm.tasks.equivalence import Difference

__all__ = ["Change", "Loss", "Note", "Ported"]


@dataclass(frozen=True, slots=True)
class Note:
    """What was done to the text, or what has to be known of it; a place in the text as given."""

    line: int
    column: int
    text: str


@dataclass(frozen=True, slots=True)
class Loss:
    """What the engine cannot do as the paper says.

    ``lost`` says what and why, ``instead`` what the unsafe reading does ("": there is none).
    """

    line: int
    column: int
    lost: str
    instead: str = ""


@dataclass(frozen=True, slots=True)
class Change:
    """What the unsafe text does otherwise than the original, with the plans that tell it.

    ``difference`` is None where it does the same in every scenario that was looked at within the
    limits (``decided`` False), or in all of them.
    """

    original: Plan
    ported: Plan
    difference: Difference | None
    decided: bool = True


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
