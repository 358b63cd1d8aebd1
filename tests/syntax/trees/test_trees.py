"""The front end of behaviour trees: what is a tree, what is wrong with it, and where."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.compile.plan_text import holds_trees, read_plan
from gpsfsm.model.report import Verdict
from gpsfsm.running.answer_judge import PlanJudge
from gpsfsm.syntax import Limits

REAL = Path(__file__).parents[4] / "shared/corpus/experiment1/btgenbot"
_MODEL = '<TreeNodesModel><Action ID="Go"><input_port name="to"/></Action></TreeNodesModel>'

_ONLY_FILES = "which is read only for a tree that is itself a file"


def tree(body: str, attributes: str = 'BTCPP_format="4"', rest: str = "") -> str:
    return f"<root {attributes}>\n<BehaviorTree>\n{body}\n</BehaviorTree>\n{rest}</root>"


def problems(text: str, **options: Any) -> list[tuple[str, int, str]]:
    return [
        (problem.rule, problem.location.line, problem.message)
        for problem in read_plan(text, **options).problems
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('<root BTCPP_format="4"/>', True),
        ("<root><BehaviorTree/></root>", True),
        ('<?xml version="1.0"?>\n<!-- a -- b -->\n<root main_tree_to_execute="M"/>', True),
        ("<!-- home --><BehaviorTree/>", True),
        ("<root/>", False),
        ("<Plan><!-- <root><BehaviorTree/></root> --></Plan>", False),
        ("Here it is: <root><BehaviorTree/></root>", True),
        ("Here <it> is: <root><BehaviorTree/></root>", False),
        ("", False),
    ],
)
def test_a_tree_is_told_by_its_outermost_element(text: str, expected: bool) -> None:
    assert holds_trees(text) is expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            tree('<SubTree ID="Dok"/>', rest='<BehaviorTree ID="Dock"><Go/></BehaviorTree>'),
            [
                ("GP802", 1, "there are 2 trees, and nothing defines which of them runs"),
                ("GP807", 2, "this tree has no ID, so nothing can refer to it"),
                ("GP801", 3, "there is no tree 'Dok' in this file"),
            ],
        ),
        (
            tree("<Dock/>", 'BTCPP_format="4" main_tree_to_execute="M"').replace(
                "<BehaviorTree>",
                '<BehaviorTree ID="Dock"><Go/></BehaviorTree><BehaviorTree ID="M">',
            ),
            [("GP801", 3, "<Dock> is a tree, not a node")],
        ),
        (tree('<Go too="1"/>', rest=_MODEL), [("GP803", 3, "Go has no port 'too'")]),
        (
            tree("<Go/>", rest=_MODEL.replace('"Go"', '"Repeat"')),
            [
                (
                    "GP804",
                    5,
                    "'Repeat' is the name of a built-in node, which your own nodes cannot have",
                ),
                ("GP812", 3, "the TreeNodesModel does not describe 'Go'"),
            ],
        ),
        (
            tree("<Sequence/>"),
            [("GP805", 3, "a Sequence has at least one child, but this one has none")],
        ),
        (
            tree("<Go/><Go/>"),
            [("GP805", 2, "a tree has exactly one child, but this one has 2")],
        ),
        (
            tree('<Action ID="Go"><Wait/></Action>'),
            [
                ("GP805", 3, "an Action has no child, but this one has 1"),
            ],
        ),
        (
            tree('<Sequence num_attempts="3"><Go/></Sequence>'),
            [("GP810", 3, "a Sequence has no port 'num_attempts'")],
        ),
        (
            tree('<Go ID="Go"/>'),
            [("GP810", 3, "<Go> has an ID, but its tag is its ID")],
        ),
        (
            tree("<Repeat><Go/></Repeat>"),
            [("GP811", 3, "this Repeat lacks num_cycles")],
        ),
        (
            tree("<Go/>", 'BTCPP_format="5"'),
            [("GP808", 1, "there is no tree format '5'")],
        ),
        (
            tree("<Go/>", rest='<include path="other.xml"/>'),
            [
                ("GP813", 5, f"this includes another file, {_ONLY_FILES}"),
            ],
        ),
        (
            tree("<inverter><Go/></inverter>"),
            [("GP812", 3, "BehaviorTree.CPP has no node <inverter> of its own")],
        ),
        (tree("<Action/>"), [("GP807", 3, "this <Action> has no ID, so it names no node")]),
        (
            tree("<Go/></Sequence>"),
            [("GP101", 3, "</Sequence> closes nothing: no <Sequence> is open here")],
        ),
        ('<root BTCPP_format="4"/>', [("GP802", 1, "there is no <BehaviorTree> in this file")]),
    ],
)
def test_what_is_wrong_is_said_at_its_place(
    text: str, expected: list[tuple[str, int, str]]
) -> None:
    assert sorted(problems(text)) == sorted(expected)


def test_text_is_skipped_inside_elements_and_wrong_outside_the_root() -> None:
    inside = tree("look <Go/> here")
    assert problems(inside) == []
    outside = "text outside of <root>: "
    assert problems(f"{inside}\nDone.") == [("GP108", 6, f"{outside}Done.")]


def test_hints_name_what_was_meant() -> None:
    two = tree(
        '<SubTree ID="dock"/>',
        'BTCPP_format="4" main_tree_to_execute="Main"',
        '<BehaviorTree ID="Dock"><Go/></BehaviorTree>',
    ).replace("<BehaviorTree>", '<BehaviorTree ID="Main">')
    assert [problem.hint for problem in read_plan(two).problems] == ['write ID="Dock"']
    port = tree('<Repeat num_cycle="2"><Go/></Repeat>')
    assert [problem.hint for problem in read_plan(port).problems] == [
        'add it, for instance num_cycles="3"',
        "did you mean num_cycles?",
    ]


def test_of_many_ports_a_hint_names_five() -> None:
    ports = "".join(f'<input_port name="{name}"/>' for name in "fedcba")
    model = f'<TreeNodesModel><Action ID="Go">{ports}</Action></TreeNodesModel>'
    (problem,) = read_plan(tree('<Go where="here"/>', rest=model)).problems
    assert problem.hint == "use one of the ports a, b, c, d, e (line 5)"


@pytest.mark.parametrize(
    ("body", "misspelt"),
    [
        ("<alwaysSuccess/>", True),  # like a node of its own but for the case
        ("<Sequense><Go/></Sequense>", True),  # only a node of its own has children
        ("<AlwaysSucces/>", False),  # it may be somebody's leaf
    ],
)
def test_a_name_is_misspelt_if_nobody_would_call_a_leaf_so(body: str, misspelt: bool) -> None:
    assert ("GP812" in {rule for rule, _, _ in problems(tree(body))}) is misspelt


def test_the_only_tree_that_no_other_uses_runs_where_none_is_named() -> None:
    text = (
        '<root BTCPP_format="4" main_tree_to_execute="Mian">'
        '<BehaviorTree ID="Dock"><Go/></BehaviorTree>'
        '<BehaviorTree ID="Main"><Sequence><SubTree ID="Dock"/><Beep/></Sequence></BehaviorTree>'
        "</root>"
    )
    parsed = read_plan(text)
    assert [problem.rule for problem in parsed.problems] == ["GP802"]
    assert parsed.plan is not None
    assert [runner.interface for runner in parsed.plan.runners] == ["Go", "Beep"]


def test_mutual_recursion_is_told_once_and_nothing_is_decided() -> None:
    text = (
        '<root BTCPP_format="4" main_tree_to_execute="A">'
        '<BehaviorTree ID="A"><SubTree ID="B"/></BehaviorTree>'
        '<BehaviorTree ID="B"><SubTree ID="A"/></BehaviorTree></root>'
    )
    assert [rule for rule, _, _ in problems(text)] == ["GP809"]
    assert check_text(text, "t.xml", CheckOptions()).facts is None


def test_a_comment_suppresses_what_is_inside_of_the_next_element_in_all_its_uses() -> None:
    text = tree(
        '<Repeat num_cycles="2">\n<!-- gpsfsm: ignore GP302 because it may fail -->\n<Go/></Repeat>'
    )
    report = check_text(text, "t.xml", CheckOptions())
    assert report.findings == ()
    assert [(each.rule, each.justification) for each in report.suppressed] == [
        ("GP302", "it may fail")
    ]


def test_the_tree_of_an_answer_is_taken() -> None:
    answer = f"Sure!\n```xml\n{tree('<Go/>')}\n```\nGood luck."
    parsed = read_plan(answer, from_response=True)
    assert [(problem.rule, problem.location.line) for problem in parsed.problems] == [("GP115", 3)]
    assert parsed.plan is not None
    assert parsed.plan.runners[0].line == 5


def test_a_tree_is_no_answer_where_a_plan_is_wanted() -> None:
    actual = PlanJudge(CheckOptions())(tree("<Go/>"))
    assert not actual.accepted
    assert "not a plan" in actual.feedback


def test_limits_end_the_reading() -> None:
    deep = tree("<Inverter>" * 20 + "<Go/>" + "</Inverter>" * 20)
    for limits in (Limits(max_depth=10), Limits(max_elements=5), Limits(max_attributes=1)):
        text = deep.replace("<Go/>", '<Go a="1" b="2"/>')
        parsed = read_plan(text, limits=limits)
        assert parsed.plan is None
        assert "GP103" in [problem.rule for problem in parsed.problems]
        report = check_text(text, "t.xml", CheckOptions(limits=limits))
        assert report.verdict is Verdict.UNDECIDED


_PIECES = st.sampled_from(
    [
        *("<root>", "</root>", '<root BTCPP_format="4">', "<BehaviorTree>", "</BehaviorTree>"),
        *('<BehaviorTree ID="A">', '<SubTree ID="A"/>', "<Sequence>", "</Sequence>", "<Go/>"),
        *("<Inverter>", "</Inverter>", '<Retry num_attempts="3">', '<Parallel success_count="2">'),
        *("</Parallel>", "<Repeat num_cycles='{x}'>", "</Repeat>", "text", "<", "&", "\0", '"'),
        *("<TreeNodesModel>", "</TreeNodesModel>", '<Action ID="Go"/>', "<!--", "-->", "<?xml"),
    ]
)


@given(st.lists(_PIECES, max_size=30).map("".join))
def test_nothing_makes_it_crash(text: str) -> None:
    for whole in (text, f'<root BTCPP_format="4"><BehaviorTree>{text}'):
        report = check_text(whole, "t.xml", CheckOptions())
        assert "GP903" not in [finding.rule for finding in report.findings]
        assert report.facts is not None or report.verdict is not Verdict.ACCEPTED


@pytest.mark.skipif(not REAL.is_dir(), reason="the corpus of real trees is not there")
def test_real_trees_are_read_or_refused_for_a_reason() -> None:
    files = sorted(REAL.rglob("*.xml"))
    decided = 0
    for file in files:
        report = check_text(file.read_bytes(), file.name, CheckOptions())
        rules = {finding.rule for finding in report.findings}
        assert "GP903" not in rules, file
        assert "GP104" not in rules, file
        if report.facts is None:
            assert any(finding.severity.value == "error" for finding in report.findings), file
        decided += report.facts is not None
    assert len(files) == 247
    assert decided >= 203
