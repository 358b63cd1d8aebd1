"""What instances work with and hand over (semantics, section 8.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.compile import compile_plan
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Load, Start
from gpsfsm.model.capability import Binding, Interface, Output, Parameter, Provider, ValueType
from gpsfsm.model.capability import Input as Expected
from gpsfsm.model.event import Event
from tests.execution.support import BEGIN
from tests.oracle import par_all, par_any, plan, rec, seq
from tests.support import plan_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.compile import Compiled
    from gpsfsm.execution.records import Record
    from gpsfsm.model.plan import Attribute, Element
    from tests import oracle


def described(whole: oracle.P, providers: Mapping[str, Provider]) -> Compiled:
    """A compiled plan in which interfaces with these names are described."""
    tree = plan_of(whole)
    bindings = tuple(
        None
        if (provider := providers.get(runner.interface)) is None
        else Binding(Interface(runner.interface), provider, attributes_of(runner))
        for runner in tree.runners
    )
    return compile_plan(tree, bindings=bindings)


def attributes_of(runner: Element) -> dict[str, Attribute]:
    return {
        attribute.name: attribute
        for attribute in runner.attributes
        if attribute.name in runner.parameters
    }


class Served:
    """A kernel whose runners are loaded at once; it keeps what instances get and hand over."""

    def __init__(self, compiled: Compiled) -> None:
        self.kernel = Kernel(compiled)
        self.got: dict[int, dict[str, Any]] = {}
        self.records: list[Record] = []
        self.tell(BEGIN)

    def tell(self, happened: Input) -> None:
        records, commands = self.kernel.step(happened)
        self.records += records
        for command in commands:
            if isinstance(command, Load):
                self.tell(Input(Kind.LOADED, runner=command.runner))
            elif isinstance(command, Start):
                self.got[command.number] = dict(command.parameters)

    def ends(self, number: int, kind: Kind = Kind.SUCCEEDED, **outputs: Any) -> None:
        self.tell(Input(kind, number, outputs=outputs))


SIMPLE = Provider(
    "P",
    "B",
    described=True,
    configuration=(
        Parameter("x", ValueType.INT, default=5),
        Parameter("y", ValueType.DOUBLE),
        Parameter("text", ValueType.STRING, default="hi"),
    ),
    inputs=(
        Expected("x", ValueType.INT),
        Expected("pose", ValueType.DOUBLES),
        Expected("goal", fallback="x"),
        Expected("said", default="nothing", fallback="text"),
    ),
)
DEFAULTS = {"x": 5, "text": "hi", "goal": 5, "said": "nothing"}


@pytest.mark.parametrize(
    ("written", "arriving", "got"),
    [
        ("B", {}, DEFAULTS),
        ("B x=7", {}, {**DEFAULTS, "x": 7, "goal": 7}),
        ("B x=7", {"x": 8}, {**DEFAULTS, "x": 8, "goal": 7}),
        ("B x=7 goal=9", {}, {**DEFAULTS, "x": 7, "goal": 9}),
        ("B goal=9", {"goal": 1}, {**DEFAULTS, "goal": 1}),
        ("B text=12", {}, {**DEFAULTS, "text": "12", "said": "12"}),
        ("B text=12 said=13", {}, {**DEFAULTS, "text": "12", "said": 13}),
        ("B y=2", {}, {**DEFAULTS, "y": 2.0}),
        ("B", {"y": 2}, {**DEFAULTS, "y": 2.0}),
        ("B", {"y": True}, {**DEFAULTS, "y": True}),  # no number, so it is not made one
        ("B", {"pose": [1, 2.5]}, {**DEFAULTS, "pose": [1.0, 2.5]}),
        ("B other=1", {"more": 2}, DEFAULTS),  # B knows neither
    ],
)
def test_what_an_instance_works_with(
    written: str, arriving: dict[str, Any], got: dict[str, Any]
) -> None:
    run = Served(described(plan("A", written), {"B": SIMPLE}))
    run.ends(0, **arriving)
    assert run.got[1] == got
    assert {name: type(value) for name, value in run.got[1].items()} == {
        name: type(value) for name, value in got.items()
    }
    (record,) = [each for each in run.records if each.kind is Kind.TRIGGERED and each.node == 2]
    assert record.data == got


def test_an_undescribed_instance_gets_everything() -> None:
    run = Served(described(plan("A", "B x=1 y=1.5 z=text"), {}))
    run.ends(0, x=2, more=[1, "two"])
    assert run.got[1] == {"x": 2, "y": 1.5, "z": "text", "more": [1, "two"]}


@pytest.mark.parametrize(
    ("whole", "ends", "last", "arrives"),
    [
        (plan("A", "B"), [(0, Kind.SUCCEEDED)], 1, True),
        (plan("A", rec("B")), [(0, Kind.FAILED)], 1, True),
        (plan("A", seq(seq("B"))), [(0, Kind.SUCCEEDED)], 1, True),
        (plan("A", par_all("B", "C")), [(0, Kind.SUCCEEDED)], 2, True),
        (plan(par_any("A", "C"), "B"), [(0, Kind.SUCCEEDED)], 2, False),
        (plan(par_all("A", "C"), "B"), [(1, Kind.SUCCEEDED), (0, Kind.SUCCEEDED)], 2, False),
        (plan("A", rec("C"), "B"), [(0, Kind.SUCCEEDED)], 2, False),
        (plan("A", "C", "B"), [(0, Kind.SUCCEEDED), (1, Kind.SUCCEEDED)], 2, False),
    ],
)
def test_values_travel_along_one_connection_and_not_through_joins(
    whole: oracle.P, ends: list[tuple[int, Kind]], last: int, arrives: bool
) -> None:
    run = Served(described(whole, {}))
    for number, kind in ends:
        run.ends(number, kind, **({"value": 7} if number == 0 else {}))
    assert run.got[last] == ({"value": 7} if arrives else {})


def test_nothing_arrives_with_the_start_of_another() -> None:
    compiled = compile_plan(plan_of(plan("A", par_all("B", "C"))), start_chain=True)
    run = Served(compiled)
    run.ends(0, value=7)
    assert run.got == {0: {}, 1: {"value": 7}, 2: {}}


BOTH = Provider(
    "P",
    "A",
    described=True,
    outputs=(
        Output("good"),
        Output("bad", event=Event.FAILED),
        Output("both"),
        Output("both", event=Event.FAILED),
    ),
)


@pytest.mark.parametrize(
    ("kind", "handed"),
    [(Kind.SUCCEEDED, {"good": 1, "both": 3}), (Kind.FAILED, {"bad": 2, "both": 3})],
)
def test_only_declared_outputs_travel_and_with_their_event(
    kind: Kind, handed: dict[str, int]
) -> None:
    run = Served(described(plan("A", rec("B"), "B"), {"A": BOTH}))
    run.ends(0, kind, good=1, bad=2, both=3, undeclared=4)
    (record,) = [each for each in run.records if each.kind is kind]
    assert record.data == handed
    # behind the recovery there is a join
    assert run.got == {0: {}, **({1: handed} if kind is Kind.FAILED else {2: {}})}


def test_a_timeout_hands_over_nothing() -> None:
    run = Served(described(plan("A", rec("B")), {"A": BOTH}))
    run.ends(0, Kind.TIMEOUT)
    run.ends(0, Kind.SUCCEEDED, good=1, both=3)  # too late
    assert run.got[1] == {}


def test_what_is_held_keeps_what_has_arrived() -> None:
    run = Served(described(plan("A", "B"), {}))
    run.tell(Input(Kind.PAUSE))
    run.ends(0, value=7)
    run.tell(Input(Kind.RESUME))
    assert run.got[1] == {"value": 7}


def test_those_who_get_the_same_value_do_not_share_it() -> None:
    run = Served(described(plan("A", par_all("B", "C")), {}))
    run.ends(0, value=[1, [2]])
    run.got[1]["value"].append("mine")
    run.got[1]["value"][1].append("mine")
    assert run.got[2] == {"value": [1, [2]]}
    (record,) = [each for each in run.records if each.kind is Kind.SUCCEEDED]
    assert record.data == {"value": [1, [2]]}
