"""Which runner instances of a plan a selector means.

Instances are numbered by their place in ``Plan.runners``.
"""

from __future__ import annotations

from bisect import bisect_right
from fnmatch import fnmatchcase
from functools import cached_property
from typing import TYPE_CHECKING

from gpsfsm.analysis.assumptions.messages import Mistake, listed, short
from gpsfsm.analysis.assumptions.written import (
    InterfaceSelector,
    LabelSelector,
    LineSelector,
    PathSelector,
    Selector,
)
from gpsfsm.model.plan import Attribute, Element, Kind, Plan, Value, value_key

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

__all__ = ["Instances"]


class Instances:
    """The runner instances of one plan, to be selected."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self._selected: dict[Selector, Sequence[int]] = {}

    def select(self, selector: Selector) -> Sequence[int]:
        """The numbers of the instances that ``selector`` selects, in document order.

        Raises Mistake for a line or an element path without runner.
        """
        if selector not in self._selected:
            self._selected[selector] = self._select(selector)
        return self._selected[selector]

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
        found: dict[str, list[int]] = {}
        for number, runner in enumerate(self.plan.runners):
            found.setdefault(runner.interface, []).append(number)
        return found

    def _on_line(self, selector: LineSelector) -> Sequence[int]:
        # Start tags do not overlap: those that cover a line are neighbours.
        found: list[int] = []
        number = bisect_right(self._first_lines, selector.line) - 1
        while number >= 0 and _last_line(self.plan.runners[number]) >= selector.line:
            found.append(number)
            number -= 1
        found.reverse()
        if not found:
            hint = self._near(selector.line)
            raise Mistake(selector.at, f"line {selector.line} holds no runner", hint=hint)
        if selector.column is None:
            return found
        there = [self.plan.runners[number] for number in found]
        exact = [
            number
            for number, runner in zip(found, there, strict=True)
            if (runner.line, runner.column) == (selector.line, selector.column)
        ]
        if not exact:
            places = listed(f"{runner.line}:{runner.column}" for runner in there)
            wrong = f"no runner starts at {selector.line}:{selector.column}"
            raise Mistake(selector.at, wrong, hint=f"write where a start tag begins: {places}")
        return exact

    def _near(self, line: int) -> str:
        """What to write instead of a line that holds no runner."""
        for element in self.plan.elements:
            if element.line == line and element.kind is not Kind.RUNNER:
                return f"to speak of the runners inside, write {self.plan.path(element)}"
        near = sorted(set(self._first_lines), key=lambda other: (abs(other - line), other))
        if not near:
            return "the plan has no runner; select by interface, which may match nothing"
        return f"name a line that holds a runner, nearest first: {listed(map(str, near))}"

    def _walk(self, selector: PathSelector) -> Element:
        current = self.plan.elements[0]
        for tag, ordinal in selector.steps:
            children = list(self.plan.children(current))
            steps = {(str(child.kind), child.ordinal): child for child in children}
            if (tag, ordinal) not in steps:
                here = self.plan.path(current)
                inside = listed(f"{kind}[{number}]" for kind, number in steps) or "nothing"
                wrong = f"there is no {here}/{tag}[{ordinal}]"
                raise Mistake(selector.at, wrong, hint=f"{here} holds {inside}")
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

    def _empty(self, selector: PathSelector) -> Sequence[int]:
        wrong = f"there is no runner inside {short(selector)}"
        raise Mistake(selector.at, wrong, hint="name a runner, or a control that holds one")

    def _of_interface(self, selector: InterfaceSelector) -> Sequence[int]:
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
    return value_key(attribute.value) == value_key(value)


_LABELS = ("name", "id", "provider", "interface")  # compared as text: they are no parameters


def _last_line(runner: Element) -> int:
    return max([runner.line, *(attribute.line for attribute in runner.attributes)])
