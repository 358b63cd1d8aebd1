"""Elements of a text that need not be well-formed, for reading what it means (docs/tasks.md)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from gpsfsm.syntax.limits import DEFAULT_LIMITS
from gpsfsm.syntax.lines import Lines
from gpsfsm.syntax.references import decode_value
from gpsfsm.syntax.scan import scan
from gpsfsm.syntax.tokens import EndTag, StartTag, TextRun

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["MAX_DEPTH", "Element", "elements_of"]

MAX_DEPTH = 40
"""What is nested deeper is left out."""

_MAX_CHARACTERS = 200_000
_EXPLICIT = ("Action", "Condition", "Decorator", "Control", "Composite", "Node")
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
        """What kind of node it is: the ID of an explicit node, else its tag."""
        if self.tag not in _EXPLICIT:
            return self.tag
        given = self.attributes
        named = "" if self.tag in ("Action", "Condition") else given.get("type", "")
        return given.get("ID") or named or given.get("name") or self.tag

    def descendants(self) -> Iterator[Element]:
        """All elements in it, in document order."""
        pending = list(reversed(self.children))
        while pending:
            element = pending.pop()
            yield element
            pending.extend(reversed(element.children))


def elements_of(text: str) -> Element:
    """The elements of a text, below one that stands for the whole; none if it is too long."""
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
        elif isinstance(token, TextRun):
            stack[-1].text += text[token.start : token.end]
    return whole


def _attributes(tag: StartTag, text: str) -> dict[str, str]:
    found = {
        name: decode_value(text[start:end], start, []) for name, _, start, end in tag.attributes
    }
    if tag.faults:
        found[""] = text[tag.start : tag.end]
    return found
