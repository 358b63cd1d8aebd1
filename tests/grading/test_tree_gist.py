"""What behaviour trees mean, however they are written."""

from __future__ import annotations

import re

import pytest

from gpsfsm.grading.gist import elements_of
from gpsfsm.grading.tree_answer import PlaceNames, tree_gist_of
from gpsfsm.model.plan import Kind
from gpsfsm.tasks.load import read_task

TASK = read_task(
    b"""
interface: MoveTo
places: {BayA: {x: 1.0, y: 2.0}, BayB: {x: 3.0, y: 4.0}, BayC: {x: 5.0, y: 6.0}}
steps: [{do: BayA, else: BayB}, {do: BayC}]
"""
)
PLACES = PlaceNames(TASK)


def shape(inside: str, more: str = "") -> str:
    """The gist, short: ``A`` is a drive to BayA, ``r[…]`` a recovery, ``s[…]`` a sequence."""
    text = (
        f'<root><BehaviorTree ID="Main"><Sequence>{inside}</Sequence></BehaviorTree>{more}</root>'
    )
    plan = tree_gist_of(text, PLACES)
    if plan is None:
        return ""

    def described(index: int) -> str:
        element = plan.elements[index]
        if element.kind is Kind.RUNNER:
            return str(element.parameters["place"]).removeprefix("Bay")
        inner = " ".join(map(described, element.children))
        letter = (element.control_type or "x")[0] if element.kind is Kind.CONTROL else ""
        return f"{letter}[{inner}]" if letter else inner

    return re.sub(r"^s\[(.*)\]$", r"\1", described(0))


@pytest.mark.parametrize(
    ("inside", "gist"),
    [
        # where a leaf drives
        ('<MoveTo goal="BayA"/><Go at="{bay_b}"/><Action ID="Visit" x="${BayC}"/>', "A B C"),
        ('<MoveTo name="BayA" goal="BayB"/>', "B"),
        ('<Action name="MoveTo" target="BayA"/><Task action="MoveTo" target="BayB"/>', "A B"),
        ('<MoveTo name="Go to bay A" goal="7;8;9"/><MoveTo>BayB</MoveTo><GoToBayC/>', "A B C"),
        ('<VisitAll bays="BayA, BayB;BayC"/>', "A B C"),
        ('<VisitAll bays="BayA", "BayB", "BayC" order="any"/>', "A B C"),
        ('<MoveTo x="1" y="2"/><MoveTo goal="3.0; 4.0; 90"/><MoveTo goal="(5, 6)"/>', "A B C"),
        ('<MoveTo x="8" y="9"/><MoveTo/><NavigateHome/>', "? ? ?"),
        ('<MoveTo target="BayA" fallback="BayB"/>', "s[s[A] r[s[B]]]"),
        # the blackboard
        ('<SetBlackboard output_key="k" value="BayA"/><MoveTo to="{k}"/><MoveTo to="k"/>', "A A"),
        ('<SetBlackboard output_key="bay_a" value="8,9"/><MoveTo x="8" y="9"/>', "A"),
        ('<SetBlackboard output_key="k" value="{k}"/><MoveTo to="{k}"/>', "?"),
        ('<GetPose of="BayB"/><MoveTo goal="{pose}"/>', "B"),
        ('<FindPose of="BayA" out="{a}"/><FindPose of="BayB" out="{b}"/><MoveTo to="{a}"/>', "A"),
        ('<FindPose of="BayA"/><FindPose of="BayB"/><MoveTo/><MoveTo/><MoveTo/>', "A B ?"),
        ('<IsNear at="BayA"/><MoveTo to="BayA"/><MoveTo/>', "A ?"),
        # what is no drive
        ('<IsBayAFree/><CheckBay of="BayA"/><Condition ID="AtBay" at="BayA"/>', ""),
        ('<Log text="BayA"/><Wait at="BayA"/><AlwaysFailure/><Script code="BayA := 1"/>', ""),
        ("<!-- BayA --><Sequence name='BayA'><IsThere/></Sequence>", ""),
        ("<Turn angle='3'/>", ""),
        # controls
        ('<Fallback><MoveTo to="BayA"/><MoveTo to="BayB"/></Fallback>', "s[s[A] r[s[B]]]"),
        ('<Selector><IsNear at="BayA"/><MoveTo to="BayB"/></Selector>', "s[s[B]]"),
        ('<IfThenElse><IsNear/><Go to="BayA"/><Go to="BayB"/></IfThenElse>', "s[s[A] r[s[B]]]"),
        ('<If test="x"><Then><Go to="BayA"/></Then><Else><Go to="BayB"/></Else></If>',
         "s[s[s[A]] r[s[s[B]]]]"),
        ('<Go to="BayA"><OnFailure><Go to="BayB"/></OnFailure></Go>', "s[s[A] r[s[s[s[B]]]]]"),
        ('<Node type="fallback"><Go to="BayA"/><Go to="BayB"/></Node>', "s[s[A] r[s[B]]]"),
        ('<Parallel><MoveTo to="BayA"/><MoveTo to="BayB"/></Parallel>', "p[s[A] s[B]]"),
        ('<Inverter><ForceFailure><Go to="BayA"/></ForceFailure></Inverter>', "s[s[A]]"),
        ('<Visit bays="BayA"><Go to="BayB"/></Visit>', "s[B]"),
        ('<Visit bays="BayA"><Retry/></Visit>', "A"),
        ('<Sequence name="to_bay_b"><MoveTo goal="7;8"/></Sequence>', "B"),
        ("<Fallback><Go to='BayA'></Sequence><Go to='BayB'/>", "s[s[s[A]]] B"),
    ],
)  # fmt: skip
def test_what_is_meant(inside: str, gist: str) -> None:
    assert shape(inside) == gist


@pytest.mark.parametrize(
    ("inside", "more", "gist"),
    [
        ('<SubTree ID="X"/><SubTree ID="BayC"/>', '<Go to="BayA"/>', "A C"),
        ("<X/>", '<Go to="BayA"/>', "A"),
        ('<SubTree ID="X" goal="BayB"/>', '<Go to="{goal}"/>', "B"),
        ('<SubTree ID="X" name="BayC"/>', '<MoveTo to="7,8"/>', "C"),
        ('<SubTree ID="X"/>', '<SubTree ID="X"/>', ""),
        ('<SubTree ID="gone"/>', "", ""),
    ],
)
def test_subtrees_are_put_in(inside: str, more: str, gist: str) -> None:
    assert shape(inside, f'<BehaviorTree ID="X">{more}</BehaviorTree>') == gist


def test_a_tree_that_is_called_like_a_node() -> None:
    ports = '<BehaviorTree ID="MoveTo"><input_port name="goal">Where?</input_port></BehaviorTree>'
    assert shape('<MoveTo goal="BayA"/><SubTree ID="MoveTo" goal="BayB"/>', ports) == "A B"
    drives = '<BehaviorTree ID="MoveTo"><Action ID="MoveTo" goal="{goal}"/></BehaviorTree>'
    assert shape('<MoveTo goal="BayA"/><SubTree ID="MoveTo" goal="BayB"/>', drives) == "A B"


def test_the_tree_that_runs() -> None:
    def runs(root: str) -> str:
        trees = "".join(
            f'<BehaviorTree ID="T{name}"><Go to="Bay{name}"/></BehaviorTree>' for name in "AB"
        )
        plan = tree_gist_of(f"{root}{trees}</root>", PLACES)
        return "" if plan is None else str(plan.runners[0].parameters["place"])

    assert runs('<root main_tree_to_execute="TB">') == "BayB"
    assert runs("<root>") == "BayA"
    assert runs('<root><BehaviorTree ID="TC"><SubTree ID="TA"/></BehaviorTree>') == "BayA"
    assert runs("<root><TA/>") == "BayA"


def test_hostile_trees_are_cheap() -> None:
    twice = "".join(
        f'<BehaviorTree ID="X{n}"><Sequence>{f"<X{n + 1}/>" * 9}</Sequence></BehaviorTree>'
        for n in range(20)
    )
    assert shape("<X0/>", twice) == ""
    assert shape("<Sequence>" * 3000 + '<Go to="BayA"/>' + "</Sequence>" * 3000) == ""
    assert shape("</Sequence>" * 3000) == ""
    assert shape('<Go to="BayA"/>' * 20_000) == ""
    blanks = " " * 60_000
    assert shape(f'<MoveTo to="1{blanks}x"/><MoveTo to="{{{blanks}"/><Go to="1 1{" 1" * 90} x"/>')


def test_end_tags_close_what_is_open() -> None:
    whole = elements_of("<a><b><c></b><d x='1'>text</d></a></z><e/>")
    assert [each.tag for each in whole.descendants()] == ["a", "b", "c", "d", "e"]
    assert [each.tag for each in whole.children] == ["a", "e"]
    a = whole.children[0]
    assert [(each.tag, each.text, each.attributes) for each in a.children] == [
        ("b", "", {}),
        ("d", "text", {"x": "1"}),
    ]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("BayA", ["BayA"]),
        ("go_to_bay_a and bay-b, Bay C", ["BayA", "BayB", "BayC"]),
        ("BayAToBayB", ["BayA", "BayB"]),
        ("GoToBayAction", []),
        ("{bayA};bays;bay;abayA;BAYA1", ["BayA"]),
        ("BayA BayA BayB BayA", ["BayA", "BayB", "BayA"]),
        ("BayA" * 3000, ["BayA"]),
    ],
)
def test_places_by_their_names(text: str, named: list[str]) -> None:
    assert list(PLACES.named(text)) == named


def test_places_by_their_coordinates() -> None:
    assert (PLACES.at(3, 4), PLACES.at(4, 3)) == ("BayB", "")
    rooms = PlaceNames(read_task(b"{places: {Lab: {room: 4}, Hall2: {}}, steps: [{do: Lab}]}"))
    assert rooms.at(4, 4) == ""
    assert rooms.named("lab, hall2") == ("Lab",)
    assert (PLACES.interface("BayA"), rooms.interface("Lab")) == ("MoveTo", "Drive")
