"""The gist of an answer: what it is meant to do, read from elements that need not be well-formed.

Only grades rest on it, and only where an answer cannot be read as it stands (docs/tasks.md). The
elements of the text become parts (drives, and what holds them), and the parts the text of a plan.
What the words of elements mean is known to ``plan_gist`` and ``tree_answer``.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

from gpsfsm.syntax.scan import scan
from gpsfsm.syntax.source import DEFAULT_LIMITS
from gpsfsm.syntax.text import Lines
from gpsfsm.syntax.tokens import EndTag, StartTag, TextRun
from gpsfsm.syntax.values import decode_value

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

NUMBER = r"[-+]?+(?:[0-9]++\.?+[0-9]*+|\.[0-9]++)"
GAP = r"(?:\s*+[;,]\s*+|\s++)"  # possessive, as the number: linear on any text
LABELS = ("name", "ID")
"""Attributes that call an element something, and say nothing else."""

_ONE_OF = re.compile(r"\[([^!\]])[^\]]*\]")
_WILD = re.compile(r"[*?\[\]]+")

MAX_DEPTH = 40
"""What is nested deeper is left out."""

_MAX_CHARACTERS = 200_000
_EXPLICIT = ("Action", "Condition", "Decorator", "Control", "Composite", "Node")
_CUT_OFF = re.compile(r"\s*+(?:/|[\w.:-]++\s*+=?)?+\s*+")  # the slash, or a name without its value
_REACH = 300
"""How many open elements an end tag may close at once."""


@dataclass(slots=True)
class Element:
    """An element; ``text`` is what stands between its tags, without that of its children.

    ``line`` is that of its start tag. Where the tag has errors, the whole of it is the value of an
    attribute "", since parts of it may be in no attribute.
    """

    tag: str
    attributes: dict[str, str] = field(default_factory=dict)
    children: list[Element] = field(default_factory=list)
    text: str = ""
    line: int = 0

    @property
    def identity(self) -> str:
        """The kind of node: the ID of an explicit node, else its tag."""
        if self.tag not in _EXPLICIT:
            return self.tag
        attributes = self.attributes
        named = "" if self.tag in ("Action", "Condition") else attributes.get("type", "")
        return attributes.get("ID") or named or attributes.get("name") or self.tag

    def descendants(self) -> Iterator[Element]:
        """All elements in it, in document order."""
        pending = list(reversed(self.children))
        while pending:
            element = pending.pop()
            yield element
            pending.extend(reversed(element.children))


def elements_of(text: str, *, misspelt_ends: bool = False) -> Element:
    """The elements of a text, below one that stands for the whole; none if it is too long.

    With ``misspelt_ends`` an end tag whose name no open element has ends the innermost element;
    without, it ends none: a start tag that is misspelt, with an end tag that is not, is as likely.
    """
    whole = Element("")
    stack = [whole]
    lines = Lines(text)
    for token in scan(text, DEFAULT_LIMITS) if len(text) <= _MAX_CHARACTERS else ():
        if isinstance(token, StartTag):
            element = Element(token.name, _attributes(token, text))
            element.line, _ = lines.position(token.start)
            if len(stack) <= MAX_DEPTH:
                stack[-1].children.append(element)
            if not token.empty:
                stack.append(element)
        elif isinstance(token, EndTag):
            for back in range(len(stack) - 1, max(0, len(stack) - _REACH), -1):
                if stack[back].tag == token.name:
                    del stack[back:]
                    break
            else:
                if misspelt_ends:
                    del stack[max(2, len(stack) - 1) :]
        elif isinstance(token, TextRun):
            stack[-1].text += text[token.start : token.end]
    return whole


def _attributes(tag: StartTag, text: str) -> dict[str, str]:
    values = {
        name: decode_value(text[start:end], start, []) for name, _, start, end in tag.attributes
    }
    if tag.faults and not _is_cut_off(tag, text):
        values[""] = text[tag.start : tag.end]
    return values


def _is_cut_off(tag: StartTag, text: str) -> bool:
    """True if nothing is wrong with the tag but that the answer ends before its ``>``.

    ``<Go x="1" y="2" /`` is, ``<Go x="1" y="2`` is not: who knows what the value was to be.
    """
    if tag.closed or not tag.attributes:
        return False
    last = tag.attributes[-1]
    quoted = all(text[each.value_start - 1] in "\"'" for each in tag.attributes)
    end = text[last.value_end : tag.end]
    return quoted and end[:1] == text[last.value_start - 1] and bool(_CUT_OFF.fullmatch(end, 1))


class Kind(Enum):
    """The kind of a part: a drive, or how it runs the parts that it holds.

    GUARD runs its first part, and each other one where the one before has failed. RECOVERY is a
    control of that type: it runs where what stands before it has failed.
    """

    DRIVE = ""
    SEQUENCE = "sequential"
    GUARD = "guard"
    RECOVERY = "recovery"
    ALL = "parallel_all"
    ANY = "parallel_any"


@dataclass(frozen=True, slots=True)
class Part:
    """A drive with the attributes of its runner, or other parts; ``line`` is that in the text."""

    kind: Kind
    parts: tuple[Part, ...] = ()
    attributes: tuple[tuple[str, str], ...] = ()
    line: int = 1


Line = tuple[str, int]
"""A line of the plan, and the line of the text that it comes from."""


class Reader(ABC):
    """Reads elements into parts; who knows the words says what one element is."""

    @abstractmethod
    def part(self, element: Element, depth: int) -> tuple[Part, ...]:
        """The parts that an element comes to; () if it drives nowhere."""

    def children(self, element: Element, depth: int) -> tuple[Part, ...]:
        """The parts that the children come to, in order."""
        if depth > MAX_DEPTH:
            return ()
        return tuple(part for child in element.children for part in self.part(child, depth))

    def alternatives(self, element: Element, kind: Kind, depth: int) -> tuple[Part, ...]:
        """One part that holds the children that drive somewhere, each in a sequence by itself."""
        alone = (Element("Sequence", children=[child]) for child in element.children)
        return held(kind, [self.children(each, depth + 1) for each in alone])


def held(kind: Kind, several: Sequence[tuple[Part, ...]]) -> tuple[Part, ...]:
    """One part that holds those that drive somewhere."""
    parts = tuple(Part(Kind.SEQUENCE, each) for each in several if each)
    return (Part(kind, parts),) if parts else ()


def plan_lines(parts: Sequence[Part]) -> list[Line]:
    """The text of the plan that parts come to, line by line; [] if it drives nowhere.

    Parts are nested about as deep as elements are.
    """
    lines = [line for part in parts for line in _lines(part)]
    if not lines:
        return []
    return [("<Plan>", lines[0][1]), *lines, ("</Plan>", lines[-1][1])]


def _lines(part: Part) -> list[Line]:
    if part.kind is Kind.DRIVE:
        written = " ".join(f"{name}={quoteattr(value)}" for name, value in part.attributes)
        return [(f"<Runner {written} />", part.line)]
    inner = [_lines(each) for each in part.parts]
    if part.kind is Kind.GUARD:
        first, *rest = inner
        return [*first, *(line for each in rest for line in _wrapped(Kind.RECOVERY, each))]
    return _wrapped(part.kind, [line for each in inner for line in each])


def _wrapped(kind: Kind, lines: list[Line]) -> list[Line]:
    if not lines:
        return []
    return [(f'<Control type="{kind.value}">', lines[0][1]), *lines, ("</Control>", lines[-1][1])]


def plain_name(glob: str) -> str:
    """A name that the glob fits, but for one such as ``[!a]``."""
    return _WILD.sub("x", _ONE_OF.sub(r"\1", glob))
