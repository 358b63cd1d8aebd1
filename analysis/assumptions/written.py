"""The written form of an assumption, which speaks of selectors.

It is immutable and printable: ``str`` of it parses to the same form again.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Literal

from gpsfsm.model.event import Outcome

__all__ = [
    "Claim",
    "Compound",
    "InterfaceSelector",
    "LabelSelector",
    "LineSelector",
    "PathSelector",
    "Quantifier",
    "Selector",
    "Statement",
    "Tally",
    "Verb",
]


@dataclass(frozen=True, slots=True)
class LineSelector:
    """``line 7`` or ``line 7:12``. ``at`` is the offset in the text, as for all selectors."""

    line: int
    column: int | None = None
    at: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return f"line {self.line}" + ("" if self.column is None else f":{self.column}")


@dataclass(frozen=True, slots=True)
class PathSelector:
    """An element path; ``steps`` are (tag, ordinal) below ``/Plan``."""

    steps: tuple[tuple[str, int], ...]
    at: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return "/Plan" + "".join(f"/{tag}[{ordinal}]" for tag, ordinal in self.steps)


@dataclass(frozen=True, slots=True)
class LabelSelector:
    """``name "label"``: the runner instances labelled so, or inside a control labelled so."""

    label: str
    at: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return f"name {_quoted(self.label)}"


@dataclass(frozen=True, slots=True)
class InterfaceSelector:
    """An interface, perhaps with parameters. ``literal``: ``*`` and ``?`` mean themselves."""

    pattern: str
    parameters: tuple[tuple[str, str], ...] = ()
    literal: bool = False
    at: int = field(default=0, compare=False)

    def __str__(self) -> str:
        pattern = _quoted(self.pattern) if self.literal else self.pattern
        if not self.parameters:
            return pattern
        parameters = (f"{name}={_value(text)}" for name, text in self.parameters)
        return f"{pattern}({', '.join(parameters)})"


Selector = LineSelector | PathSelector | LabelSelector | InterfaceSelector


@dataclass(frozen=True, slots=True)
class Quantifier:
    """How many: ``the`` (none was written: exactly one instance must match) or a written word."""

    word: Literal["the", "any", "all", "no", "at least", "at most", "exactly"]
    number: int = 0

    def __str__(self) -> str:
        numbered = self.word in ("at least", "at most", "exactly")
        return f"{self.word} {self.number}" if numbered else self.word


@dataclass(frozen=True, slots=True)
class Verb:
    """What happens to an instance, or does not; ``agree`` is said of all instances together."""

    word: Literal["succeed", "fail", "hang", "start", "agree"]
    negated: bool = False

    @property
    def outcomes(self) -> frozenset[Outcome]:
        """The outcomes of which this is true."""
        return _EVERY - _OUTCOMES[self.word] if self.negated else _OUTCOMES[self.word]


@dataclass(frozen=True, slots=True)
class Claim:
    """Something that instances do: ``any SpeechRunner fails``."""

    quantifier: Quantifier
    selectors: tuple[Selector, ...]
    verb: Verb
    depth: int = field(default=0, compare=False)

    def __str__(self) -> str:
        one = self.quantifier.word == "the"
        chosen = ", ".join(map(str, self.selectors))
        if self.verb.negated:
            verb = f"does not {self.verb.word}" if one else f"do not {self.verb.word}"
        else:
            verb = f"{self.verb.word}s" if one else self.verb.word
        if len(self.selectors) > 1:
            return f"{_of(self.quantifier)} ({chosen}) {verb}"
        return f"{chosen} {verb}" if one else f"{self.quantifier} {chosen} {verb}"


@dataclass(frozen=True, slots=True)
class Tally:
    """How many of some statements hold: ``at most 1 of (…, …)``."""

    quantifier: Quantifier
    parts: tuple[Statement, ...]
    depth: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return f"{_of(self.quantifier)} ({', '.join(map(str, self.parts))})"


@dataclass(frozen=True, slots=True)
class Compound:
    """Statements joined by a connective."""

    operator: Literal["not", "and", "or", "xor", "implies", "iff"]
    parts: tuple[Statement, ...]
    depth: int = field(default=0, compare=False)

    def __str__(self) -> str:
        parts = [f"({part})" if isinstance(part, Compound) else str(part) for part in self.parts]
        return f"not {parts[0]}" if self.operator == "not" else f" {self.operator} ".join(parts)


Statement = Claim | Tally | Compound

_EVERY = frozenset(Outcome)
_OUTCOMES = {
    "succeed": frozenset({Outcome.SUCCEEDED}),
    "fail": frozenset({Outcome.FAILED, Outcome.NO_START}),  # both emit FAILED
    "hang": frozenset({Outcome.HANG}),
    "start": _EVERY - {Outcome.NO_START},
    "agree": _EVERY,
}
_PLAIN_VALUE = re.compile(r"[\w.+-]+")


def _of(quantifier: Quantifier) -> str:
    return "none of" if quantifier.word == "no" else f"{quantifier} of"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _value(text: str) -> str:
    return text if _PLAIN_VALUE.fullmatch(text) else _quoted(text)
