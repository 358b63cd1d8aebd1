"""How places are named: by line, and by column too where the line does not tell them apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.analysis.words import place
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.syntax import parse

if TYPE_CHECKING:
    from gpsfsm.model.plan import Plan

GO = '<Runner interface="a/Go" provider="a/Go"/>'
SEQUENTIAL = '<Control type="sequential">'


def read(text: str) -> Plan:
    plan = parse(text).plan
    assert plan is not None
    return plan


def test_a_runner_that_has_its_line_for_itself_is_named_by_it() -> None:
    plan = read(f'<Plan>\n{GO}\n<Control type="recovery">{GO}</Control></Plan>')
    assert [place(each) for each in plan.elements[1:]] == [
        "Go at line 2",
        "the recovery at line 3",
        "Go at line 3",
    ]


def test_runners_that_share_a_line_are_named_by_column() -> None:
    plan = read(f"<Plan>{GO}{SEQUENTIAL}{GO}</Control>\n{GO}</Plan>")
    assert [place(each) for each in plan.elements[1:]] == [
        "Go at line 1 column 7",
        "the sequential at line 1",
        f"Go at line 1 column {7 + len(GO) + len(SEQUENTIAL)}",
        "Go at line 2",
    ]


@given(
    st.lists(
        st.sampled_from(
            [
                GO,
                f'<Control type="parallel_all">{GO}</Control>',
                f"{SEQUENTIAL}{GO}</Control>",
                "\n",
            ]
        )
    )
)
def test_no_two_elements_have_the_same_name(parts: list[str]) -> None:
    plan = read(f"<Plan>{''.join(parts)}</Plan>")
    names = [place(each) for each in plan.elements]
    assert len(set(names)) == len(names)
    for each in plan.elements:
        others = [other for other in plan.elements if other is not each]
        alone = not any(
            (other.kind, other.line, other.control_type)
            == (each.kind, each.line, each.control_type)
            for other in others
        )
        assert ("column" in place(each)) == (not alone)


def test_the_uses_of_one_node_of_a_tree_do_not_share_a_line_with_themselves() -> None:
    text = """<root BTCPP_format="4" main_tree_to_execute="A">
<BehaviorTree ID="A"><Sequence>
<SubTree ID="B"/>
<SubTree ID="B"/>
<Go/><Go/>
</Sequence></BehaviorTree>
<BehaviorTree ID="B">
<Stop/>
</BehaviorTree></root>"""
    plan = read_plan(text).plan
    assert plan is not None
    named = [place(each).partition(" at ")[2] for each in plan.runners]
    assert named == ["line 8", "line 8", "line 5 column 1", "line 5 column 6"]


def test_a_story_says_which_runner_of_a_line_fails() -> None:
    recovery = '<Control type="recovery">'
    report = check_text(f"<Plan>{GO}{recovery}{GO}</Control></Plan>", "", CheckOptions())
    stories = [each.scenario.story for each in report.findings if each.rule == "GP302"]
    second = f"Go at line 1 column {7 + len(GO) + len(recovery)}"
    assert [story[:-1] for story in stories] == [("Go at line 1 column 7 fails", f"{second} fails")]
