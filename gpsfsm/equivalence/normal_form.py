"""The normal form of a plan: its tree, less what no observer can see of it.

Every rewrite keeps, for each instance that some run triggers, the set of outcomes that triggers it,
and those that end the run (semantics, 3.3). So plans of one normal form do the same: an isomorphism
pairs their instances. Plans of different forms may do the same, too. docs/tasks.md lists the
rewrites.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.compile import UnitKind

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from gpsfsm.compile import Compiled
    from gpsfsm.compile.units import Units


class Shape(IntEnum):
    """The kind of a form.

    DONE succeeds at the instant of its trigger and LOST fails then. FAILS_IF is an action whose
    success is a failure, and the other way round. FALLBACK is a guard: the next part runs where
    the one before has failed. COUNT is a parallel that needs ``Form.value`` successes.
    """

    DONE = 0
    LOST = 1
    ACTION = 2
    FAILS_IF = 3
    SEQUENCE = 4
    FALLBACK = 5
    ALL = 6
    ANY = 7
    COUNT = 8
    BRANCH = 9
    WAIT = 10


_DUAL = {
    Shape.DONE: Shape.LOST,
    Shape.ACTION: Shape.FAILS_IF,
    Shape.SEQUENCE: Shape.FALLBACK,
    Shape.FALLBACK: Shape.SEQUENCE,
    Shape.ALL: Shape.ANY,
    Shape.ANY: Shape.ALL,
    Shape.COUNT: Shape.COUNT,
    Shape.BRANCH: Shape.BRANCH,
    Shape.WAIT: Shape.WAIT,
}
_SHAPES = {
    UnitKind.RUNNER: Shape.ACTION,
    UnitKind.EMPTY: Shape.DONE,
    UnitKind.SEQUENCE: Shape.SEQUENCE,
    UnitKind.GUARD: Shape.FALLBACK,
    UnitKind.ALL: Shape.ALL,
    UnitKind.ANY: Shape.ANY,
    UnitKind.COUNT: Shape.COUNT,
    UnitKind.BRANCH: Shape.BRANCH,
    UnitKind.WAIT: Shape.WAIT,
}
_UNORDERED = frozenset({Shape.ALL, Shape.ANY, Shape.COUNT, Shape.WAIT})


class Label(NamedTuple):
    """An instance by a number, equal for equal actions, and its outcomes."""

    kind: int
    may_succeed: bool = True
    may_fail: bool = True


@dataclass(slots=True, eq=False)
class Form:
    """A node of the normal form.

    ``value`` is the kind of an action, or what COUNT or WAIT needs; ``instance`` the number of an
    action's instance. ``may_succeed`` and ``may_fail``: some outcomes, if any, make it do so.
    """

    shape: Shape
    parts: deque[Form] = field(default_factory=deque)
    value: int = 0
    instance: int = -1
    may_succeed: bool = True
    may_fail: bool = True

    @property
    def ordered(self) -> bool:
        """True if the order of the parts matters."""
        return self.shape not in _UNORDERED


def normal_form(compiled: Compiled, labels: Sequence[Label]) -> Form:
    """The normal form of a plan, a label per instance. Linear but for a logarithm.

    Instances that no run triggers may be missing.
    """
    units = compiled.units
    numbers = {runner.index: n for n, runner in enumerate(compiled.automaton.plan.runners)}
    negative = _negative(units)
    forms: list[Form | None] = [None] * len(units)
    for unit in reversed(range(len(units))):  # every parent comes before its children
        turned = negative[unit]
        if turned is None:
            continue
        parts = [form for child in units.children[unit] if (form := forms[child]) is not None]
        kind = units.kinds[unit]
        if kind is UnitKind.NOT:
            forms[unit] = parts[0]
            continue
        shape = _DUAL[_SHAPES[kind]] if turned else _SHAPES[kind]
        if kind is UnitKind.RUNNER:
            number = numbers[units.elements[unit]]
            kind_of, good, bad = labels[number]
            good, bad = (bad, good) if turned else (good, bad)
            forms[unit] = Form(shape, deque(), kind_of, number, good, bad)
        elif kind in (UnitKind.COUNT, UnitKind.WAIT):
            need = units.needs[unit]
            counted = _count if kind is UnitKind.COUNT else _wait
            forms[unit] = counted(parts, len(parts) - need + 1 if turned else need)
        else:
            forms[unit] = _made(shape, parts)
    root = forms[0]
    assert root is not None
    return root


def _negative(units: Units) -> list[bool | None]:
    """Per unit whether an odd number of inversions is around it; None: nothing triggers it.

    An inversion moves inwards and turns every control into its dual. What decides a BRANCH of two
    ends stays: either end is inverted instead.
    """
    negative: list[bool | None] = [None] * len(units)
    negative[0] = False
    for unit, kind in enumerate(units.kinds):
        here = negative[unit]
        if here is None:
            continue
        children = units.children[unit]
        for child in children:
            negative[child] = here != (kind is UnitKind.NOT)
        if kind is UnitKind.BRANCH and len(children) > 2:
            negative[children[0]] = False
    return negative


def _made(shape: Shape, parts: list[Form]) -> Form:
    if shape in (Shape.DONE, Shape.LOST):
        return _constant(shape)
    if shape is Shape.BRANCH:
        # without a second end it fails where its condition fails, as a sequence does
        return _branch(*parts) if len(parts) > 2 else _chain(Shape.SEQUENCE, parts)
    if shape in (Shape.ALL, Shape.ANY):
        return _parallel(shape, parts)
    return _chain(shape, parts)


def _constant(shape: Shape) -> Form:
    return Form(shape, may_succeed=shape is Shape.DONE, may_fail=shape is Shape.LOST)


def _chain(shape: Shape, parts: Iterable[Form]) -> Form:
    """Parts that run one after the other, in a SEQUENCE or a FALLBACK."""
    sequence = shape is Shape.SEQUENCE
    neutral = Shape.DONE if sequence else Shape.LOST
    forms: deque[Form] = deque()
    for part in parts:
        if part.shape is neutral:
            continue
        forms = _joined(forms, part.parts if part.shape is shape else deque((part,)))
        if not (part.may_succeed if sequence else part.may_fail):
            break  # nothing triggers what comes behind it
    if len(forms) < 2:
        return forms[0] if forms else _constant(neutral)
    if sequence:
        may_fail = any(part.may_fail for part in forms)
        return Form(shape, forms, may_succeed=forms[-1].may_succeed, may_fail=may_fail)
    may_succeed = any(part.may_succeed for part in forms)
    return Form(shape, forms, may_succeed=may_succeed, may_fail=forms[-1].may_fail)


def _parallel(shape: Shape, parts: Iterable[Form]) -> Form:
    """ALL or ANY."""
    every = shape is Shape.ALL
    neutral, final = (Shape.DONE, Shape.LOST) if every else (Shape.LOST, Shape.DONE)
    forms: deque[Form] = deque()
    decided = False  # by a part that ends at once
    for part in parts:
        inside = part.parts if part.shape is shape else deque((part,))
        if inside[0].shape is final:  # kept first, and once
            decided = True
            inside.popleft()
        if part.shape is not neutral:
            forms = _joined(forms, inside)
    if decided:
        forms.appendleft(_constant(final))
    if len(forms) < 2:
        return forms[0] if forms else _constant(neutral)
    succeed, fail = ((part.may_succeed for part in forms), (part.may_fail for part in forms))
    if every:
        return Form(shape, forms, may_succeed=all(succeed), may_fail=any(fail))
    return Form(shape, forms, may_succeed=any(succeed), may_fail=all(fail))


def _count(parts: Sequence[Form], need: int) -> Form:
    """A parallel of which ``need`` must succeed: less what ends at once."""
    left = [part for part in parts if part.shape not in (Shape.DONE, Shape.LOST)]
    need -= sum(part.shape is Shape.DONE for part in parts)
    spare = len(left) - need + 1  # so many failures are its failure
    if need <= 0:
        return _parallel(Shape.ANY, (_constant(Shape.DONE), *left))
    if spare <= 0:
        return _parallel(Shape.ALL, (_constant(Shape.LOST), *left))
    if need == 1 or spare == 1:
        return _parallel(Shape.ANY if need == 1 else Shape.ALL, left)
    may_succeed = sum(part.may_succeed for part in left) >= need
    may_fail = sum(part.may_fail for part in left) >= spare
    return Form(Shape.COUNT, deque(left), need, may_succeed=may_succeed, may_fail=may_fail)


def _wait(parts: Sequence[Form], need: int) -> Form:
    """The same where it ends with its last part."""
    if len(parts) == 1:
        return parts[0]
    may_succeed = sum(part.may_succeed for part in parts) >= need
    may_fail = sum(part.may_fail for part in parts) > len(parts) - need
    return Form(Shape.WAIT, deque(parts), need, may_succeed=may_succeed, may_fail=may_fail)


def _branch(condition: Form, then: Form, otherwise: Form) -> Form:
    """The condition decides which end runs."""
    if condition.shape is Shape.FAILS_IF:
        good, bad = condition.may_fail, condition.may_succeed
        condition = Form(Shape.ACTION, deque(), condition.value, condition.instance, good, bad)
        then, otherwise = otherwise, then
    if not condition.may_fail or otherwise.shape is Shape.LOST:
        return _chain(Shape.SEQUENCE, (condition, then))
    if not condition.may_succeed or then.shape is Shape.DONE:
        return _chain(Shape.FALLBACK, (condition, otherwise))
    return Form(
        Shape.BRANCH,
        deque((condition, then, otherwise)),
        may_succeed=then.may_succeed or otherwise.may_succeed,
        may_fail=then.may_fail or otherwise.may_fail,
    )


def _joined(one: deque[Form], other: deque[Form]) -> deque[Form]:
    """Both, in this order; the longer one is kept, so that deep nesting costs little."""
    if len(one) >= len(other):
        one.extend(other)
        return one
    other.extendleft(reversed(one))
    return other


Name = tuple[Shape, int, bool, bool, tuple[int, ...]]


def name_forms(root: Form, numbers: dict[Name, int]) -> dict[Form, int]:
    """A number for each node: equal for equal forms, if ``numbers`` is shared.

    The parts of parallel forms are put into the order of their numbers.
    """
    order = [root]
    for form in order:
        order.extend(form.parts)
    names: dict[Form, int] = {}
    for form in reversed(order):
        if not form.ordered:
            form.parts = deque(sorted(form.parts, key=names.__getitem__))
        inside = tuple(names[part] for part in form.parts)
        name = form.shape, form.value, form.may_succeed, form.may_fail, inside
        names[form] = numbers.setdefault(name, len(numbers))
    return names


def one_form(
    plans: tuple[Compiled, Compiled], labels: tuple[Sequence[Label], Sequence[Label]]
) -> bool:
    """True if two plans have one normal form: then they do the same."""
    numbers: dict[Name, int] = {}
    names = []
    for compiled, mine in zip(plans, labels, strict=True):
        root = normal_form(compiled, mine)
        names.append(name_forms(root, numbers)[root])
    return names[0] == names[1]
