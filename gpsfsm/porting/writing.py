"""Steps → text: the tags as they were written, in the order of the steps, with their comments.

What stands between the tags (comments, empty lines, the indentation) is given to the elements that
stay: a comment goes to the element behind it; where that is not kept, to the next one that is.

``<!-- first --> A <Control type="parallel_any"> <!-- why --> B </Control>`` with the steps A, B is
    ``<!-- first --> A <!-- why --> B``: the control is left out, its comment goes on to B.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.fixing.layout import escaped, indentation, line_end
from gpsfsm.model.plan import ControlType, Kind
from gpsfsm.syntax.elements import is_completion
from gpsfsm.syntax.tinyxml import decode
from gpsfsm.syntax.tokens import Comment, EndTag, Markup, StartTag

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from gpsfsm.compile.units import Units
    from gpsfsm.fixing.draft import Piece
    from gpsfsm.model.plan import Plan
    from gpsfsm.porting.forms import Step

_ENCODING = re.compile(
    r"""\A(<\?xml[^>]*?)\s+encoding\s*=\s*(?:"(?!utf-?8")[^"]*"|'(?!utf-?8')[^']*')""",
    re.IGNORECASE,
)


class Draft(NamedTuple):
    """A new text; ``runners`` are, in its order, the elements of the plan that its runners were.

    ``dissolved`` are the controls of the plan that are not in it, although runners of theirs are.
    """

    text: str
    runners: tuple[int, ...]
    dissolved: tuple[int, ...] = ()


def write(
    text: str, tokens: Sequence[Piece], plan: Plan, units: Units, steps: Sequence[Step]
) -> Draft:
    """The plan with these steps only; what stands around ``<Plan>`` stays."""
    writer = _Writer(text, tokens, plan, units, steps)
    return Draft(writer.write(), tuple(writer.runners), writer.dissolved())


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


_NOTHING = About((), gap=False)


@dataclass(slots=True)
class _Line:
    """A tag on a line of its own; ``element`` is -1 for what the text does not have."""

    depth: int
    tag: str
    element: int = -1


@dataclass(slots=True)
class _Writer:
    text: str
    tokens: Sequence[Piece]
    plan: Plan
    units: Units
    steps: Sequence[Step]
    runners: list[int] = field(default_factory=list)
    _lines: list[_Line] = field(default_factory=list)
    _tags: dict[int, StartTag] = field(default_factory=dict)

    def write(self) -> str:
        self._tags = {tag.start: tag for tag in self.tokens if isinstance(tag, StartTag)}
        self._collect()
        kept = {line.element for line in self._lines if line.element >= 0}
        trivia = trivia_of(self.text, self.tokens, self.plan, kept)
        root = self.plan.elements[0]
        if trivia.close < 0:  # <Plan/>
            return _ENCODING.sub(r"\1", self._without_markup(0, len(self.text)))
        indent = indentation(self.text, root.start) or ""
        parts: list[str] = []
        if trivia.spread:
            end = line_end(self.text)
            pieces = self._spread(trivia, indent)
            parts = [*(f"{end}{piece}" if piece else end for piece in pieces), f"{end}{indent}"]
        else:
            for line in self._lines:
                about = trivia.of.get(line.element, _NOTHING)
                parts += [*about.before, line.tag, *about.after]
            parts += trivia.left
        # It is written as UTF-8, which is what an engine reads whatever is declared.
        head = _ENCODING.sub(r"\1", self._without_markup(0, root.end))
        return head + "".join(parts) + self._without_markup(trivia.close, len(self.text))

    def _without_markup(self, start: int, end: int) -> str:
        """A part of the text without instructions, which engines take at the beginning only."""
        parts: list[str] = []
        for token in self.tokens:
            if isinstance(token, Markup) and 0 < token.start >= start and token.end <= end:
                parts.append(self.text[start : token.start])
                start = token.end
        return "".join([*parts, self.text[start:end]])

    def dissolved(self) -> tuple[int, ...]:
        """The controls around runners that stay, without those that stay too."""
        around: set[int] = set()
        for runner in self.runners:
            parent = self.plan.elements[runner].parent
            while parent > 0 and parent not in around:
                around.add(parent)
                parent = self.plan.elements[parent].parent
        return tuple(sorted(around.difference(line.element for line in self._lines)))

    def _spread(self, trivia: Trivia, indent: str) -> Iterator[str]:
        """The lines between the tags of the plan."""
        for number, line in enumerate(self._lines):
            pad = indent + trivia.step * line.depth
            about = trivia.of.get(line.element, _NOTHING)
            if about.gap and number:
                yield ""
            for comment in about.before:
                yield pad + comment
            yield " ".join([pad + line.tag, *about.after])
        for comment in trivia.left:
            yield indent + trivia.step + comment

    def _collect(self) -> None:
        """All tags in their order."""
        open_: list[int] = []
        for step in self.steps:
            around = self._around(step.runners[0])
            same = 0
            while same < min(len(open_), len(around)) and open_[same] == around[same]:
                same += 1
            while len(open_) > same:
                open_.pop()
                self._lines.append(_Line(len(open_) + 1, "</Control>"))
            for element in around[same:]:
                self._lines.append(_Line(len(open_) + 1, self._slice(element), element))
                open_.append(element)
            self._step(step, len(open_) + 1)
        while open_:
            open_.pop()
            self._lines.append(_Line(len(open_) + 1, "</Control>"))
        if self._lines and self._completes(self._lines[-1].element):
            # As the last child of the plan it would be the completion, which engines append too.
            line = self._lines.pop()
            deeper = _Line(2, line.tag, line.element)
            opened, closed = _Line(1, '<Control type="sequential">'), _Line(1, "</Control>")
            self._lines += (opened, deeper, closed)

    def _completes(self, element: int) -> bool:
        """True if a line is a completion runner; -1 is none."""
        return element >= 0 and is_completion(self.plan.elements[element].interface)

    def _step(self, step: Step, depth: int) -> None:
        first, *others = step.runners
        self._runner(first, depth)
        if not others:
            return
        element = self.plan.elements[step.recovery]
        if element.control_type is ControlType.RECOVERY:
            self._lines.append(_Line(depth, self._slice(element.index), element.index))
        else:
            name = element.text("name")
            label = f' name="{escaped(name)}"' if name is not None else ""
            self._lines.append(_Line(depth, f'<Control type="recovery"{label}>', element.index))
        for unit in others:
            self._runner(unit, depth + 1)
        self._lines.append(_Line(depth, "</Control>"))

    def _runner(self, unit: int, depth: int) -> None:
        element = self.units.elements[unit]
        self.runners.append(element)
        self._lines.append(_Line(depth, self._slice(element), element))

    def _around(self, unit: int) -> list[int]:
        """The sequential controls that stay around a unit, the outermost first."""
        controls: list[int] = []
        parent = self.units.parents[unit]
        while parent > 0:
            element = self.plan.elements[self.units.elements[parent]]
            if element.control_type is ControlType.SEQUENTIAL:
                controls.append(element.index)
            else:  # what is inside another control is no sequence of its own any more
                controls.clear()
            parent = self.units.parents[parent]
        return controls[::-1]

    def _slice(self, index: int) -> str:
        """The start tag as it was written, with values that the engine reads as they are meant."""
        element = self.plan.elements[index]
        tag = self._tags[element.start]
        parts: list[str] = []
        at = tag.start
        for raw in tag.attributes:
            value = element.text(raw.name)
            if value is None or decode(self.text[raw.value_start : raw.value_end]) == value:
                continue
            quote = self.text[raw.value_start - 1]
            written = escaped(value)
            parts += [
                self.text[at : raw.value_start],
                written.replace("'", "&apos;") if quote == "'" else written,
            ]
            at = raw.value_end
        whole = "".join([*parts, self.text[at : tag.end]])
        if element.kind is Kind.RUNNER and not tag.empty:
            whole = whole.removesuffix(">").rstrip() + "/>"
        return whole


class _Reader:
    def __init__(self, text: str, plan: Plan, kept: Collection[int]) -> None:
        self._text = text
        self._kept = kept
        self._root = plan.elements[0]
        self._elements = {element.start: element for element in plan.elements}
        self._trivia = Trivia()
        self._waiting: list[str] = []
        self._gap = False
        self._last: About | None = None  # of the runner that ended last
        self._end = self._root.end

    def read(self, tokens: Sequence[Piece]) -> Trivia:
        trivia = self._trivia
        for token in tokens:
            if token.start < self._root.end:
                continue
            if trivia.close >= 0 and token.start >= trivia.close:
                break
            self._blank(token)
            if isinstance(token, Comment):
                self._comment(token)
            elif isinstance(token, StartTag):
                self._tag(token)
            elif isinstance(token, EndTag) and token.name == Kind.PLAN:
                trivia.close = token.start
            elif isinstance(token, EndTag) and token.name != Kind.RUNNER:
                self._last = None
            self._end = token.end
        trivia.left = tuple(self._waiting)
        return trivia

    def _blank(self, token: Piece) -> None:
        before = self._text[self._end : token.start]
        lines = before.count("\n") or before.count("\r")
        self._trivia.spread |= lines > 0
        if self._end == self._root.end and lines:
            inside = indentation(self._text, token.start)
            outside = indentation(self._text, self._root.start) or ""
            if inside is not None and inside.startswith(outside) and inside != outside:
                self._trivia.step = inside[len(outside) :]
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
            self._trivia.of[element.index] = about
            self._waiting = []
            self._last = about if element.kind is Kind.RUNNER else None
        elif element.kind is Kind.RUNNER:
            self._waiting = []
