"""Equality of actions (semantics, section 4)."""

from __future__ import annotations

import itertools
from fractions import Fraction
from math import inf, isfinite, isnan, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.model.plan import Attribute, Element, Kind, Value
from gpsfsm.syntax import parse

Attributes = dict[str, Value]

# Few, so that equal ones occur; no two nan are the same object.
VALUES: tuple[Value, ...] = (
    True,
    False,
    0,
    1,
    -1,
    0.0,
    -0.0,
    1.0,
    0.5,
    2**53,
    2**53 + 1,
    2.0**53,
    2**63 - 1,
    2.0**63,
    inf,
    -inf,
    nan,
    -nan,
    float("nan"),
    "",
    "1",
    "true",
    "nan",
    "None",
)
LABELS = ("name", "id", "provider")


def runner(interface: str, attributes: Attributes) -> Element:
    value: Attributes = {"interface": interface, **attributes}
    return Element(
        index=1,
        kind=Kind.RUNNER,
        parent=0,
        ordinal=1,
        children=(),
        attributes=tuple(Attribute(name, str(v), v, 1, 1) for name, v in value.items()),
        line=1,
        column=1,
        start=0,
        end=0,
    )


def same_value(one: Value, two: Value) -> bool:
    """The definition, case by case, and without Python's equality of different types."""
    if isinstance(one, bool) or isinstance(two, bool):
        return isinstance(one, bool) and isinstance(two, bool) and str(one) == str(two)
    if isinstance(one, str) or isinstance(two, str):
        return isinstance(one, str) and isinstance(two, str) and one == two
    if isfinite(one) and isfinite(two):
        return Fraction(one) == Fraction(two)
    if isnan(one) or isnan(two):
        return isnan(one) and isnan(two)
    return not isfinite(one) and not isfinite(two) and (one > 0) == (two > 0)


def same_action(one: tuple[str, Attributes], two: tuple[str, Attributes]) -> bool:
    mine, yours = (
        {name: value for name, value in attributes.items() if name not in LABELS}
        for _, attributes in (one, two)
    )
    return (
        one[0] == two[0]
        and mine.keys() == yours.keys()
        and all(same_value(mine[name], yours[name]) for name in mine)
    )


VALUE = st.sampled_from(VALUES)
ATTRIBUTES = st.dictionaries(st.sampled_from(["x", "y", *LABELS]), VALUE, max_size=4)
ACTIONS = st.tuples(st.sampled_from(["a/GoRunner", "b/GoRunner"]), ATTRIBUTES)


@pytest.mark.parametrize(("one", "two"), list(itertools.product(VALUES, repeat=2)), ids=repr)
def test_a_parameter_makes_actions_equal_exactly_for_equal_values(one: Value, two: Value) -> None:
    first, second = (runner("a/GoRunner", {"x": value}).action for value in (one, two))
    assert (first == second) is same_value(one, two)
    assert len({first, second}) == 2 - same_value(one, two)


@given(ACTIONS, ACTIONS)
def test_actions_are_equal_exactly_where_the_definition_says_so(
    one: tuple[str, Attributes], two: tuple[str, Attributes]
) -> None:
    first, second = runner(*one).action, runner(*two).action
    assert (first == second) is same_action(one, two)
    assert len({first, second}) == 2 - same_action(one, two)


@given(ACTIONS, st.data())
def test_the_order_of_attributes_and_all_labels_are_ignored(
    action: tuple[str, Attributes], data: st.DataObject
) -> None:
    interface, attributes = action
    values = {
        name: data.draw(st.sampled_from([other for other in VALUES if same_value(value, other)]))
        for name, value in attributes.items()
        if name not in LABELS
    }
    labels = data.draw(st.dictionaries(st.sampled_from(LABELS), VALUE))
    shuffled = dict(data.draw(st.permutations([*values.items(), *labels.items()])))
    assert runner(interface, shuffled).action == runner(interface, attributes).action


@given(ACTIONS, st.sampled_from(["x", "y"]), VALUE)
def test_one_other_value_makes_another_action(
    action: tuple[str, Attributes], name: str, value: Value
) -> None:
    interface, attributes = action
    same = name in attributes and same_value(attributes[name], value)
    changed = runner(interface, {**attributes, name: value})
    assert (changed.action == runner(interface, attributes).action) is same


def test_spellings_of_nan_in_a_plan_are_equal() -> None:
    tags = (f'<Runner interface="a/Go" provider="a/Go" x="{x}"/>' for x in ("nan", "NaN", "nano"))
    plan = parse(f"<Plan>{''.join(tags)}</Plan>").plan
    assert plan is not None
    first, second, third = (element.action for element in plan.runners)
    assert first == second != third
