"""What is known about a runner instance, where its parameters decide."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import pytest

from gpsfsm.capabilities.library import Library
from gpsfsm.model.capability import (
    MAX_AMOUNT,
    Binding,
    Input,
    Interface,
    Outcomes,
    Parameter,
    Provider,
    Span,
    ValueType,
)
from tests.support import plan_of

FORCE = Parameter("force", aliases=("strength",), default=2.0)
GRASP = Provider(
    "arm/Grasp",
    "arm/Grasp",
    described=True,
    configuration=(FORCE, Parameter("speed")),
    inputs=(Input("object", aliases=("thing",)),),
)


def of(provider: Provider, attributes: str = "") -> Binding:
    """The binding of a runner with these attributes."""
    library = Library(interfaces=(Interface("arm/Grasp"),), providers=(provider,))
    plan = plan_of(
        f'<Plan><Runner interface="arm/Grasp" provider="arm/Grasp" {attributes}/></Plan>'
    )
    binding = library.bind(plan.runners[0])
    assert binding is not None
    return binding


def test_parameters_are_found_by_alias_and_inputs_are_not() -> None:
    assert GRASP.parameter("force") is GRASP.parameter("strength") is FORCE
    assert GRASP.parameter("object") is None
    assert GRASP.input("object") is GRASP.inputs[0]
    assert GRASP.input("thing") is None


def test_a_value_is_what_the_plan_writes_else_the_default() -> None:
    binding = of(GRASP, 'strength="3" colour="red"')
    assert [binding.value(name) for name in ("force", "colour", "speed", "gone")] == [
        3,
        "red",
        None,
        None,
    ]
    assert of(GRASP).value("force") == 2.0


@pytest.mark.parametrize(
    ("attributes", "holds"),
    [
        ("", True),
        ('flush="false"', True),
        ('flush="true"', False),
        ('flush="1"', True),
        ('send="true"', False),
        ('mode="fast"', False),
        ('mode="slow"', True),
        ('force="3"', False),
        ('force="3.0"', False),
        ('force="4"', True),
    ],
)
def test_never_fails_unless(attributes: str, holds: bool) -> None:
    unless = (("flush", True), ("mode", "fast"), ("force", 3))
    provider = replace(
        GRASP,
        configuration=(Parameter("flush", aliases=("send",)), Parameter("mode"), FORCE),
        outcomes=Outcomes(never_fails=True, unless=unless),
    )
    assert of(provider, attributes).never_fails is holds


def test_never_fails_unless_the_default_says_so() -> None:
    flush = Parameter("flush", default=True)
    outcomes = Outcomes(never_fails=True, unless=(("flush", True),))
    provider = replace(GRASP, configuration=(flush,), outcomes=outcomes)
    assert not of(provider).never_fails
    assert of(provider, 'flush="false"').never_fails


def test_what_is_not_declared_never_fails_is_not() -> None:
    assert not of(GRASP).never_fails


@pytest.mark.parametrize(
    ("attributes", "span"),
    [
        ('seconds="4"', (4.0, 4.0)),
        ('seconds="0"', (0.0, 0.0)),
        ("", (0.0, inf)),
        ('seconds="-1"', (0.0, inf)),
        ('seconds="soon"', (0.0, inf)),
        ('seconds="true"', (0.0, inf)),
        ('seconds="9.9e11"', (9.9e11, 9.9e11)),
        ('seconds="1e12"', (MAX_AMOUNT, inf)),
        ('seconds="1e308"', (MAX_AMOUNT, inf)),
        ('seconds="9223372036854775807"', (MAX_AMOUNT, inf)),
    ],
)
def test_amounts_may_be_those_of_parameters(attributes: str, span: tuple[float, float]) -> None:
    amount = Span("seconds", "seconds")
    binding = of(replace(GRASP, duration=amount, energy=amount), attributes)
    assert binding.duration == binding.energy == span


def test_amounts_without_a_greatest_one_are_unbounded() -> None:
    binding = of(replace(GRASP, duration=Span(2.5), energy=Span(3, 1)))
    assert binding.duration == (2.5, inf)
    assert binding.energy == (3.0, 3.0)  # never less at most than at least
    assert of(GRASP).duration is of(GRASP).energy is None


def test_amounts_beyond_all_measure() -> None:
    binding = of(replace(GRASP, duration=Span(1, 1e308), energy=Span(1e13, 5)))
    assert binding.duration == (1.0, inf)
    assert binding.energy == (MAX_AMOUNT, inf)


SAYS = replace(
    GRASP,
    configuration=(
        Parameter("t", ValueType.STRING),
        Parameter("text", ValueType.STRING),
        Parameter("n", ValueType.INT),
        Parameter("free"),
        Parameter("size", ValueType.DOUBLE, default=3),
        Parameter("uuid", ValueType.STRING, default="u"),
    ),
    inputs=(
        Input("text", ValueType.STRING, fallback="t"),
        Input("said", fallback="free"),
        Input("open"),
        Input("wide", ValueType.DOUBLE, fallback="n"),
        Input("uuid", ValueType.STRING, fallback="t"),
    ),
)


@pytest.mark.parametrize(
    ("attributes", "name", "readings"),
    [
        ('text="1"', "text", ("1",)),
        ('t="1"', "text", ("1",)),  # what stands in is a text, too
        ('t="true"', "text", ("true",)),
        ("", "text", ()),
        ('n="07"', "n", (7,)),
        ('n="7"', "wide", (7.0,)),
        ('free="01"', "free", ("01", 1)),  # no type: a run hands over the text
        ('free="01"', "said", ("01", 1)),
        ('open="01"', "open", (1, "01")),
        ('open="word"', "open", ("word",)),
        ("", "size", (3.0,)),
        ("", "uuid", ("u",)),
        ('t="01"', "uuid", ("01",)),
        ('other="01"', "other", (1, "01")),
    ],
)
def test_how_a_value_is_read(attributes: str, name: str, readings: tuple[object, ...]) -> None:
    binding = of(SAYS, attributes)
    assert binding.readings(name) == readings
    assert [type(each) for each in binding.readings(name)] == [type(each) for each in readings]
    assert binding.worked_with(name) == (readings[0] if readings else None)


@pytest.mark.parametrize(
    ("attributes", "holds"),
    [
        ('t="1"', False),
        ('t="01"', True),
        ('text="1"', False),
        ('t="1" text="2"', True),
        ('free="1"', False),
        ('free="1.0"', False),
        ('free="2"', True),
    ],
)
def test_a_text_that_stands_in_is_compared_as_it_is_written(attributes: str, holds: bool) -> None:
    unless = (("text", "1"), ("free", 1))
    provider = replace(SAYS, outcomes=Outcomes(never_fails=True, unless=unless))
    assert of(provider, attributes).never_fails is holds


def test_a_text_is_no_amount() -> None:
    timed = replace(SAYS, duration=Span("text", "text"), energy=Span("wide", "wide"))
    assert of(timed, 't="4" n="4"').duration == (0.0, inf)
    assert of(timed, 't="4" n="4"').energy == (4.0, 4.0)
