"""The reading of tokens, for plans and behaviour trees: limits, attributes, suppression comments.

A suppression comment is ``<!-- gpsfsm: ignore GP302 because the dock is optional -->``.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar, assert_never

from gpsfsm.late import dataclass, pattern
from gpsfsm.model.plan import Attribute
from gpsfsm.syntax.nesting import Nesting
from gpsfsm.syntax.text import is_namespace_declaration
from gpsfsm.syntax.tokens import (
    Comment,
    EndTag,
    Fault,
    Markup,
    OverLimit,
    StartTag,
    TextRun,
    Token,
)
from gpsfsm.syntax.values import decode_value, typed

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.model.plan import Location
    from gpsfsm.syntax.collector import Collector
    from gpsfsm.syntax.source import Limits

_MAX_SUPPRESSIONS = 10_000
_MARK = pattern(r"\s*gpsfsm\s*:(.*)", re.DOTALL | re.IGNORECASE)
_IGNORE = pattern(r"\s*ignore\b\s*(?:\[([^\]]*)\]\s*(.*)|(?!\[)(.*))", re.DOTALL | re.IGNORECASE)
_REASON = pattern(r"(?:^|\s)because\s|:", re.IGNORECASE)
_RULE = pattern(r"[A-Za-z][A-Za-z0-9]*(?:-[A-Za-z0-9]+)*")
_MAX_LENGTH = 2000


class TokenReader(ABC):
    """Takes tokens in order and tells the collector what is wrong; a subclass builds from them.

    ``broken``: the text is not well-formed, whatever was reported. ``fatal``: its elements cannot
    be known. ``over``: a limit was hit. ``deepest``: the greatest depth of nesting.
    """

    noun: ClassVar[str]
    """What the text should be, for messages: "plan" or "tree"."""

    declares_namespaces: ClassVar[bool]
    """Whether ``xmlns`` declares a namespace; where it does not, it is an ordinary attribute."""

    def __init__(self, text: str, limits: Limits, collector: Collector) -> None:
        self.text, self.limits, self.collector = text, limits, collector
        self.broken = self.fatal = self.over = False
        self.deepest = 0
        self.suppressions: list[Suppression] = []
        self._pending: list[tuple[tuple[str, ...], str, int]] = []
        self._nesting = Nesting(collector)
        self._swallowed = False

    @abstractmethod
    def _start(self, tag: StartTag) -> None: ...

    @abstractmethod
    def _end(self, tag: EndTag) -> None: ...

    @abstractmethod
    def _text(self, run: TextRun) -> None: ...

    def _take(self, tokens: Iterable[Token]) -> None:
        """Read the tokens until they or the limits end."""
        for token in tokens:
            match token:
                case StartTag():
                    self._start(token)
                case EndTag():
                    self._end(token)
                case TextRun():
                    self._text(token)
                case Comment():
                    self._comment(token)
                case Markup():
                    self._faults(token.faults)
                    self._swallowed |= token.swallowed
                case OverLimit():
                    self._over(token.start, token.message, token.option)
                case _:
                    assert_never(token)
            if self.collector.exhausted and not self.over:
                message = f"the text has too many errors to be a {self.noun}"
                self._over(token.start, message, "")
            if self.over:
                break
        else:
            self._finish()

    def _finish(self) -> None:
        """All tokens are read and no limit was hit: elements that are open still are reported."""
        if self._nesting.frames:
            self.broken = self.fatal = True
            if not self._swallowed:
                self._nesting.unfinished(self.text)

    def _too_many(self, tag: StartTag, count: int) -> bool:
        """True if a limit ends the reading here; ``count``: the elements with this one."""
        depth = len(self._nesting.frames) + 1
        self.deepest = max(self.deepest, depth)
        if count > self.limits.max_elements:
            message = f"the text has more than {self.limits.max_elements:,} elements"
            self._over(tag.start, message, "max-elements")
        elif depth > self.limits.max_depth:
            message = f"elements are nested more than {self.limits.max_depth:,} deep"
            self._over(tag.start, message, "max-depth")
        return self.over

    def _attributes(self, tag: StartTag, path: str) -> tuple[Attribute, ...]:
        """The attributes, decoded and typed; what is wrong with the tag is reported."""
        text, position = self.text, self.collector.lines.position
        declares_namespaces = self.declares_namespaces
        faults: list[Fault] = list(tag.faults)
        decoded: list[Attribute] = []
        for name, start, value_start, value_end in tag.attributes:
            value = decode_value(text[value_start:value_end], value_start, faults)
            if declares_namespaces and name[:5] == "xmlns" and is_namespace_declaration(name):
                continue
            line, column = position(start)
            decoded.append(Attribute(name, value, typed(value), line, column))
        if faults:
            self.broken = True
            self.fatal |= not tag.closed
            self.collector.add_faults(faults, path)
        return tuple(decoded)

    def _comment(self, comment: Comment) -> None:
        self._faults(comment.faults)
        self._swallowed |= comment.end == comment.body_end
        suppression = read_suppression(self.text[comment.start + 4 : comment.body_end])
        if suppression and len(self.suppressions) + len(self._pending) < _MAX_SUPPRESSIONS:
            self._pending.append((*suppression, comment.start))

    def _faults(self, faults: list[Fault]) -> None:
        if faults:
            self.broken = True
            frames = self._nesting.frames
            self.collector.add_faults(faults, frames[-1].path if frames else "")

    def _over(self, start: int, message: str, option: str) -> None:
        self.over = True
        raised = f"raise --{option} if the {self.noun} is meant to be like this"
        hint = f"gpsfsm stops reading here; {raised if option else 'correct it'}"
        self.collector.add("GP103", start, 1, message=message, hint=hint)

    def _attach(self, scope: str) -> None:
        """The suppression comments read last cover the element at ``scope``, "" for none."""
        for rules, reason, start in self._pending:
            location = self.collector.location(start, scope)
            self.suppressions.append(Suppression(rules, reason, location, scope))
        self._pending.clear()


@dataclass(frozen=True, slots=True)
class Suppression:
    """A suppression comment.

    ``rules`` are codes, names or prefixes as they are written, empty where the comment cannot be
    understood. ``location`` is that of the comment; ``scope`` is the element path of the element
    that follows it, which it covers with everything inside, or "" where no element follows.
    """

    rules: tuple[str, ...]
    reason: str
    location: Location
    scope: str


def read_suppression(body: str) -> tuple[tuple[str, ...], str] | None:
    """The rules and the reason in the words of a comment; None if it is an ordinary comment.

    >>> read_suppression(" gpsfsm: ignore GP302, GP303 because the dock is optional ")
    (('GP302', 'GP303'), 'the dock is optional')
    >>> read_suppression("gpsfsm: ignore[stuck]")
    (('stuck',), '')
    """
    mark = _MARK.match(body[:_MAX_LENGTH])
    if mark is None:
        return None
    match = _IGNORE.match(mark[1])
    if match is None:
        return (), ""
    if match[1] is not None:
        words, reason = match[1], re.sub(r"^(?:because\s|:)", "", match[2].strip())
    else:
        words, _, reason = _split(match[3])
    rules = tuple(words.replace(",", " ").split())
    if not all(_RULE.fullmatch(word) for word in rules):
        return (), ""
    return rules, reason.strip()


def _split(text: str) -> tuple[str, str, str]:
    """The words before the reason, the separator, the reason."""
    separator = _REASON.search(text)
    if separator is None:
        return text, "", ""
    return text[: separator.start()], separator[0], text[separator.end() :]
