"""The alignment of two plans: which instances are of one action, and which look alike besides.

Actions of both plans get common numbers, so that equal actions have equal kinds. The normal forms
give every instance a place that does not depend on how its plan is written: where both plans have
the same form, instances at equal places are the same. Instances that begin equal parts of one
parallel are twins: they can be exchanged, so that one of them stands for all.

Example: ``A; parallel(B, B)`` in two layouts. Kinds are (0, 1, 1) in either plan, and ranks agree.
The two B are twins, represented by (0, 1, 1): of their two pairings one is enough.
With ``parallel(B, C)`` in the second plan its kinds are (0, 1, 2), and B has no twin there.
"""

from __future__ import annotations

from math import isnan
from typing import TYPE_CHECKING, NamedTuple, TypeGuard

from gpsfsm.equivalence.normal_form import Label, name_forms, normal_form
from gpsfsm.equivalence.pairs import OUTCOMES, Pair, Sides
from gpsfsm.model.plan import value_key

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.equivalence.admission import Admission
    from gpsfsm.equivalence.normal_form import Form, Name
    from gpsfsm.equivalence.pairs import Action, Behaviour
    from gpsfsm.model.plan import Value

_Numbers = tuple[tuple[int, ...], tuple[int, ...]]


def sides_of(
    first: Behaviour,
    second: Behaviour,
    *,
    tolerance: float = 0.0,
    consistent: bool = False,
    admission: Admission | None = None,
) -> Sides:
    """Both plans, ready to be played side by side; numbers of ``Sides`` depend on nothing else.

    ``tolerance``: numbers of one parameter that differ by no more are equal, and so are those that
    are linked by a chain of such. ``admission``: the assumptions.
    """
    kinds = kinds_of(first, second, tolerance)
    assert tuple(map(len, kinds)) == (len(first.actions), len(second.actions))
    last: dict[int, Pair] = {}
    for number, kind in enumerate(kinds[0]):
        last[kind] = Pair(number, -1)
    for number, kind in enumerate(kinds[1]):
        last[kind] = Pair(last.get(kind, Pair(-1, -1)).first, number)
    names = _Names()
    mine, theirs = (
        names.places_of(normal_form(behaviour.compiled, labels), len(labels))
        for behaviour, labels in zip((first, second), _labels(kinds, admission), strict=True)
    )
    if admission is not None and admission.any_tied:  # who is exchanged, is under assumptions, too
        mine, theirs = mine.without_twins(), theirs.without_twins()
    return Sides(
        first,
        second,
        kinds,
        twins=(mine.twins, theirs.twins),
        ranks=(mine.ranks, theirs.ranks),
        begins=(mine.begins, theirs.begins),
        last=last,
        consistent=consistent,
        same_form=mine.form == theirs.form,
        admission=admission,
    )


def _labels(kinds: _Numbers, admission: Admission | None) -> tuple[list[Label], list[Label]]:
    """The action of each instance, with the outcomes that it may have."""

    def label(side: int, number: int, kind: int) -> Label:
        if admission is None:
            return Label(kind)
        good, bad = (admission.permits(side, number, event) for event in OUTCOMES)
        return Label(kind, may_succeed=good, may_fail=bad)

    first, second = (
        [label(side, number, kind) for number, kind in enumerate(kinds[side])] for side in (0, 1)
    )
    return first, second


def kinds_of(first: Behaviour, second: Behaviour, tolerance: float) -> _Numbers:
    """The kind of each instance: a number that equal actions of both plans share."""
    numbers: dict[Action, int] = {}
    close = _close(first, second, tolerance) if tolerance > 0 else {}
    kinds = [
        tuple(
            numbers.setdefault(_rounded(runner.parameters, action, close), len(numbers))
            for runner, action in zip(behaviour.plan.runners, behaviour.actions, strict=True)
        )
        for behaviour in (first, second)
    ]
    return kinds[0], kinds[1]


_Close = dict[tuple[str, str], dict[float, float]]
"""Per interface and parameter the number that stands for each number."""


def _close(first: Behaviour, second: Behaviour, tolerance: float) -> _Close:
    values: dict[tuple[str, str], set[float]] = {}
    for runner in (*first.plan.runners, *second.plan.runners):
        for name, value in runner.parameters.items():
            if _is_number(value):
                values.setdefault((runner.interface, name), set()).add(value)
    close: _Close = {}
    for key, numbers in values.items():
        before = leader = None
        for number in sorted(numbers):
            if before is None or leader is None or number - before > tolerance:
                leader = number
            close.setdefault(key, {})[number] = leader
            before = number
    return close


def _is_number(value: object) -> TypeGuard[float]:
    """A number that can be compared: no Boolean, no nan."""
    if isinstance(value, float):
        return not isnan(value)
    return isinstance(value, int) and not isinstance(value, bool)


def _rounded(parameters: Mapping[str, Value], action: Action, close: _Close) -> Action:
    if not close:
        return action
    assert isinstance(action, tuple)
    interface = action[0]
    typed = sorted(parameters.items())
    return (
        interface,
        *(
            (name, value_key(close.get((interface, name), {}).get(value, value)))
            if _is_number(value)
            else (name, value_key(value))
            for name, value in typed
        ),
    )


class _Places(NamedTuple):
    """Per instance of a plan three numbers that do not depend on how it is written.

    ``form`` is the number of the whole. ``twins``: as in ``Sides``. ``ranks``: its place in the
    whole normal form, -1 for what nothing triggers. ``begins``: the largest form that begins
    with it.
    """

    form: int
    twins: tuple[int, ...]
    ranks: tuple[int, ...]
    begins: tuple[int, ...]

    def without_twins(self) -> _Places:
        return self._replace(twins=tuple(range(len(self.twins))))


class _Names:
    """The shared numbers of both plans, for equal forms and for equal places."""

    def __init__(self) -> None:
        self.forms: dict[Name, int] = {}
        self.places: dict[tuple[int, int, int], int] = {}

    def places_of(self, root: Form, size: int) -> _Places:
        """From the root inwards; a form is the first part of each that begins with it."""
        names = name_forms(root, self.forms)
        twins, ranks, begins = [-1] * size, [-1] * size, [-1] * size
        groups: dict[tuple[int, int], int] = {}
        todo = [(root, self._place(-1, 0, names[root]), names[root], -1)]
        while todo:
            form, place, begun, group = todo.pop()
            if form.instance >= 0:
                ranks[form.instance], begins[form.instance] = place, begun
                twins[form.instance] = group
            for number, part in enumerate(form.parts):
                name, mine, inside = names[part], begun, group
                if not form.ordered:
                    # those that begin equal parts of one parallel can be exchanged
                    mine, inside = name, groups.setdefault((id(form), name), len(groups))
                elif number:
                    mine, inside = name, -1
                where = self._place(place, number if form.ordered else -1, name)
                todo.append((part, where, mine, inside))
        assert len(set(begins) - {-1}) <= len(names), "instances begin forms of this plan"
        return _Places(names[root], _representatives(twins), tuple(ranks), tuple(begins))

    def _place(self, around: int, number: int, name: int) -> int:
        return self.places.setdefault((around, number, name), len(self.places))


def _representatives(groups: Sequence[int]) -> tuple[int, ...]:
    """The first instance of each group; those of no group (-1) stand for themselves."""
    first: dict[int, int] = {}
    return tuple(
        number if group < 0 else first.setdefault(group, number)
        for number, group in enumerate(groups)
    )
