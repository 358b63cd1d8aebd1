"""Open elements: which end tag closes what, and what is left open.

The stack holds one frame per open element. An end tag that does not fit the innermost element
closes all up to the element of its name, if one is open; else it is a misspelt end tag of the
innermost one, if it looks like that; else it closes nothing.

``<Plan><Control><Runner></Control>``: the end tag closes the runner (reported: never closed) and
    the control; the plan stays open, and ``unfinished`` reports that at the end of the text.
"""

from __future__ import annotations

from collections import Counter
from difflib import SequenceMatcher
from enum import Enum, auto
from typing import TYPE_CHECKING

from gpsfsm.model.finding import Related
from gpsfsm.syntax.text import WHITE, clip

if TYPE_CHECKING:
    from gpsfsm.syntax.collector import Collector
    from gpsfsm.syntax.tokens import EndTag

_LISTED = 5


class Inside(Enum):
    """The content that an element may have, and what is said of the rest.

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


class Nesting:
    """The stack of open elements; ``frames[-1]`` is the innermost."""

    def __init__(self, collector: Collector) -> None:
        self.frames: list[Frame] = []
        self._collector = collector
        self._open: Counter[str] = Counter()

    def open(self, frame: Frame) -> None:
        """An element begins."""
        self.frames.append(frame)
        self._open[frame.tag] += 1

    def closed(self, frame: Frame) -> None:
        """An element ended as it should: what can be said only now."""
        if frame.inside is Inside.RUNNER and frame.content:
            start, length, shown = frame.content
            self._collector.add(
                "GP114",
                start,
                length,
                message=f"a runner holds nothing, but this one holds {shown}",
                hint="close the runner with '/>' and move this behind it, or remove it",
                element=frame.path,
            )
        elif frame.inside is Inside.PLAN and not frame.filled:
            what = "plan" if frame.tag.lower() == "plan" else "control"
            self._collector.add(
                "GP109",
                frame.start,
                1 + len(frame.tag),
                message=f"this {what} is empty: it does nothing",
                hint="put runners into it, or remove it",
                element=frame.path,
            )

    def end(self, tag: EndTag) -> bool:
        """An end tag; False if it does not fit, which is reported."""
        name = tag.name
        if not self.frames:
            self.superfluous(tag)
            return False
        top = self.frames[-1]
        if name == top.tag:
            self.closed(self._pop())
            return True
        if not name:  # reported by the scanner; it can only mean the innermost
            self._pop()
        elif self._open[name]:
            while self.frames[-1].tag != name:
                self._never_closed(self._pop(), tag)
            self.closed(self._pop())
        elif similar(name, top.tag):
            self._misspelt(self._pop(), tag)
        else:
            self.superfluous(tag)
        return False

    def unfinished(self, text: str) -> None:
        """Report that the text ends while elements are open."""
        end = len(text.rstrip(WHITE))
        collector = self._collector
        names = [
            f"<{clip(frame.tag)}> (line {collector.location(frame.start).line})"
            for frame in reversed(self.frames[-_LISTED:])
        ]
        if len(self.frames) > _LISTED:
            names.append(f"{len(self.frames) - _LISTED} more around them")
        verb = "is" if len(self.frames) == 1 else "are"
        closing = "".join(f"</{clip(f.tag)}>" for f in reversed(self.frames[-_LISTED:]))
        closing += "…" if len(self.frames) > _LISTED else ""
        collector.add(
            "GP101",
            end,
            0,
            message=f"the text ends too early: {_enumerate(names)} {verb} never closed",
            hint=f"add {closing} where they end; a model's answer that stops here was cut off",
            element=self.frames[-1].path,
            related=[
                Related(collector.location(frame.start, frame.path), f"<{clip(frame.tag)}> opens")
                for frame in reversed(self.frames[-_LISTED:])
            ],
        )

    def _pop(self) -> Frame:
        frame = self.frames.pop()
        self._open[frame.tag] -= 1
        if not self._open[frame.tag]:
            del self._open[frame.tag]
        return frame

    def _never_closed(self, frame: Frame, tag: EndTag) -> None:
        collector = self._collector
        place = collector.location(tag.start)
        name, other = clip(frame.tag), clip(tag.name)
        hint = f"add </{name}> where it ends"
        if frame.inside is Inside.RUNNER:
            hint = "end the tag with '/>' instead of '>'"
        collector.add(
            "GP101",
            frame.start,
            1 + len(frame.tag),
            message=f"<{name}> is never closed; </{other}> on line {place.line} comes first",
            hint=hint,
            element=frame.path,
            related=[Related(place, f"</{other}>")],
        )

    def _misspelt(self, frame: Frame, tag: EndTag) -> None:
        collector = self._collector
        opened = collector.location(frame.start, frame.path)
        name = clip(frame.tag)
        collector.add(
            "GP101",
            tag.start,
            tag.end - tag.start,
            message=f"</{clip(tag.name)}> does not match <{name}> on line {opened.line}",
            hint=f"write </{name}>",
            element=frame.path,
            related=[Related(opened, f"<{name}> opens")],
        )

    def superfluous(self, tag: EndTag) -> None:
        """Report an end tag that closes nothing."""
        if tag.faults:
            return  # reported already
        top = self.frames[-1] if self.frames else None
        message = f"</{clip(tag.name)}> closes nothing: no <{clip(tag.name)}> is open here"
        hint = "remove it"
        if top:
            hint = f"remove it, or write </{clip(top.tag)}> if it shall close that element"
        self._collector.add(
            "GP101",
            tag.start,
            tag.end - tag.start,
            message=message,
            hint=hint,
            element=top.path if top else "",
        )


def similar(name: str, other: str) -> bool:
    """True if ``name`` looks like a misspelt ``other``."""
    if name.lower() == other.lower():
        return True
    if max(len(name), len(other)) > 40:
        return False
    return SequenceMatcher(None, name.lower(), other.lower()).ratio() >= 0.75


def _enumerate(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
