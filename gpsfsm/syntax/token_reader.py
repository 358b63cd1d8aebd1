"""The reading of tokens, for plans and behaviour trees: problems, nesting, attributes, limits.

A suppression comment is ``<!-- gpsfsm: ignore GP302 because the dock is optional -->``.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections import Counter
from dataclasses import replace
from difflib import SequenceMatcher
from enum import Enum, auto
from typing import TYPE_CHECKING, ClassVar, assert_never

from gpsfsm.late import dataclass, pattern
from gpsfsm.model.finding import Problem, Related, Severity
from gpsfsm.model.plan import Attribute, Location
from gpsfsm.syntax.text import WHITE, clip, is_namespace_declaration
from gpsfsm.syntax.tokens import Comment, EndTag, Fault, Markup, OverLimit, StartTag, TextRun, Token
from gpsfsm.syntax.values import decode_value, typed

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.syntax.source import Limits
    from gpsfsm.syntax.text import Lines

# ---- The problems of a text: places, caps, order -------------------------------------------------


_OF_TEXT = ("GP101", "GP102", "GP108", "GP110")
_LOOSE = ("GP101", "GP108")
_VAIN = 100


class Collector:
    """The problems of one text; of each rule at most ``cap`` are kept, the others counted.

    ``exhausted`` tells that there are so many errors in the text itself that reading on is vain.
    The collectors of included files tell this one; ``file`` is the name of such a file.
    """

    def __init__(self, lines: Lines, cap: int, file: str = "") -> None:
        self.lines, self.file = lines, file
        self._cap = cap
        self._counts: Counter[str] = Counter()
        self._problems: list[Problem] = []
        self._files = {file: self}
        self.exhausted = False

    def including(self, file: str, lines: Lines) -> Collector:
        """A collector for an included file, whose problems are listed and counted with these."""
        other = Collector(lines, self._cap, file)
        other._counts, other._problems, other._files = self._counts, self._problems, self._files
        self._files[file] = other
        return other

    def of(self, file: str) -> Collector:
        """The collector of the file that was read ("") or of an included one."""
        return self._files[file]

    def location(self, offset: int, element: str = "") -> Location:
        """The place of an offset."""
        line, column = self.lines.position(offset)
        return Location(line, column, element, self.file)

    def add(
        self,
        rule: str,
        start: int,
        length: int,
        *,
        message: str,
        hint: str = "",
        element: str = "",
        related: Iterable[Related] = (),
    ) -> None:
        """Report a problem; ``length`` is cut at the end of the line."""
        if self.full(rule):
            self.count(rule)
            return
        self._counts[rule] += 1
        shown = min(length, self.lines.rest(start))
        location = self.location(start, element)
        self._problems.append(Problem(rule, message, location, hint, shown, tuple(related)))

    def full(self, rule: str) -> bool:
        """True if no more problems of ``rule`` are kept."""
        return self._counts[rule] >= self._cap

    def count(self, rule: str) -> None:
        """Count a problem that is not kept; cheaper than finding words for it."""
        self._counts[rule] += 1
        if rule in _OF_TEXT and self._counts[rule] > _VAIN * self._cap:
            self.exhausted = True

    def add_faults(self, faults: list[Fault], element: str) -> None:
        """Report what the scanner found."""
        for start, length, message, hint, rule in faults:
            self.add(rule, start, length, message=message, hint=hint, element=element)

    def tolerate(self, words: str) -> None:
        """Make warnings of what breaks the rules of XML in this file; ``words`` say who reads it.

        Nothing changes if anything else is wrong with the text.
        """
        rows = [each for each in self._problems if each.location.file == self.file]
        if any(each.rule in _OF_TEXT and each.rule not in _LOOSE for each in rows):
            return
        for number, each in enumerate(self._problems):
            if each.rule in _LOOSE and each.location.file == self.file:
                message = f"{each.message}; {words}"
                self._problems[number] = replace(each, message=message, severity=Severity.WARNING)

    def problems(self) -> tuple[Problem, ...]:
        """The problems in text order, file by file."""
        return tuple(sorted(self._problems, key=lambda problem: problem.location.order))

    def notes(self) -> tuple[str, ...]:
        """One note per rule of which problems were left out."""
        return tuple(
            f"{count:,} problems of rule {rule} were found; the first {self._cap:,} are listed"
            for rule, count in sorted(self._counts.items())
            if count > self._cap
        )


# ---- Open elements: which end tag closes what, and what is left open -----------------------------
# The stack holds one frame per open element. An end tag that does not fit the innermost element
# closes all up to the element of its name, if one is open; else it is a misspelt end tag of the
# innermost one, if it looks like that; else it closes nothing.
#
# ``<Plan><Control><Runner></Control>``: the end tag closes the runner (reported: never closed) and
#     the control; the plan stays open, and ``unfinished`` reports that at the end of the text.


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
                message=f"a runner must be empty, but this one contains {shown}",
                hint="close the runner with '/>' and move this after it, or remove it",
                element=frame.path,
            )
        elif frame.inside is Inside.PLAN and not frame.filled:
            what = "plan" if frame.tag.lower() == "plan" else "control"
            self._collector.add(
                "GP109",
                frame.start,
                1 + len(frame.tag),
                message=f"this {what} is empty: it does nothing",
                hint="add runners to it" + ("" if what == "plan" else ", or remove it"),
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
            hint = f"remove it, or write </{clip(top.tag)}> if it is meant to close that element"
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


# ---- Attributes, limits and suppression comments -------------------------------------------------


MAX_SUPPRESSIONS = 10_000
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
        if suppression and len(self.suppressions) + len(self._pending) < MAX_SUPPRESSIONS:
            self._pending.append((*suppression, comment.start))

    def _faults(self, faults: list[Fault]) -> None:
        if faults:
            self.broken = True
            frames = self._nesting.frames
            self.collector.add_faults(faults, frames[-1].path if frames else "")

    def _over(self, start: int, message: str, option: str) -> None:
        self.over = True
        raised = f"raise --{option} if the {self.noun} is meant to be like this"
        hint = f"{raised if option else 'correct it'}; gpsfsm stops reading here"
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
