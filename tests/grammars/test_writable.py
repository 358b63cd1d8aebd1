"""Which runners and parameters a grammar allows, and which shipped files there are."""

from __future__ import annotations

from typing import Any

import pytest

from gpsfsm.capabilities.library import EMPTY, Capabilities, Library, builtin_capabilities
from gpsfsm.errors import UsageError
from gpsfsm.generation.language_model import Constraint
from gpsfsm.grammars import DEPTH, Alphabet, alphabet, find_format, format_names, grammars_for
from gpsfsm.grammars.forms import Form, FormKind
from gpsfsm.model.capability import Input, Interface, Output, Parameter, Provider, Source, ValueType
from tests.conftest import REPO

UP, FILE, OUTSIDE = Source.UPSTREAM, Source.CONFIGURATION, Source.EXTERNAL


def library(*parameters: Parameter, inputs: tuple[Input, ...] = (), gives: str = "") -> Library:
    go = Provider("demo/Go", "demo/Go", described=True, configuration=parameters, inputs=inputs)
    look = Provider("demo/Look", "demo/Look", described=True, outputs=(Output(gives or "seen"),))
    return Library((Interface("demo/Go"), Interface("demo/Look")), (go, look))


def slots(described: Library) -> dict[str, bool]:
    """The parameters of demo/Go that can be written, and whether they must."""
    first = next(each for each in alphabet(described).runners if each.interface == "demo/Go")
    return {slot.name: slot.required for slot in first.slots}


def left_out(words: Alphabet) -> dict[str, str]:
    return {each.name: each.why for each in words.left_out}


def need(name: str, **more: Any) -> Parameter:
    return Parameter(name, required=True, **more)


@pytest.mark.parametrize(
    ("sources", "gives", "required"),
    [
        ((UP, FILE), "", True),
        ((UP, FILE), "text", False),
        ((UP, OUTSIDE), "text", False),
        ((FILE,), "text", True),
        ((UP,), "text", False),
        ((), "", False),
    ],
)
def test_what_can_arrive_may_be_left_out(
    sources: tuple[Source, ...], gives: str, required: bool
) -> None:
    expected = Input("text", required=True, satisfiable_from=sources)
    capabilities = library(need("text"), inputs=(expected,), gives=gives)
    assert slots(capabilities) == {"text": required}


def test_required_and_optional_parameters() -> None:
    capabilities = library(
        need("a"), Parameter("b"), need("c", default=1), Parameter("d", default=2)
    )
    assert slots(capabilities) == {"a": True, "b": False, "c": False, "d": False}


def test_inputs_that_a_plan_may_write() -> None:
    inputs = (
        Input("a", required=True, satisfiable_from=(OUTSIDE,)),
        Input("b", satisfiable_from=(FILE,)),
        Input("c", required=True),
    )
    assert slots(library(inputs=inputs)) == {"a": True, "b": False}


def test_an_alias_stands_in_for_a_name_that_no_plan_can_write() -> None:
    assert slots(library(need("name", aliases=("id", "title")))) == {"title": True}
    assert slots(library(Parameter("a b"), Parameter("xml:id"), Parameter("p"))) == {"p": False}


@pytest.mark.parametrize(
    "parameter",
    [
        need("name"),
        need("a b"),
        need("x", type=ValueType.DOUBLE, minimum=1e300),
        need("x", choices=("$a", "\x01")),
        need("x", type=ValueType.INT, choices=("a", "1.5")),
        need("x", type=ValueType.INT, minimum=2, choices=("1",)),
        need("x", minimum=float("inf")),
    ],
    ids=str,
)
def test_runners_that_cannot_be_written(parameter: Parameter) -> None:
    words = alphabet(library(parameter))
    assert [each.interface for each in words.runners] == ["demo/Look"]
    assert left_out(words) == {
        "demo/Go": f"nothing can be written for its parameter '{parameter.name}'"
    }


def test_a_parameter_hidden_behind_an_alias_of_another_one() -> None:
    words = alphabet(library(Parameter("text", aliases=("x",)), need("x")))
    assert "demo/Go" in left_out(words)


def test_choices_are_those_that_the_check_allows() -> None:
    mixed = Parameter("x", ValueType.DOUBLE, minimum=0, choices=("1", "-1", "a", "nan", "0.5"))
    (go,) = (each for each in alphabet(library(mixed)).runners if each.slots)
    assert go.slots[0].form == Form(FormKind.CHOICE, choices=("1", "0.5"))


def test_why_runners_are_left_out() -> None:
    names = ("a/Old", "a/FabricCompletionRunner", "a/Dumb", "a/None", "a/\x1b", "a/Good", "a/Age")
    interfaces = [Interface(name, deprecated="x" if name == "a/Old" else "") for name in names]
    providers = [
        Provider(name, name, described=name != "a/Dumb", deprecated="x" if name == "a/Age" else "")
        for name in names
        if name != "a/None"
    ]
    words = alphabet(Library(tuple(interfaces), tuple(providers)))
    assert [each.interface for each in words.runners] == ["a/Good"]
    assert left_out(words) == {
        "a/Old": "it is deprecated",
        "a/FabricCompletionRunner": "a plan completes by itself",
        "a/Dumb": "its file does not say which parameters there are",
        "a/None": "no provider of it is described",
        "a/\x1b": "its name cannot be written",
        "a/Age": "its provider is deprecated",
    }


def test_only_some() -> None:
    described = builtin_capabilities().library

    def names(*only: str) -> list[str]:
        return [each.interface for each in alphabet(described, only).runners]

    assert names("nav2_capabilities/*") == [
        "nav2_capabilities/OccupancyGridRunner",
        "nav2_capabilities/RobotPoseRunner",
        "nav2_capabilities/WaypointRunner",
        "nav2_capabilities/WaypointYawRunner",
    ]
    assert names("WaitRunner", "generic_capabilities/Log*") == [
        "generic_capabilities/LogRunner",
        "generic_capabilities/WaitRunner",
    ]
    # where nothing can hand them over, the coordinates are needed
    (waypoint,) = alphabet(described, ["WaypointRunner"]).runners
    assert [slot.name for slot in waypoint.slots if slot.required] == ["x", "y"]


@pytest.mark.parametrize(
    ("capabilities", "only", "message"),
    [
        (builtin_capabilities(), ["nav3/*"], "no capability matches 'nav3/*'; 'gpsfsm capab"),
        (builtin_capabilities(), ["\x1b*"], r"no capability matches '\x1b*'; 'gpsfsm capabil"),
        (EMPTY, None, "there is no capability, so there is no plan that a grammar could allow"),
        (
            builtin_capabilities(),
            ["FabricCompletionRunner"],
            "a grammar can allow none of the capabilities: "
            "fabric_capabilities/FabricCompletionRunner is left out, because a plan completes",
        ),
    ],
    ids=range(4),
)
def test_nothing_to_allow(capabilities: Capabilities, only: list[str] | None, message: str) -> None:
    with pytest.raises(UsageError) as caught:
        grammars_for(capabilities, only=only)
    assert message in str(caught.value)


@pytest.mark.parametrize("depth", [-1, 0, 33])
def test_a_depth_out_of_range(depth: int) -> None:
    with pytest.raises(UsageError, match=f"the depth is {depth}; it has to be from 1 to 32"):
        grammars_for(builtin_capabilities(), depth=depth)


def test_there_is_a_grammar_for_each_constraint() -> None:
    grammars = grammars_for(builtin_capabilities())
    assert {constraint for constraint, _ in grammars} == set(Constraint)
    assert grammars == grammars_for(builtin_capabilities())


def test_the_formats() -> None:
    assert format_names() == ("gbnf", "json-schema", "lark", "rnc", "rng", "xsd")
    for name in format_names():
        format_ = find_format(name)
        assert format_.name == name
        assert (format_.emit is None) != (format_.fixed is None)
        assert (REPO / "grammars" / format_.file).is_file()
    with pytest.raises(UsageError, match="there is no format 'ebnf' of grammars; the formats are"):
        find_format("ebnf")


def texts() -> dict[str, str]:
    """The grammars of the built-in library by the names of their files."""
    words = alphabet(builtin_capabilities().library)
    formats = [find_format(name) for name in format_names()]
    return {each.file: each.emit(words, DEPTH) for each in formats if each.emit is not None}


def test_the_shipped_grammars_are_up_to_date() -> None:
    shipped = {name: (REPO / "grammars" / name).read_bytes().decode("ascii") for name in texts()}
    assert shipped == texts(), "run make docs"
    assert {name: len(text) < 60_000 for name, text in shipped.items()} == {
        "plan.gbnf": True,
        "plan.lark": True,
        "plan.schema.json": True,
    }


def test_shipped_grammars_are_ascii_with_one_rule_per_line() -> None:
    grammars = texts()
    assert all(text.isascii() and text.endswith("\n") for text in grammars.values())
    assert all(" ::= " in line for line in grammars["plan.gbnf"].splitlines())
    assert all(": " in line for line in grammars["plan.lark"].splitlines())
    assert "$ref" not in grammars["plan.schema.json"]
    assert '"pattern"' not in grammars["plan.schema.json"]


def test_a_grammar_of_a_few_interfaces_is_short_enough_for_a_prompt() -> None:
    grammars = dict(grammars_for(builtin_capabilities(), depth=4, only=["nav2_capabilities/*"]))
    assert len(grammars[Constraint.GBNF]) < 2_000
