"""Requests and answers with lists, against a judge that was written from docs/ros.md alone."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
from hypothesis import assume, given

from gpsfsm.model.ros import Comparison, Condition, steps
from gpsfsm.ros import messages
from gpsfsm.ros.messages import fill, value_at
from gpsfsm.ros.node import RosError
from gpsfsm.ros.runner import unmet
from tests.ros.drawn_messages import REGISTRY, readings, requests, successes
from tests.ros.judge_messages import (
    ABSENT,
    ERROR,
    Message,
    Value,
    default_message,
    judge_fill,
    judge_read,
    judge_success,
    kind_of,
)


class Made:
    """A message like one of a generated class."""

    def __init__(self, name: str, values: Message | None = None) -> None:
        self._name = name
        for field, value in (default_message(REGISTRY, name) if values is None else values).items():
            item = kind_of(REGISTRY[name][field]).item
            setattr(self, field, of_kind(item, value))

    def get_fields_and_field_types(self) -> dict[str, str]:
        return REGISTRY[self._name]

    def plain(self) -> Message:
        return {field: plain(getattr(self, field)) for field in REGISTRY[self._name]}


def of_kind(item: str, value: Any) -> Any:
    if isinstance(value, list):
        return [of_kind(item, each) for each in value]
    return Made(item, value) if "/" in item else value


def plain(value: Any) -> Any:
    if isinstance(value, list):
        return [plain(each) for each in value]
    return value.plain() if isinstance(value, Made) else value


@pytest.fixture(autouse=True, scope="module")
def _definitions() -> Any:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(messages, "definition", lambda name: lambda: Made(name.replace("/msg/", "/")))
        yield


@given(requests())
def test_a_request_is_filled_as_the_page_says_or_refused(drawn: tuple[str, Message]) -> None:
    name, request = drawn
    message = Made(name)
    try:
        fill(message, {path: value for path, value in request.items() if value is not None})  # type: ignore[misc]
    except (RosError, ValueError):  # the reader of the file refuses what is no path
        filled = None
    else:
        filled = message.plain()
    assert filled == judge_fill(REGISTRY, name, request)


@given(readings())
def test_what_is_read_is_what_the_page_says(drawn: tuple[str, Message, str]) -> None:
    name, message, path = drawn
    judged = judge_read(REGISTRY, name, message, path)
    try:
        read = value_at(Made(name, message), path)
    except (RosError, ValueError):
        assert judged is ERROR
        return
    if isinstance(judged, dict):
        assert json.loads(str(read)) == judged
    else:
        assert (ABSENT if read is None else read) == judged


_COMPARED = re.compile(r"([<>]=?|[!=]=)\s*(.*)")


def condition(field: str, wanted: Any) -> Condition:
    """The condition as the reader of the file makes it, which refuses what is no path or value."""
    assume(not isinstance(wanted, list) and wanted is not None)
    try:
        steps(field)
    except ValueError:
        assume(False)
    match = _COMPARED.fullmatch(wanted) if isinstance(wanted, str) else None
    if match is None:
        return Condition(field, Comparison.IS, wanted)
    assume(match[2].startswith("$") or match[2].replace(".", "").isdigit())
    operand = match[2] if match[2].startswith("$") else float(match[2])
    return Condition(field, Comparison(match[1]), operand)


@given(successes())
def test_an_answer_counts_as_a_success_as_the_page_says(
    drawn: tuple[str, Message, list[Message], dict[str, Value]],
) -> None:
    name, message, sets, parameters = drawn
    made = Made(name, message)
    values: Any = {key: value for key, value in parameters.items() if value is not None}
    conditions = [tuple(condition(*row) for row in each.items()) for each in sets]
    holds = not all(unmet(made, each, values) for each in conditions)
    assert holds == judge_success(REGISTRY, name, message, sets, parameters)
