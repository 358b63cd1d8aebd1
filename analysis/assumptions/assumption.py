"""Assumptions about the runner instances of one plan, and the formula that they come to.

Instances are numbered by their place in ``Plan.runners``; a selector means some of them.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from typing import TYPE_CHECKING

from gpsfsm.analysis.assumptions import parser
from gpsfsm.analysis.assumptions.formula import (
    Agree,
    Atom,
    Constant,
    Formula,
    Iff,
    conjunction,
    count,
    disjunction,
    negation,
)
from gpsfsm.analysis.assumptions.parser import (
    Claim,
    InterfaceSelector,
    LabelSelector,
    LineSelector,
    MistakeError,
    PathSelector,
    Quantifier,
    Selector,
    Statement,
    Tally,
    listed,
    short,
    statement_of,
)
from gpsfsm.errors import UsageError
from gpsfsm.model.capability import OWN
from gpsfsm.model.plan import Attribute, Element, Kind, Plan, Value, value_key
from gpsfsm.model.story import Vocabulary

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from gpsfsm.analysis.assumptions.formula import Formula
    from gpsfsm.analysis.assumptions.parser import Statement
    from gpsfsm.model.plan import Plan

_MAX_LENGTH = 10_000


@dataclass(frozen=True, slots=True)
class Bound:
    """An assumption about the instances of one plan.

    ``unmatched`` are its selectors that select nothing in this plan, in the order of the text.
    """

    text: str
    formula: Formula
    unmatched: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Assumption:
    """An assumption as written; ``str`` is its canonical form, which parses to the same."""

    text: str
    statement: Statement

    def __str__(self) -> str:
        return str(self.statement)

    def bind(self, plan: Plan, instances: Instances | None = None) -> Bound:
        """Return the formula that the assumption is for ``plan``, whose ``instances`` may be known.

        Raises AssumptionError for a line or path without runner, and where a selector without
        ``any`` or ``all`` selects several instances. An assumption about one instance (neither
        ``any`` nor ``all`` …) that the plan does not have does not apply to it: it is true.
        """
        try:
            formula, unmatched = formula_of(self.statement, instances or Instances(plan))
        except parser.MistakeError as mistake:
            raise parser.error_at(self.text, mistake) from None
        return Bound(self.text, formula, unmatched)


def parse_assumption(text: str) -> Assumption:
    """Parse one assumption; raises AssumptionError with a caret under what is wrong.

    >>> str(parse_assumption("SpeechRunner NEVER fails"))
    'all SpeechRunner do not fail'
    """
    value: object = text
    if not isinstance(value, str):
        example = "'never fails: GoRunner'"
        raise UsageError(f"an assumption is a text such as {example}, not {value!r:.40}")
    if len(text) > _MAX_LENGTH:
        raise parser.too_long(_MAX_LENGTH)
    if not text.strip():
        raise parser.empty()
    from lark.exceptions import UnexpectedInput

    try:
        return Assumption(text, statement_of(text))
    except parser.MistakeError as mistake:
        raise parser.error_at(text, mistake) from None
    except UnexpectedInput as error:
        raise parser.syntax_error(text, error) from None


class Instances:
    """The runner instances of one plan, to be selected."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self._selected: dict[Selector, Sequence[int]] = {}

    def select(self, selector: Selector) -> Sequence[int]:
        """The numbers of the instances that ``selector`` selects, in document order.

        Raises MistakeError for a line or an element path without runner.
        """
        if selector not in self._selected:
            numbers = self._select(selector)
            self._selected[selector] = [each for each in numbers if each not in self._unsettled]
        return self._selected[selector]

    @cached_property
    def _unsettled(self) -> frozenset[int]:
        """The choices and ticks of a tree: no runners, and one that counts rounds changes."""
        return frozenset(
            number
            for number, runner in enumerate(self.plan.runners)
            if self.plan.vocabulary is Vocabulary.TREE and runner.interface in OWN
        )

    def _select(self, selector: Selector) -> Sequence[int]:
        if isinstance(selector, LineSelector):
            return self._on_line(selector)
        if isinstance(selector, PathSelector):
            return self._inside(self._walk(selector)) or self._empty(selector)
        if isinstance(selector, LabelSelector):
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
        numbers: dict[str, list[int]] = {}
        for number, runner in enumerate(self.plan.runners):
            numbers.setdefault(runner.interface, []).append(number)
        return numbers

    def _on_line(self, selector: LineSelector) -> Sequence[int]:
        numbers = self._covering(selector.line)
        if not numbers:
            hint = self._near(selector.line)
            raise MistakeError(selector.at, f"line {selector.line} contains no runner", hint=hint)
        if selector.column is None:
            return numbers
        there = [self.plan.runners[number] for number in numbers]
        exact = [
            number
            for number, runner in zip(numbers, there, strict=True)
            if (runner.line, runner.column) == (selector.line, selector.column)
        ]
        if not exact:
            places = listed(f"{runner.line}:{runner.column}" for runner in there)
            wrong = f"no runner starts at {selector.line}:{selector.column}"
            raise MistakeError(selector.at, wrong, hint=f"write where a start tag begins: {places}")
        return exact

    def _covering(self, line: int) -> list[int]:
        """The runners whose start tags cover a line of the file itself, not of an included one."""
        if self.plan.vocabulary is Vocabulary.TREE:  # its runners stand in any order
            return [
                number
                for number, runner in enumerate(self.plan.runners)
                if runner.line <= line <= _last_line(runner)
                and not (runner.file or number in self._unsettled)
            ]
        # Start tags do not overlap: those that cover a line are neighbours.
        numbers: list[int] = []
        number = bisect_right(self._first_lines, line) - 1
        while number >= 0 and _last_line(self.plan.runners[number]) >= line:
            numbers.append(number)
            number -= 1
        return numbers[::-1]

    def _near(self, line: int) -> str:
        """A hint instead of a line that holds no runner."""
        for element in self.plan.elements:
            if element.line == line and element.kind is not Kind.RUNNER and not element.file:
                return f"to select the runners inside, write {self.plan.path(element)}"
        lines = {
            runner.line
            for number, runner in enumerate(self.plan.runners)
            if not (runner.file or number in self._unsettled)
        }
        near = sorted(lines, key=lambda other: (abs(other - line), other))
        if not near:
            return "the plan has no runner; select by interface, which may match nothing"
        return f"name a line that contains a runner, nearest first: {listed(map(str, near))}"

    def _walk(self, selector: PathSelector) -> Element:
        current = self.plan.elements[0]
        for tag, ordinal in selector.steps:
            children = list(self.plan.children(current))
            steps = {(str(child.kind), child.ordinal): child for child in children}
            if (tag, ordinal) not in steps:
                here = self.plan.path(current)
                inside = listed(f"{kind}[{number}]" for kind, number in steps) or "nothing"
                wrong = f"there is no {here}/{tag}[{ordinal}]"
                raise MistakeError(selector.at, wrong, hint=f"{here} contains {inside}")
            current = steps[tag, ordinal]
        return current

    def _inside(self, element: Element) -> Sequence[int]:
        last = element
        while last.children:
            last = self.plan.elements[last.children[-1]]
        first = bisect_right(self._indices, element.index - 1)
        return range(first, bisect_right(self._indices, last.index))

    def _labelled(self, label: str) -> Sequence[int]:
        numbers: list[int] = []
        for element in self.plan.elements:
            labels = (element.text("name"), element.text("id"))
            if label in labels and element.kind is not Kind.PLAN:
                inside = self._inside(element)
                if inside and (not numbers or inside[-1] > numbers[-1]):  # else: all are found
                    numbers += inside
        return numbers

    def _empty(self, selector: PathSelector) -> Sequence[int]:
        wrong = f"there is no runner inside {short(selector)}"
        raise MistakeError(selector.at, wrong, hint="name a runner, or a control that contains one")

    def _of_interface(self, selector: InterfaceSelector) -> Sequence[int]:
        fits = _interface_test(selector)
        matching = [
            number
            for interface, numbers in self._by_interface.items()
            if fits(interface)
            for number in numbers
        ]
        if not selector.parameters:
            return matching
        test = _parameter_test(selector.parameters)
        return [number for number in matching if test(self.plan.runners[number])]


def _interface_test(selector: InterfaceSelector) -> Callable[[str], bool]:
    """Return a test that compares the last components of an interface with the pattern."""
    patterns = selector.pattern.split("/")

    def fits(interface: str) -> bool:
        parts = interface.split("/")[-len(patterns) :]
        if selector.literal:
            return parts == patterns
        return len(parts) == len(patterns) and all(map(fnmatchcase, parts, patterns))

    return fits


def _parameter_test(parameters: Iterable[tuple[str, str]]) -> Callable[[Element], bool]:
    """True if a runner has all these attributes with equal values."""
    from gpsfsm.syntax.values import typed

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
    return value_key(attribute.value) == value_key(value)


_LABELS = ("name", "id", "provider", "interface")  # compared as text: they are no parameters


def _last_line(runner: Element) -> int:
    return max([runner.line, *(attribute.line for attribute in runner.attributes)])


_MAX_ATOMS = 1_000_000


def formula_of(statement: Statement, instances: Instances) -> tuple[Formula, tuple[str, ...]]:
    """The formula of ``statement`` for a plan, and the selectors that select nothing in it.

    Raises MistakeError where a selector does not fit the plan.
    """
    binder = _Binder(instances)
    formula = binder.formula(statement)
    if not binder.applies:
        formula = Constant(True)
    return formula, tuple(binder.unmatched)


class _Binder:
    """Turns written statements into formulas over the instances of one plan."""

    def __init__(self, instances: Instances) -> None:
        self.applies = True
        self.unmatched: dict[str, None] = {}
        self._instances = instances
        self._atoms = 0

    def formula(self, statement: Statement) -> Formula:
        """Return the formula of a statement; recursion is bounded by the nesting limit."""
        if isinstance(statement, Claim):
            return self._claim(statement)
        parts = [self.formula(part) for part in statement.parts]
        if isinstance(statement, Tally):
            return _quantified(statement.quantifier, parts)
        return _CONNECTIVES[statement.operator](parts)

    def _claim(self, claim: Claim) -> Formula:
        chosen = self._chosen(claim.selectors)
        self._atoms += len(chosen)
        if self._atoms > _MAX_ATOMS:
            wrong = f"the assumption refers to more than {_MAX_ATOMS} runner instances"
            hint = "select fewer, or say less in one assumption"
            raise MistakeError(claim.selectors[0].at, wrong, hint=hint)
        if claim.verb.word == "agree":
            return Agree(tuple(chosen)) if len(chosen) > 1 else Constant(True)
        if claim.quantifier.word == "the":
            self.applies = self.applies and bool(chosen)
            if len(chosen) > 1:
                self._ambiguous(claim.selectors[0], chosen)
        outcomes = claim.verb.outcomes
        return _quantified(claim.quantifier, [Atom(number, outcomes) for number in chosen])

    def _chosen(self, selectors: tuple[Selector, ...]) -> list[int]:
        chosen: set[int] = set()
        for selector in selectors:
            numbers = self._instances.select(selector)
            if not numbers:
                self.unmatched[str(selector)] = None
            chosen.update(numbers)
        return sorted(chosen)

    def _ambiguous(self, selector: Selector, chosen: list[int]) -> None:
        runners = [self._instances.plan.runners[number] for number in chosen]
        name = short(selector)
        places = listed(f"'line {runner.line}:{runner.column}'" for runner in runners)
        raise MistakeError(
            selector.at,
            f"'{name}' selects {len(chosen)} runner instances",
            hint=f"write 'any {name}' (at least one of them) or 'all {name}' (each of"
            f" them), or select one: {places}",
        )


def _quantified(quantifier: Quantifier, parts: list[Formula]) -> Formula:
    number, every = quantifier.number, len(parts)
    if quantifier.word == "all":
        return conjunction(parts)
    least, most = {
        "no": (0, 0),
        "at least": (number, every),
        "at most": (0, number),
        "exactly": (number, number),
    }.get(quantifier.word, (1, every))
    return count(least, most, parts)


_CONNECTIVES: dict[str, Callable[[list[Formula]], Formula]] = {
    "not": lambda parts: negation(parts[0]),
    "and": conjunction,
    "or": disjunction,
    "xor": lambda parts: negation(Iff((parts[0], parts[1]))),
    "implies": lambda parts: disjunction((negation(parts[0]), parts[1])),
    "iff": lambda parts: Iff((parts[0], parts[1])),
}
