"""What the tree builder remembers of elements."""

from __future__ import annotations

from enum import Enum, auto
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from gpsfsm.model.plan import Attribute, ControlType, Kind

__all__ = ["Frame", "Inside", "Record"]


class Inside(Enum):
    """What may stand inside an element, and what is said of the rest.

    QUIET: the element itself is what is wrong, so what is inside it is not reported one by one.
    """

    PLAN = auto()
    RUNNER = auto()
    OTHER = auto()
    QUIET = auto()


class Frame:
    """An open element.

    ``index`` is that of its record, -1 if it has none; ``filled`` tells that something is inside;
    ``content`` is the first thing (offset, length, words) that a runner must not hold.
    """

    __slots__ = ("content", "counts", "filled", "index", "inside", "path", "start", "tag")

    def __init__(self, *, path: str, tag: str, start: int, index: int, inside: Inside) -> None:
        self.path, self.tag, self.start, self.index, self.inside = path, tag, start, index, inside
        self.counts: dict[str, int] = {}
        self.filled = False
        self.content: tuple[int, int, str] | None = None


class Record(NamedTuple):
    """An element of the plan, before its children are known."""

    kind: Kind
    parent: int
    ordinal: int
    attributes: tuple[Attribute, ...]
    line: int
    column: int
    start: int
    end: int
    control_type: ControlType | None
