"""Fields compared with definitions before anything is sent, against the judge of docs/ros.md."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gpsfsm.model.ros import Comparison, Condition, RosCall, RosKind, steps
from gpsfsm.ros import messages
from gpsfsm.ros.fields import Request, answer_misses
from tests.ros.drawn_messages import REGISTRY, readings, requests, successes
from tests.ros.judge_messages import ERROR, Message, Value, judge_fill, judge_read, judge_success
from tests.ros.test_message_lists import Made, condition

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture(autouse=True, scope="module")
def _definitions() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(messages, "definition", lambda name: lambda: Made(name.replace("/msg/", "/")))
        yield


def looked_at(name: str, request: Message, later: dict[str, str] | None = None) -> Request:
    """The request of a call; ``later`` are the parameters of entries that come with the run."""
    later = later or {}
    entries: Any = {path: each for path, each in request.items() if each is not None}
    entries |= {path: f"${parameter}" for path, parameter in later.items()}
    call = RosCall(RosKind.SERVICE, request=tuple(entries.items()))
    return Request(lambda: Made(name), call, {}, set(later.values()))


@given(requests())
def test_a_request_has_misses_where_the_page_refuses_it(drawn: tuple[str, Message]) -> None:
    name, request = drawn
    looked, filled = looked_at(name, request), judge_fill(REGISTRY, name, request)
    assert bool(looked.misses) == (filled is None), looked.misses
    if filled is not None:
        assert looked.message.plain() == filled


_POOL: list[Value] = [0, 1.5, True, "a", [1], [1, 2], [True], ["a"], [[1]], [[1], [2]], [["a"]]]


@given(requests(), st.integers(0, 9))
def test_nothing_that_could_still_be_filled_is_a_miss(
    drawn: tuple[str, Message], place: int
) -> None:
    name, request = drawn
    assume(request)
    path = [*request][place % len(request)]
    others = {each: value for each, value in request.items() if each != path}
    looked = looked_at(name, others, {path: "later"})
    pool = [*_POOL, request[path]]
    if any(judge_fill(REGISTRY, name, {**others, path: value}) is not None for value in pool):
        assert looked.misses == []
        assert looked.later == [path]


@given(readings())
def test_an_output_is_a_miss_where_no_message_has_it(drawn: tuple[str, Message, str]) -> None:
    name, message, path = drawn
    try:
        steps(path)
    except ValueError:
        assume(False)
    call = RosCall(RosKind.SERVICE, outputs=(("value", path),))
    if answer_misses(Made(name), call, {}):
        assert judge_read(REGISTRY, name, message, path) is ERROR


@given(successes())
def test_what_can_be_a_success_is_no_miss(
    drawn: tuple[str, Message, list[Message], dict[str, Value]],
) -> None:
    name, message, sets, parameters = drawn
    values: Any = {key: value for key, value in parameters.items() if value is not None}
    conditions = tuple(tuple(condition(*row) for row in each.items()) for each in sets)
    call = RosCall(RosKind.SERVICE, success=conditions)
    if answer_misses(Made(name), call, values) and judge_success(
        REGISTRY, name, message, sets, parameters
    ):
        fields = {field for each in conditions for field, _, _ in each}
        readable = [judge_read(REGISTRY, name, message, field) is not ERROR for field in fields]
        assert not all(readable), "only a field that no definition has is a miss all the same"


def misses(name: str, request: dict[str, Any], optional: tuple[str, ...] = ()) -> list[str]:
    call = RosCall(RosKind.SERVICE, request=tuple(request.items()), optional=optional)
    return Request(lambda: Made(name), call, {"limits": "a b"}, {"later"}).misses


def test_all_misses_come_at_once() -> None:
    request = {
        "scor": 1,
        "origin.x": "far",
        "groups[].limits": "$limits",
        "groups[].nope": "$later",
        "legs[].x": (1, 2, 3),
    }
    assert [each.split(" (")[0] for each in misses("demo/Plan", request)] == [
        "Made has no field scor",
        '"far" does not fit the field origin.x, a double',
        '"a b" does not fit the field groups[].limits, a int32',
        "Made has no field nope",
        "the lists for legs of Made differ in length, or do not fit it, a demo/Point[2]",
    ]


def test_a_list_that_nothing_fills_is_a_miss_unless_something_may_fill_it() -> None:
    nothing = misses("demo/Plan", {"groups[].label": "a"})
    assert ["nothing says how many items" in each for each in nothing] == [True]
    assert misses("demo/Plan", {"groups[].label": "a", "groups[].limits": "$later"}) == []


def test_fields_may_be_optional_and_parameters_may_have_no_value() -> None:
    assert misses("demo/Plan", {"nope": 1, "score": "$none"}, optional=("nope",)) == []


@pytest.mark.parametrize(
    ("rows", "missed"),
    [
        ([("ok", Comparison.IS, True)], ""),
        ([("ok", Comparison.IS, 1)], "success: ok is a boolean, and never == 1"),
        ([("label", Comparison.ABOVE, 1.0)], "success: label is a string, and never > 1.0"),
        ([("n", Comparison.IS, "$none")], "success: $none has no value to compare n with"),
        ([("n", Comparison.IS, "$later")], ""),
    ],
)
def test_a_condition_that_never_holds(rows: list[tuple[str, Comparison, Any]], missed: str) -> None:
    call = RosCall(RosKind.SERVICE, success=(tuple(Condition(*row) for row in rows),))
    assert answer_misses(Made("demo/Point"), call, {}, {"later"}) == [missed] * bool(missed)
