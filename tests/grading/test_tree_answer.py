"""Behaviour trees as answers: what makes their syntax wrong, and what is meant if it is."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.grading.grader import Grader
from gpsfsm.grading.tree_answer import holds_tree_answer, read_tree_answer
from gpsfsm.tasks.load import load_task, read_task
from tests.cases import many

WORDS = b"""
interface: Drive
places: {BayA: {x: 1.0, y: 2.0}, BayB: {x: 3.0, y: 4.0}, BayC: {x: 5.0, y: 6.0}}
steps: [{do: BayA, else: BayB}, {do: BayC}]
"""
ANY = read_task(WORDS)
TASK = read_task(WORDS + b"nodes: {Drive: {ports: to, form: compact}, Speak: [text, voice]}")
RIGHT = '<Fallback><Drive to="BayA"/><Drive to="BayB"/></Fallback><Drive to="BayC"/>'


def file(inside: str, *, main: str = "T", tree: str = "T", more: str = "") -> str:
    return (
        f'<root BTCPP_format="4" main_tree_to_execute="{main}"><BehaviorTree ID="{tree}">'
        f"<Sequence>{inside}</Sequence></BehaviorTree>{more}</root>"
    )


def grade(text: str) -> tuple[str, bool, bool | None]:
    graded = Grader(TASK).grade(text, "a.xml")
    return graded.grade.value, graded.syntax, graded.theory


BOTH = ("success", True, True)
THEORY = ("partial", False, True)
SYNTAX = ("partial", True, False)
NEITHER = ("failed", False, False)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        (file(RIGHT), BOTH),
        (f"Here it is:\n```xml\n{file(RIGHT)}\n```\n", BOTH),
        (file(RIGHT).replace(' BTCPP_format="4"', ""), BOTH),
        (file(RIGHT + "<Speak text='done' voice='x'/>"), SYNTAX),  # nobody asked for it
        (file('<Action ID="Speak" text="I go"/>'), SYNTAX),
        (file(RIGHT.replace("to=", "goal=")), THEORY),
        (file(RIGHT.replace('<Drive to="BayC"/>', '<Action ID="Drive" to="BayC"/>')), THEORY),
        (file(RIGHT.replace("<Drive", "<SubTree ID='Drive'")), THEORY),
        (file(RIGHT.replace("<Drive", "<Condition ID='Drive'")), NEITHER),
        (file(RIGHT.replace("Fallback", "Selector")), THEORY),
        (file(RIGHT + '<Whistle tune="BayA"/>'), NEITHER),
        (file(RIGHT + "<IsBayCFree/>"), THEORY),
        (file(RIGHT.replace('="BayB"/>', "=BayB/>")), THEORY),
        (file('<Drive to="BayA"/>'), SYNTAX),
        (file("<ForceFailure>" + RIGHT + "</ForceFailure>"), THEORY),  # has three children
    ],
)
def test_syntax_is_what_can_be_loaded_with_the_nodes_of_the_task(
    text: str, wanted: tuple[str, bool, bool | None]
) -> None:
    assert grade(text) == wanted


def test_a_model_in_the_answer_registers_no_node() -> None:
    model = '<TreeNodesModel><Action ID="Drive"><input_port name="goal"/></Action></TreeNodesModel>'
    assert grade(file(RIGHT.replace("to=", "goal="), more=model)) == THEORY
    assert grade(file(RIGHT, more=model)) == BOTH


@pytest.mark.parametrize(
    "text",
    [
        file(RIGHT, main="Other"),
        file(RIGHT, main="root", tree="root"),
        file(RIGHT, main="", tree=""),
        file('<SubTree ID="Rest"/>', main="X", more="<BehaviorTree ID='Rest'><Sequence>")
        .replace("<Sequence></root>", f"<Sequence>{RIGHT}</Sequence></BehaviorTree></root>"),
        file(RIGHT, more='<BehaviorTree ID="U"><SubTree ID="Gone"/></BehaviorTree>'),
    ],
)  # fmt: skip
def test_what_trees_are_called_is_not_counted(text: str) -> None:
    assert grade(text) == BOTH


def test_which_of_several_trees_runs_must_be_clear() -> None:
    other = '<BehaviorTree ID="U"><Drive to="BayC"/></BehaviorTree>'
    assert grade(file(RIGHT, main="X", more=other)) == THEORY


def test_what_an_undefined_subtree_does_is_not_in_the_answer() -> None:
    graded = Grader(TASK).grade(file('<SubTree ID="Rest"/>'), "a.xml")
    assert (graded.grade.value, graded.syntax, graded.theory) == SYNTAX
    assert "there is no tree 'Rest'" in graded.reason
    assert grade(file('<SubTree ID="BayA"/><Drive goal="BayC"/>')) == NEITHER


def test_what_no_automaton_expresses_is_read_by_its_gist() -> None:
    endless = (
        '<RetryUntilSuccessful num_attempts="-1"><Sequence>{}</Sequence></RetryUntilSuccessful>'
    )
    assert grade(file(endless.format(RIGHT))) == BOTH
    assert grade(file(endless.format('<Drive to="BayC"/>'))) == SYNTAX


@pytest.mark.parametrize(
    "text",
    [
        f'<BehaviorTree ID="T"><Sequence>{RIGHT}</Sequence></BehaviorTree>',
        file(RIGHT).replace("</root>", ""),
        f"```xml\n<BehaviorTree>{RIGHT}</BehaviorTree>\n```",
        "<root>",
        "<root></root>",
        "<root><BehaviorTree/></root>",
        "<root BTCPP_format='4'><BehaviorTree ID='T'><Sequence/></BehaviorTree></root>",
    ],
)
def test_what_cannot_be_cut_out_is_failed(text: str) -> None:
    assert grade(text) == NEITHER


def test_the_last_file_counts() -> None:
    wrong = file('<Drive to="BayC"/>')
    assert grade(f"{wrong}\nNo:\n{file(RIGHT)}") == BOTH
    assert grade(f"{file(RIGHT)}\nNo:\n{wrong}") == SYNTAX


def test_without_nodes_any_node_may_be_used() -> None:
    text = file(RIGHT.replace("to=", "goal=") + '<Action ID="Log" message="done"/>')
    answer = read_tree_answer(text, "a.xml", ANY)
    assert answer.faults == ()
    assert not answer.gist
    assert Grader(ANY).grade(text, "a.xml").reason.startswith("GP602")


def test_the_lines_of_a_reason_are_those_of_the_answer() -> None:
    text = f"So:\n\n{file('')}".replace("<Sequence>", '<Sequence>\n<Drive goal="BayC"/>\n')
    reason = Grader(TASK).grade(text, "a.xml").reason
    assert "GP803 in line 4" in reason
    assert "at line 4" in reason


def test_limits_leave_it_undecided() -> None:
    deep = "<Sequence>" * 300 + '<Drive to="BayA"/>' + "</Sequence>" * 300
    graded = Grader(TASK).grade(file(deep), "a.xml")
    assert (graded.grade.value, graded.theory) == ("undecided", None)
    many = (
        '<Repeat num_cycles="9999"><Repeat num_cycles="9999"><Drive to="BayA"/></Repeat></Repeat>'
    )
    assert Grader(TASK).grade(file(many), "a.xml").grade.value == "undecided"


def test_a_tree_of_the_prompt_is_no_answer() -> None:
    task = load_task("experiments/navigation/task5.yaml")
    shown = (
        '<root BTCPP_format="4"><BehaviorTree><Sequence><Fallback><MoveTo location="Station A"/>'
        '<MoveTo location="Station D"/></Fallback><MoveTo name="b" location="Station B"/>'
        '<MoveTo location="Station C"/></Sequence></BehaviorTree></root>'
    )
    graded = Grader(task).grade(shown, "a.xml")
    assert (graded.grade.value, graded.syntax) == ("failed", True)
    assert graded.reason == "example returned: it is example_tree.xml"
    assert Grader(task).grade(shown.replace("Station ", "Station"), "a.xml").grade == "partial"


def test_what_is_read_as_a_tree() -> None:
    assert holds_tree_answer("So: <root><Sequence/></root>")
    assert not holds_tree_answer("So: <root/> <Plan/>")
    assert not holds_tree_answer("I cannot do that.")


def trees() -> st.SearchStrategy[str]:
    """Sequences and fallbacks of drives."""
    leaves = st.sampled_from([f'<Drive to="Bay{name}"/>' for name in "ABC"])
    return st.recursive(
        leaves,
        lambda inner: st.builds(
            lambda tag, parts: f"<{tag}>{''.join(parts)}</{tag}>",
            st.sampled_from(["Sequence", "Fallback"]),
            st.lists(inner, min_size=1, max_size=3),
        ),
        max_leaves=5,
    )


@given(trees())
@settings(max_examples=many(60))
def test_the_gist_of_a_plain_tree_is_what_it_does(tree: str) -> None:
    """A wrong name of a port changes the syntax, and nothing else."""
    right, wrong = (
        Grader(TASK).grade(file(one), "a") for one in (tree, tree.replace("to=", "at="))
    )
    assert (right.syntax, wrong.syntax) == (True, False)
    assert right.theory is wrong.theory


PIECES = [
    "<root>", "</root>", '<BehaviorTree ID="T">', "</BehaviorTree>", "<Sequence>", "</Sequence>",
    "<Fallback>", '<SubTree ID="T"/>', '<Drive to="BayA"/>', '<Drive to="Bay', "<!--", "&x;", "\0",
    "<IfThenElse>", '<SetBlackboard output_key="k" value="{k}"/>', '<Drive at="{k}"/>', "<", ">",
]  # fmt: skip


@given(st.lists(st.sampled_from(PIECES), max_size=25).map("".join))
def test_no_answer_breaks_it(text: str) -> None:
    assert Grader(TASK).grade(f"<root>{text}</root>", "a.xml").grade is not None
