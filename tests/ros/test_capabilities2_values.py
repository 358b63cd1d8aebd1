"""Parameters of capability servers: the one type that a file says, or nothing is sent."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree as ET

import pytest

from gpsfsm.execution.runner import RunnerError
from gpsfsm.model.capability import Input, Output, Parameter, Provider, ValueType
from gpsfsm.ros.capabilities2_values import Typed, as_xml, outputs, reason, typed

KINDS = {
    "flag": ValueType.BOOL,
    "x": ValueType.DOUBLE,
    "count": ValueType.INT,
    "text": ValueType.STRING,
    "flags": ValueType.BOOLS,
    "places": ValueType.DOUBLES,
    "counts": ValueType.INTS,
    "texts": ValueType.STRINGS,
    "untold": ValueType.ANY,
}
DESCRIBED = Provider(
    "demo/Runner",
    "demo/Runner",
    configuration=tuple(Parameter(name, kind) for name, kind in KINDS.items()),
    inputs=(Input("arriving", ValueType.DOUBLE),),
    outputs=tuple(Output(name, kind) for name, kind in KINDS.items()),
)


@dataclass
class Sent:
    """A CapabilityParameter."""

    key: str
    type: int
    value: list[str]


@pytest.mark.parametrize(
    ("name", "value", "code", "texts"),
    [
        ("flag", True, 0, ("true",)),
        ("x", 1, 1, ("1.0",)),
        ("x", -0.1234567890123, 1, ("-0.1234567890123",)),
        ("x", 5e-324, 1, ("0.0",)),  # std::stod would throw
        ("arriving", 2, 1, ("2.0",)),
        ("count", 3.0, 2, ("3",)),
        ("count", -(2**31), 2, ("-2147483648",)),
        ("text", "true", 3, ("true",)),
        ("text", "", 3, ("",)),
        ("flags", [True, False], 5, ("true", "false")),
        ("places", [1, 2.5], 6, ("1.0", "2.5")),
        ("counts", [], 7, ()),
        ("texts", ["a", "b"], 8, ("a", "b")),
    ],
)
def test_a_parameter_goes_as_its_file_says(
    name: str, value: object, code: int, texts: tuple[str, ...]
) -> None:
    assert typed(DESCRIBED, {name: value}) == [Typed(name, code, texts)]  # type: ignore[dict-item]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("flag", 1),
        ("flag", "true"),
        ("x", True),
        ("x", "1"),
        ("x", float("inf")),
        ("count", 1.5),
        ("count", 2**31),  # std::stoi would throw
        ("text", 3),
        ("text", "a\0b"),
        ("text", "\ud800"),
        ("x", 10**400),
        ("count", float("inf")),
        ("count", float("nan")),
        ("places", 1.0),
        ("places", ["1"]),
        ("texts", "a"),
    ],
)
def test_a_value_that_would_end_the_server_is_refused(name: str, value: object) -> None:
    with pytest.raises(RunnerError, match="which would end at it"):
        typed(DESCRIBED, {name: value})  # type: ignore[dict-item]


@pytest.mark.parametrize("name", ["untold", "unheard"])
def test_a_parameter_without_a_type_is_refused(name: str) -> None:
    with pytest.raises(RunnerError, match=f"does not say which type '{name}' has"):
        typed(DESCRIBED, {name: 1})


def test_v1_takes_them_as_attributes_whatever_is_in_them() -> None:
    text = as_xml("a/B", "c/D", [Typed("text", 3, ("\"<&>'\n",)), Typed("x", 1, ("1.0",))])
    element = ET.fromstring(text)  # noqa: S314  (of our own making)
    assert element.tag == "Runner"
    expected = {"interface": "a/B", "provider": "c/D", "text": "\"<&>'\n", "x": "1.0"}
    assert element.attrib == expected


def test_outputs_have_the_types_that_are_declared_whatever_code_comes() -> None:
    sent = [
        Sent("x", 3, ["1.500000"]),
        Sent("flags", 4, ["true", "no"]),  # as the constants of the message count
        Sent("counts", 7, ["1", "2"]),
        Sent("untold", 8, ["a", "b"]),
        Sent("text", 3, ["hello"]),
        Sent("count", 2, []),
        Sent("undeclared", 3, ["secret"]),
    ]
    assert outputs(DESCRIBED, sent) == {
        "x": 1.5,
        "flags": [True, False],
        "counts": [1, 2],
        "untold": ["a", "b"],
        "text": "hello",
    }


@pytest.mark.parametrize(("name", "text"), [("x", "nan"), ("x", "one"), ("count", "1.5")])
def test_an_output_that_is_none_is_a_failure(name: str, text: str) -> None:
    with pytest.raises(RunnerError, match=f"hands over .* for '{name}'"):
        outputs(DESCRIBED, [Sent(name, 3, [text])])


def test_outputs_are_bounded() -> None:
    with pytest.raises(RunnerError, match="too long"):
        outputs(DESCRIBED, [Sent("text", 3, ["x" * 1_000_001])])


def test_the_reason_of_a_failure_is_its_message() -> None:
    assert reason([Sent("x", 1, ["1"]), Sent("message", 3, ["no way"])]) == "no way"
    assert reason([Sent("message", 3, [])]) == ""
