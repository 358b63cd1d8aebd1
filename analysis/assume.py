"""The language of ``--assume``: constraints between outcomes, written as a person would say them.

``parse_assumption`` reads the text (syntax only), ``Assumption.bind`` finds the runner instances
that its selectors mean in one plan. docs/assumptions.md defines the language.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import dataclass, replace
from difflib import get_close_matches
from fnmatch import fnmatchcase
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from gpsfsm.analysis import assume_ast as ast
from gpsfsm.errors import AssumptionError
from gpsfsm.model.plan import Attribute, Element, Kind, Plan, Value

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from lark import Lark, Token
    from lark.exceptions import UnexpectedInput

__all__ = ["Assumption", "Bound", "parse_assumption"]

_MAX_LENGTH = 10_000
_MAX_DEPTH = 50
_MAX_ATOMS = 1_000_000


@dataclass(frozen=True, slots=True)
class Bound:
    """An assumption about the instances of one plan.

    ``unmatched`` are its selectors that select nothing in this plan, in the order of the text.
    """

    text: str
    formula: ast.Formula
    unmatched: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Assumption:
    """An assumption as written; ``str`` is its canonical form, which parses to the same."""

    text: str
    statement: ast.Statement

    def __str__(self) -> str:
        return str(self.statement)

    def bind(self, plan: Plan) -> Bound:
        """Return the formula that the assumption is for ``plan``.

        Raises AssumptionError for a line or path without runner, and where a selector without
        ``any`` or ``all`` selects several instances. An assumption about one instance (neither
        ``any`` nor ``all`` …) that the plan does not have does not apply to it: it is true.
        """
        binder = _Binder(plan)
        try:
            formula = binder.formula(self.statement)
        except _Mistake as mistake:
            raise AssumptionError(_excerpt(self.text, mistake.at, str(mistake))) from None
        if not binder.applies:
            formula = ast.Constant(True)
        return Bound(self.text, formula, tuple(binder.unmatched))


def parse_assumption(text: str) -> Assumption:
    """Parse one assumption; raises AssumptionError with a caret under what is wrong.

    >>> str(parse_assumption("SpeechRunner NEVER fails"))
    'all SpeechRunner do not fail'
    """
    if len(text) > _MAX_LENGTH:
        raise AssumptionError(f"an assumption has at most {_MAX_LENGTH} characters")
    if not text.strip():
        raise AssumptionError(f"the assumption is empty\n{_EXAMPLE}")
    from lark.exceptions import UnexpectedInput  # noqa: PLC0415  (only needed with --assume)

    try:
        return Assumption(text, cast("ast.Statement", _parser().parse(text)))
    except _Mistake as mistake:
        raise AssumptionError(_excerpt(text, mistake.at, str(mistake))) from None
    except UnexpectedInput as error:
        raise AssumptionError(_syntax_error(text, error)) from None


class _Mistake(Exception):  # noqa: N818  (never leaves this module)
    """Something wrong at an offset of the text."""

    def __init__(self, at: int, message: str) -> None:
        super().__init__(message)
        self.at = at


# --- from tokens to the written form ---


@cache
def _parser() -> Lark:
    from lark import Lark  # noqa: PLC0415

    grammar = Path(__file__).with_name("assume.lark").read_text(encoding="utf-8")
    return Lark(grammar, parser="lalr", transformer=_Builder())


_QUANTIFIERS = {"some": "any", "every": "all", "each": "all", "none": "no"}
_NUMBERS = ("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
_STEP = re.compile(r"/(Control|Runner)\[([1-9][0-9]{0,8})\]")


class _Builder:
    """Builds the written form; each method is named after a rule of the grammar."""

    def start(self, parts: list[Any]) -> ast.Statement:
        return cast("ast.Statement", parts[0])

    def forecast(self, parts: list[Any]) -> ast.Statement:
        ever, verb, selectors = parts
        return ast.Claim(ast.Quantifier("all"), selectors, _ever(ever, verb))

    def same(self, parts: list[Any]) -> ast.Statement:
        return ast.Claim(ast.Quantifier("all"), parts[0], ast.Verb("agree"))

    def iff(self, parts: list[Any]) -> ast.Statement:
        return _compound("iff", parts)

    def implies(self, parts: list[Any]) -> ast.Statement:
        return _compound("implies", parts)

    def disjunction(self, parts: list[Any]) -> ast.Statement:
        return _compound("or", parts)

    def exclusion(self, parts: list[Any]) -> ast.Statement:
        return _compound("xor", parts)

    def conjunction(self, parts: list[Any]) -> ast.Statement:
        return _compound("and", parts)

    def negation(self, parts: list[Any]) -> ast.Statement:
        return _compound("not", parts[1:])

    def bare(self, parts: list[Any]) -> ast.Statement:
        selector, (ever, verb) = parts
        every = ever is not None or verb.word == "agree"
        quantifier = ast.Quantifier("all" if every else "the")
        return ast.Claim(quantifier, (selector,), _ever(ever, verb))

    def quantified(self, parts: list[Any]) -> ast.Statement:
        quantifier, chosen, (ever, verb) = parts
        selectors = chosen if isinstance(chosen, tuple) else (chosen,)
        if verb.word == "agree" and quantifier.word != "all":
            wrong = f"'agree' is said of all instances, not of '{quantifier}'"
            raise _Mistake(selectors[0].at, wrong)
        return ast.Claim(quantifier, selectors, _ever(ever, verb))

    def tally(self, parts: list[Any]) -> ast.Statement:
        depth = 1 + max(part.depth for part in parts[1:])
        return _bounded(ast.Tally(parts[0], tuple(parts[1:]), depth))

    def quantifier(self, parts: list[Token]) -> ast.Quantifier:
        word = " ".join(parts[0].lower().split())
        number = 0
        if len(parts) > 1:
            written = parts[1].lower()
            number = _NUMBERS.index(written) if written in _NUMBERS else int(written)
        return ast.Quantifier(cast("Any", _QUANTIFIERS.get(word, word)), number)

    def tail(self, parts: list[Any]) -> tuple[Token | None, ast.Verb]:
        if isinstance(parts[-1], ast.Verb):
            return (parts[0] if len(parts) > 1 else None), parts[-1]
        return None, ast.Verb("agree")

    def verb(self, parts: list[Token]) -> ast.Verb:
        if parts[0].type == "NO_START":
            return ast.Verb("start", negated=True)
        word = parts[-1].lower().removesuffix("s")
        return ast.Verb(cast("Any", word), negated=len(parts) > 1)

    def selectors(self, parts: list[ast.Selector]) -> tuple[ast.Selector, ...]:
        return tuple(parts)

    def line(self, parts: list[Token]) -> ast.Selector:
        line, _, column = parts[1].partition(":")
        return ast.LineSelector(int(line), int(column) if column else None, _at(parts[0]))

    def path(self, parts: list[Token]) -> ast.Selector:
        steps = parts[0].removeprefix("/Plan")
        if not parts[0].startswith("/Plan") or _STEP.sub("", steps):
            wrong = "an element path is written like /Plan/Control[1]/Runner[2], counting from 1"
            raise _Mistake(_at(parts[0]), wrong)
        found = tuple((tag, int(ordinal)) for tag, ordinal in _STEP.findall(steps))
        return ast.PathSelector(found, _at(parts[0]))

    def label(self, parts: list[Token]) -> ast.Selector:
        return ast.LabelSelector(_unquoted(parts[1]), _at(parts[0]))

    def interface(self, parts: list[Any]) -> ast.Selector:
        parameters = parts[1] if len(parts) > 1 else ()
        literal = parts[0].type == "STRING"
        return ast.InterfaceSelector(_unquoted(parts[0]), parameters, literal, _at(parts[0]))

    def parameters(self, parts: list[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
        return tuple(parts)

    def parameter(self, parts: list[Token]) -> tuple[str, str]:
        return str(parts[0]), _unquoted(parts[1])


def _compound(operator: Any, parts: Sequence[ast.Statement]) -> ast.Statement:
    depth = 1 + max(part.depth for part in parts)
    return _bounded(ast.Compound(operator, tuple(parts), depth))


def _bounded(statement: ast.Tally | ast.Compound) -> ast.Statement:
    if statement.depth > _MAX_DEPTH:
        raise _Mistake(0, f"an assumption nests at most {_MAX_DEPTH} levels deep")
    return statement


def _ever(ever: Token | None, verb: ast.Verb) -> ast.Verb:
    never = ever is not None and ever.lower() == "never"
    return replace(verb, negated=verb.negated != never)


def _at(token: Token) -> int:
    return token.start_pos or 0


def _unquoted(token: Token) -> str:
    if token.type != "STRING":
        return str(token)
    return re.sub(r"\\(.)", r"\1", token[1:-1], flags=re.DOTALL)


# --- errors ---

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
_FOUND = re.compile(r"[\w*?./-]+|\S")


def _syntax_error(text: str, error: UnexpectedInput) -> str:
    at: int = cast("Any", error).pos_in_stream
    token = getattr(error, "token", None)
    if token is not None and token.type == "$END":
        at = len(text.rstrip())
    found = _FOUND.search(text, at)
    if found and found[0] in "\"'":
        return _excerpt(text, at, "this quote is never closed")
    expected: set[str] = cast("Any", error).interactive_parser.accepts()
    names = [name for terminal, name in _EXPECTED.items() if terminal in expected]
    if "NOT" in expected:
        names.remove(_EXPECTED["LINE"])
    names = names or [name for terminal, name in _MINOR.items() if terminal in expected]
    got = f"'{_shown(found[0][:40])}'" if found else "the end"
    message = _excerpt(text, at, f"expected {', or '.join(names)}, found {got}")
    words = [word for name, some in _WORDS.items() if name in expected for word in some]
    close = get_close_matches(found[0].lower(), words, n=1) if found else []
    hint = [f"did you mean '{close[0]}'?"] if close else []
    first = text.split(maxsplit=1)[0].lower().rstrip(":")
    return "\n".join([message, *hint, _EXAMPLES.get(first, _EXAMPLE)])


def _excerpt(text: str, at: int, message: str) -> str:
    """Return the message, the text around ``at`` on one line, and a caret under it."""
    first = max(0, at - 60)
    shown = ("…" if first else "") + _shown(text[first : first + 100])
    shown += "…" if first + 100 < len(text) else ""
    column = at - first + bool(first)
    return f"{message}\n    {shown.rstrip()}\n    {' ' * column}^"


def _shown(text: str) -> str:
    return "".join(character if character.isprintable() else " " for character in text)


# --- binding ---


class _Binder:
    """Turns written statements into formulas over the instances of one plan."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.applies = True
        self.unmatched: dict[str, None] = {}
        self._atoms = 0
        self._selected: dict[ast.Selector, Sequence[int]] = {}

    def formula(self, statement: ast.Statement) -> ast.Formula:
        """Return the formula of a statement; recursion is bounded by the nesting limit."""
        if isinstance(statement, ast.Claim):
            return self._claim(statement)
        parts = [self.formula(part) for part in statement.parts]
        if isinstance(statement, ast.Tally):
            return _quantified(statement.quantifier, parts)
        return _CONNECTIVES[statement.operator](parts)

    def _claim(self, claim: ast.Claim) -> ast.Formula:
        found: set[int] = set()
        for selector in claim.selectors:
            if selector not in self._selected:
                self._selected[selector] = self._select(selector)
            numbers = self._selected[selector]
            if not numbers:
                self.unmatched[str(selector)] = None
            found.update(numbers)
        chosen = sorted(found)
        self._atoms += len(chosen)
        if self._atoms > _MAX_ATOMS:
            wrong = f"the assumption speaks of more than {_MAX_ATOMS} runner instances"
            raise _Mistake(claim.selectors[0].at, wrong)
        if claim.verb.word == "agree":
            return ast.Agree(tuple(chosen)) if len(chosen) > 1 else ast.Constant(True)
        if claim.quantifier.word == "the":
            self.applies = self.applies and bool(chosen)
            if len(chosen) > 1:
                self._ambiguous(claim.selectors[0], chosen)
        outcomes = claim.verb.outcomes
        return _quantified(claim.quantifier, [ast.Atom(number, outcomes) for number in chosen])

    def _ambiguous(self, selector: ast.Selector, chosen: list[int]) -> None:
        runners = [self.plan.runners[number] for number in chosen]
        places = _listed(f"'line {runner.line}:{runner.column}'" for runner in runners)
        raise _Mistake(
            selector.at,
            f"'{selector}' selects {len(chosen)} runner instances: write 'any {selector}' (at"
            f" least one of them) or 'all {selector}' (each of them), or select one: {places}",
        )

    def _select(self, selector: ast.Selector) -> Sequence[int]:
        if isinstance(selector, ast.LineSelector):
            return self._on_line(selector)
        if isinstance(selector, ast.PathSelector):
            return self._inside(self._walk(selector)) or self._empty(selector)
        if isinstance(selector, ast.LabelSelector):
            return self._labelled(selector.label)
        return self._of_interface(selector)

    @cached_property
    def _first_lines(self) -> list[int]:
        return [runner.line for runner in self.plan.runners]

    @cached_property
    def _indices(self) -> list[int]:
        return [runner.index for runner in self.plan.runners]

    @cached_property
    def _by_interface(self) -> dict[str, list[int]]:
        found: dict[str, list[int]] = {}
        for number, runner in enumerate(self.plan.runners):
            found.setdefault(runner.interface, []).append(number)
        return found

    def _on_line(self, selector: ast.LineSelector) -> Sequence[int]:
        # Start tags do not overlap: those that cover a line are neighbours.
        found: list[int] = []
        number = bisect_right(self._first_lines, selector.line) - 1
        while number >= 0 and _last_line(self.plan.runners[number]) >= selector.line:
            found.append(number)
            number -= 1
        found.reverse()
        if not found:
            raise _Mistake(selector.at, self._no_runner_on(selector.line))
        if selector.column is None:
            return found
        there = [self.plan.runners[number] for number in found]
        exact = [
            number
            for number, runner in zip(found, there, strict=True)
            if (runner.line, runner.column) == (selector.line, selector.column)
        ]
        if not exact:
            places = _listed(f"{runner.line}:{runner.column}" for runner in there)
            wrong = f"no runner starts at {selector.line}:{selector.column}; near it: {places}"
            raise _Mistake(selector.at, wrong)
        return exact

    def _no_runner_on(self, line: int) -> str:
        for element in self.plan.elements:
            if element.line == line and element.kind is not Kind.RUNNER:
                path = self.plan.path(element)
                return f"line {line} holds no runner; to speak of those inside, write {path}"
        near = sorted(set(self._first_lines), key=lambda other: (abs(other - line), other))
        if not near:
            return f"line {line} holds no runner, nor does any other line"
        return f"line {line} holds no runner; the nearest are on line {_listed(map(str, near))}"

    def _walk(self, selector: ast.PathSelector) -> Element:
        current = self.plan.elements[0]
        for tag, ordinal in selector.steps:
            children = list(self.plan.children(current))
            steps = {(str(child.kind), child.ordinal): child for child in children}
            if (tag, ordinal) not in steps:
                here = self.plan.path(current)
                inside = _listed(f"{kind}[{number}]" for kind, number in steps) or "nothing"
                wrong = f"there is no {here}/{tag}[{ordinal}]; {here} holds {inside}"
                raise _Mistake(selector.at, wrong)
            current = steps[tag, ordinal]
        return current

    def _inside(self, element: Element) -> Sequence[int]:
        last = element
        while last.children:
            last = self.plan.elements[last.children[-1]]
        first = bisect_right(self._indices, element.index - 1)
        return range(first, bisect_right(self._indices, last.index))

    def _labelled(self, label: str) -> Sequence[int]:
        found: list[int] = []
        for element in self.plan.elements:
            labels = (element.text("name"), element.text("id"))
            if label in labels and element.kind is not Kind.PLAN:
                inside = self._inside(element)
                if inside and (not found or inside[-1] > found[-1]):  # else: all are found
                    found += inside
        return found

    def _empty(self, selector: ast.PathSelector) -> Sequence[int]:
        raise _Mistake(selector.at, f"there is no runner inside {selector}")

    def _of_interface(self, selector: ast.InterfaceSelector) -> Sequence[int]:
        fits = _interface_test(selector)
        found = [
            number
            for interface, numbers in self._by_interface.items()
            if fits(interface)
            for number in numbers
        ]
        if not selector.parameters:
            return found
        test = _parameter_test(selector.parameters)
        return [number for number in found if test(self.plan.runners[number])]


def _quantified(quantifier: ast.Quantifier, parts: list[ast.Formula]) -> ast.Formula:
    number, every = quantifier.number, len(parts)
    if quantifier.word == "all":
        return ast.conjunction(parts)
    least, most = {
        "no": (0, 0),
        "at least": (number, every),
        "at most": (0, number),
        "exactly": (number, number),
    }.get(quantifier.word, (1, every))
    return ast.count(least, most, parts)


_CONNECTIVES: dict[str, Callable[[list[ast.Formula]], ast.Formula]] = {
    "not": lambda parts: ast.negation(parts[0]),
    "and": ast.conjunction,
    "or": ast.disjunction,
    "xor": lambda parts: ast.negation(ast.Iff((parts[0], parts[1]))),
    "implies": lambda parts: ast.disjunction((ast.negation(parts[0]), parts[1])),
    "iff": lambda parts: ast.Iff((parts[0], parts[1])),
}


def _interface_test(selector: ast.InterfaceSelector) -> Callable[[str], bool]:
    """Return a test that compares the last components of an interface with the pattern."""
    patterns = selector.pattern.split("/")

    def fits(interface: str) -> bool:
        parts = interface.split("/")[-len(patterns) :]
        if selector.literal:
            return parts == patterns
        return len(parts) == len(patterns) and all(map(fnmatchcase, parts, patterns))

    return fits


def _parameter_test(parameters: Iterable[tuple[str, str]]) -> Callable[[Element], bool]:
    """Whether a runner has all these attributes with equal values."""
    from gpsfsm.syntax.values import typed  # noqa: PLC0415

    wanted = [(name, text, typed(text)) for name, text in parameters]

    def fits(runner: Element) -> bool:
        attributes = {attribute.name: attribute for attribute in runner.attributes}
        return all(
            name in attributes and _equal(attributes[name], text, value)
            for name, text, value in wanted
        )

    return fits


def _equal(attribute: Attribute, text: str, value: Value) -> bool:
    if attribute.text == text or attribute.name in _LABELS:
        return attribute.text == text
    # A Boolean never equals a number (in Python it does); a text never equals one anyway.
    return isinstance(attribute.value, bool) == isinstance(value, bool) and attribute.value == value


_LABELS = ("name", "id", "provider", "interface")  # compared as text: they are no parameters


def _last_line(runner: Element) -> int:
    return max([runner.line, *(attribute.line for attribute in runner.attributes)])


def _listed(words: Iterable[str]) -> str:
    """Return ``a, b, c`` of at most five words, then how many are left out."""
    found = list(words)
    more = f" and {len(found) - 5} more" if len(found) > 5 else ""
    return ", ".join(found[:5]) + more
