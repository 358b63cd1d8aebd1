"""Assumptions as they are written: their form, their parser, and its messages about mistakes.

The form speaks of selectors. It is immutable and printable: ``str`` of it parses to the same form
again. A message says what is wrong, where, and what to write instead.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

from gpsfsm.errors import AssumptionError
from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from lark import Lark, Token
    from lark.exceptions import UnexpectedInput


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
    """A quantifier: a written word, or ``the`` (none: exactly one instance must match)."""

    word: Literal["the", "any", "all", "no", "at least", "at most", "exactly"]
    number: int = 0

    def __str__(self) -> str:
        numbered = self.word in ("at least", "at most", "exactly")
        return f"{self.word} {self.number}" if numbered else self.word


@dataclass(frozen=True, slots=True)
class Verb:
    """An event of an instance that happens or not; ``agree`` is said of all instances together."""

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
    """A number of statements that hold: ``at most 1 of (…, …)``."""

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


_MAX_DEPTH = 50


def statement_of(text: str) -> Statement:
    """Parse ``text``; raises MistakeError, or lark's UnexpectedInput for what is no statement."""
    return cast("Statement", _parser().parse(text))


@cache
def _parser() -> Lark:
    from lark import Lark

    grammar = Path(__file__).with_name("grammar.lark").read_text(encoding="utf-8")
    return Lark(grammar, parser="lalr", transformer=_Builder())


_QUANTIFIERS = {"some": "any", "every": "all", "each": "all", "none": "no"}
_NUMBERS = ("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
_STEP = re.compile(r"/(Control|Runner)\[([1-9][0-9]{0,8})\]")


class _Builder:
    """Builds the written form; each method is named after a rule of the grammar."""

    def start(self, parts: list[Any]) -> Statement:
        return cast("Statement", parts[0])

    def forecast(self, parts: list[Any]) -> Statement:
        ever, verb, selectors = parts
        return Claim(Quantifier("all"), selectors, _ever(ever, verb))

    def same(self, parts: list[Any]) -> Statement:
        return Claim(Quantifier("all"), parts[0], Verb("agree"))

    def iff(self, parts: list[Any]) -> Statement:
        return _compound("iff", parts)

    def implies(self, parts: list[Any]) -> Statement:
        return _compound("implies", parts)

    def disjunction(self, parts: list[Any]) -> Statement:
        return _compound("or", parts)

    def exclusion(self, parts: list[Any]) -> Statement:
        return _compound("xor", parts)

    def conjunction(self, parts: list[Any]) -> Statement:
        return _compound("and", parts)

    def negation(self, parts: list[Any]) -> Statement:
        return _compound("not", parts[1:])

    def bare(self, parts: list[Any]) -> Statement:
        selector, (ever, verb) = parts
        every = ever is not None or verb.word == "agree"
        quantifier = Quantifier("all" if every else "the")
        return Claim(quantifier, (selector,), _ever(ever, verb))

    def quantified(self, parts: list[Any]) -> Statement:
        quantifier, chosen, (ever, verb) = parts
        selectors = chosen if isinstance(chosen, tuple) else (chosen,)
        if verb.word == "agree" and quantifier.word != "all":
            wrong = f"'agree' applies to all instances, not to '{quantifier}'"
            raise MistakeError(selectors[0].at, wrong)
        return Claim(quantifier, selectors, _ever(ever, verb))

    def tally(self, parts: list[Any]) -> Statement:
        depth = 1 + max(part.depth for part in parts[1:])
        return _bounded(Tally(parts[0], tuple(parts[1:]), depth))

    def quantifier(self, parts: list[Token]) -> Quantifier:
        word = " ".join(parts[0].lower().split())
        number = 0
        if len(parts) > 1:
            written = parts[1].lower()
            number = _NUMBERS.index(written) if written in _NUMBERS else int(written)
        return Quantifier(cast("Any", _QUANTIFIERS.get(word, word)), number)

    def tail(self, parts: list[Any]) -> tuple[Token | None, Verb]:
        if isinstance(parts[-1], Verb):
            return (parts[0] if len(parts) > 1 else None), parts[-1]
        return None, Verb("agree")

    def verb(self, parts: list[Token]) -> Verb:
        if parts[0].type == "NO_START":
            return Verb("start", negated=True)
        word = parts[-1].lower().removesuffix("s")
        return Verb(cast("Any", word), negated=len(parts) > 1)

    def selectors(self, parts: list[Selector]) -> tuple[Selector, ...]:
        return tuple(parts)

    def line(self, parts: list[Token]) -> Selector:
        line, _, column = parts[1].partition(":")
        return LineSelector(int(line), int(column) if column else None, _at(parts[0]))

    def path(self, parts: list[Token]) -> Selector:
        steps = parts[0].removeprefix("/Plan")
        if not parts[0].startswith("/Plan") or _STEP.sub("", steps):
            wrong = "an element path looks like /Plan/Control[1]/Runner[2], counting from 1"
            raise MistakeError(_at(parts[0]), wrong)
        path_steps = tuple((tag, int(ordinal)) for tag, ordinal in _STEP.findall(steps))
        return PathSelector(path_steps, _at(parts[0]))

    def label(self, parts: list[Token]) -> Selector:
        return LabelSelector(_unquoted(parts[1]), _at(parts[0]))

    def interface(self, parts: list[Any]) -> Selector:
        parameters = parts[1] if len(parts) > 1 else ()
        literal = parts[0].type == "STRING"
        return InterfaceSelector(_unquoted(parts[0]), parameters, literal, _at(parts[0]))

    def parameters(self, parts: list[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
        return tuple(parts)

    def parameter(self, parts: list[Token]) -> tuple[str, str]:
        return str(parts[0]), _unquoted(parts[1])


def _compound(operator: Any, parts: Sequence[Statement]) -> Statement:
    depth = 1 + max(part.depth for part in parts)
    return _bounded(Compound(operator, tuple(parts), depth))


def _bounded(statement: Tally | Compound) -> Statement:
    if statement.depth > _MAX_DEPTH:
        raise MistakeError(0, f"an assumption nests at most {_MAX_DEPTH} levels deep")
    return statement


def _ever(ever: Token | None, verb: Verb) -> Verb:
    never = ever is not None and ever.lower() == "never"
    return replace(verb, negated=verb.negated != never)


def _at(token: Token) -> int:
    return token.start_pos or 0


def _unquoted(token: Token) -> str:
    if token.type != "STRING":
        return str(token)
    return re.sub(r"\\(.)", r"\1", token[1:-1], flags=re.DOTALL)


_EXAMPLE = "for example: line 7 fails implies line 9 succeeds"
_EXAMPLES = {
    "never": "for example: never fails: SpeechRunner",
    "always": "for example: always succeeds: line 7",
    "same": "for example: same: WaypointRunner(x=1, y=2)",
    "if": "for example: if line 7 fails then line 9 succeeds",
    "at": "for example: at most 1 of (line 7 fails, line 9 fails)",
    "exactly": "for example: exactly one of (line 7, line 9) fails",
}
# Terminals of the grammar → what to call them; the minor ones only if nothing else may come.
_EXPECTED = {
    "NOT": "a claim such as 'line 7 fails'",
    "LINE": "what to select, such as 'line 7', '/Plan/Runner[2]' or 'SpeechRunner'",
    "VERB": "what happens ('succeeds', 'fails', 'hangs' or 'does not start')",
    "_THEN": "'then'",
    "_IFF": "a word such as 'and' or 'implies'",
    "PLACE": "a line number such as 7 or 7:12",
    "NUMBER": "a number",
    "PARAMETER": "a parameter such as x=1.0",
    "VALUE": "a value",
    "EQUAL": "'='",
    "COMMA": "','",
    "RPAR": "')'",
    "$END": "the end",
}
_MINOR = {"COLON": "':'", "STRING": "a name"}
_WORDS = {
    "VERB": ("succeeds", "fails", "hangs", "starts", "succeed", "fail", "hang", "start"),
    "EVER": ("never", "always"),
    "AGREE": ("agree",),
    "_IMPLIES": ("implies",),
    "_IFF": ("iff",),
    "_AND": ("and",),
    "_THEN": ("then",),
}
_TOKEN = re.compile(r"[\w*?./-]+|\S")


class MistakeError(Exception):
    """Something wrong at an offset of the text; ``hint`` says what to write instead."""

    def __init__(self, at: int, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.at = at
        self.message = _shown(message)
        self.hint = _shown(hint)


def too_long(most: int) -> AssumptionError:
    """An assumption has more than ``most`` characters."""
    return AssumptionError(f"an assumption has at most {most} characters")


def empty() -> AssumptionError:
    """An assumption is blank."""
    message = "the assumption is empty"
    return AssumptionError(f"{message}\n{_EXAMPLE}", summary=message, hint=_EXAMPLE)


def error_at(text: str, mistake: MistakeError) -> AssumptionError:
    """The error for a mistake in ``text``."""
    said = f"{mistake.message}; {mistake.hint}" if mistake.hint else mistake.message
    return AssumptionError(
        _excerpt(text, mistake.at, said),
        summary=_summary(text, mistake.at, mistake.message),
        hint=mistake.hint,
    )


def syntax_error(text: str, error: UnexpectedInput) -> AssumptionError:
    """The error for a text that violates the grammar."""
    at: int = cast("Any", error).pos_in_stream
    token = getattr(error, "token", None)
    if token is not None and token.type == "$END":
        at = len(text.rstrip())
    match = _TOKEN.search(text, at)
    if match and match[0] in "\"'":
        return error_at(text, MistakeError(at, "this quote is never closed"))
    expected: set[str] = cast("Any", error).interactive_parser.accepts()
    got = f"'{_shown(match[0][:40])}'" if match else "the end"
    message = f"expected {_expectation(expected)}, found {got}"
    words = [word for name, some in _WORDS.items() if name in expected for word in some]
    close = get_close_matches(match[0].lower(), words, n=1) if match else []
    first = text.split(maxsplit=1)[0].lower().rstrip(":")
    hints = [f"did you mean '{close[0]}'?"] if close else []
    hints.append(_EXAMPLES.get(first, _EXAMPLE))
    return AssumptionError(
        "\n".join([_excerpt(text, at, message), *hints]),
        summary=_summary(text, at, message),
        hint=" ".join(hints),
    )


def listed(words: Iterable[str]) -> str:
    """Return ``a, b, c`` of at most five words, then how many are left out."""
    items = list(words)
    more = f" and {len(items) - 5} more" if len(items) > 5 else ""
    return ", ".join(items[:5]) + more


def short(text: object) -> str:
    """``str`` of something, cut off where it is too long for a message."""
    shown = str(text)
    return shown if len(shown) <= 100 else shown[:99] + "…"


def _expectation(expected: set[str]) -> str:
    names = [name for terminal, name in _EXPECTED.items() if terminal in expected]
    if "NOT" in expected:
        names.remove(_EXPECTED["LINE"])
    names = names or [name for terminal, name in _MINOR.items() if terminal in expected]
    return ", or ".join(names)


def _summary(text: str, at: int, message: str) -> str:
    """The mistake and its assumption, on one line."""
    return f"the assumption '{_around(text, at)[0].strip()}' cannot be used: {message}"


def _excerpt(text: str, at: int, message: str) -> str:
    """The message, the text around ``at`` on one line, and a caret under it."""
    shown, column = _around(text, at)
    return f"{message}\n    {shown}\n    {' ' * column}^"


def _around(text: str, at: int) -> tuple[str, int]:
    """The text around ``at`` on one line, and where ``at`` is in it."""
    first = max(0, at - 60)
    shown = ("…" if first else "") + _shown(text[first : first + 100])
    shown += "…" if first + 100 < len(text) else ""
    return shown.rstrip(), at - first + bool(first)


def _shown(text: str) -> str:
    return "".join(character if character.isprintable() else " " for character in text)
