"""Advice on trees: keys that nothing writes, and what is said of them."""

from __future__ import annotations

from gpsfsm.syntax.trees import read_trees

MODEL = (
    '<TreeNodesModel><Action ID="Drive"><input_port name="to"/></Action>'
    '<Action ID="Find"><output_port name="where"/></Action></TreeNodesModel>'
)


def unwritten(body: str, version: str = 'BTCPP_format="4"') -> list[tuple[int, str, str]]:
    text = f"<root {version}>\n<BehaviorTree>\n{body}\n</BehaviorTree>\n{MODEL}</root>"
    problems = read_trees(text, "tree.xml").collector.problems()
    return [
        (problem.location.line, problem.message, problem.hint)
        for problem in problems
        if problem.rule == "GP820"
    ]


def test_forgotten_braces_are_pointed_at() -> None:
    body = '<Sequence>\n<Find where="spot"/>\n<Drive to="{spot}"/>\n</Sequence>'
    assert unwritten(body) == [
        (
            5,
            "{spot} is read here, and nothing in this file writes it",
            'where has the name without braces on line 4: write where="{spot}" there, '
            "unless that node takes the name of a key",
        )
    ]


def test_a_written_key_is_no_finding() -> None:
    assert unwritten('<Sequence><Find where="{spot}"/><Drive to="{spot}"/></Sequence>') == []


def test_the_goal_is_written_by_nav2() -> None:
    limited = '<RateController hz="1.0"><Drive to="{goal}"/></RateController>'
    assert unwritten(limited) == []
    assert len(unwritten('<Drive to="{goal}"/>')) == 1
    assert len(unwritten(limited.replace("goal", "gaol"))) == 1


def test_an_empty_port_of_a_script_is_loaded_by_the_engine() -> None:
    text = '<root BTCPP_format="4"><BehaviorTree>{}</BehaviorTree></root>'
    for node, faults in (('<Script code=""/>', 0), ('<AlwaysSuccess _onSuccess=""/>', 1)):
        problems = read_trees(text.format(node), "tree.xml").collector.problems()
        assert sum(problem.rule == "GP818" for problem in problems) == faults


def test_what_parentheses_mend_is_said() -> None:
    node = '<Script code="left := width + height | 1"/>'
    text = f'<root BTCPP_format="4"><BehaviorTree>{node}</BehaviorTree></root>'
    (problem,) = read_trees(text, "tree.xml").collector.problems()
    assert problem.location.column == text.index("|") + 1
    assert problem.hint == "arithmetic, operators of bits, ! and .. do not mix: use parentheses"
