"""What stands between the tags of a plan: comments, empty lines and the way it is indented."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from gpsfsm.fixing.layout import indentation
from gpsfsm.model.plan import Kind
from gpsfsm.syntax.tokens import Comment, EndTag, StartTag

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from gpsfsm.fixing.elements import Piece
    from gpsfsm.model.plan import Plan

__all__ = ["About", "Trivia", "trivia_of"]


@dataclass(slots=True)
class About:
    """The comments before an element and behind it on its line; ``gap``: an empty line before."""

    before: tuple[str, ...]
    gap: bool
    after: list[str] = field(default_factory=list)


@dataclass(slots=True)
class Trivia:
    """``of``: by element. ``left`` are comments behind all elements that stay.

    ``close`` is where the end tag of the plan begins (-1: it has none). ``spread``: the plan is
    written in lines, each ``step`` deeper than the one around it.
    """

    of: dict[int, About] = field(default_factory=dict)
    left: tuple[str, ...] = ()
    close: int = -1
    spread: bool = False
    step: str = "    "


def trivia_of(text: str, tokens: Sequence[Piece], plan: Plan, kept: Collection[int]) -> Trivia:
    """Give the comments inside ``<Plan>`` to the elements that are kept.

    A comment goes to the element behind it; where that is not kept, to the next one that is. The
    comments of runners that are left out are left out with them.
    """
    return _Reader(text, plan, kept).read(tokens)


class _Reader:
    def __init__(self, text: str, plan: Plan, kept: Collection[int]) -> None:
        self._text = text
        self._kept = kept
        self._root = plan.elements[0]
        self._elements = {element.start: element for element in plan.elements}
        self._found = Trivia()
        self._waiting: list[str] = []
        self._gap = False
        self._last: About | None = None  # of the runner that ended last
        self._end = self._root.end

    def read(self, tokens: Sequence[Piece]) -> Trivia:
        found = self._found
        for token in tokens:
            if token.start < self._root.end:
                continue
            if found.close >= 0 and token.start >= found.close:
                break
            self._blank(token)
            if isinstance(token, Comment):
                self._comment(token)
            elif isinstance(token, StartTag):
                self._tag(token)
            elif isinstance(token, EndTag) and token.name == Kind.PLAN:
                found.close = token.start
            elif isinstance(token, EndTag) and token.name != Kind.RUNNER:
                self._last = None
            self._end = token.end
        found.left = tuple(self._waiting)
        return found

    def _blank(self, token: Piece) -> None:
        before = self._text[self._end : token.start]
        lines = before.count("\n") or before.count("\r")
        self._found.spread |= lines > 0
        if self._end == self._root.end and lines:
            inside = indentation(self._text, token.start)
            outside = indentation(self._text, self._root.start) or ""
            if inside is not None and inside.startswith(outside) and inside != outside:
                self._found.step = inside[len(outside) :]
        if not self._waiting:
            self._gap = lines > 1 and not before.strip()

    def _comment(self, token: Comment) -> None:
        written = self._text[token.start : token.end]
        between = self._text[self._end : token.start]
        if self._last is not None and "\n" not in between and "\r" not in between:
            self._last.after.append(written)
        else:
            self._waiting.append(written)

    def _tag(self, token: StartTag) -> None:
        self._last = None
        element = self._elements.get(token.start)
        if element is None:  # inside a runner
            return
        if element.index in self._kept:
            about = About(tuple(self._waiting), self._gap)
            self._found.of[element.index] = about
            self._waiting = []
            self._last = about if element.kind is Kind.RUNNER else None
        elif element.kind is Kind.RUNNER:
            self._waiting = []
