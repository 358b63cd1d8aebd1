"""Advice on trees: keys that nothing writes, and what is said of them."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import pytest

from gpsfsm.syntax.trees import read_trees
from tests.oracle import ticks
from tests.oracle.btcpp import engine

if TYPE_CHECKING:
    from tests.oracle.btcpp import Answer, Run

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
            "{spot} is read here, but nothing in this file writes it",
            'where has the name without braces on line 4: write where="{spot}" '
            "there, unless that node expects the name of a key",
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
    assert problem.hint == "use parentheses: arithmetic, bitwise operators, ! and .. do not mix"


def advice(body: str, *rules: str, version: str = "4", models: str = "") -> list[tuple[int, str]]:
    """The lines and rules of the findings about a tree that runs."""
    text = (
        f'<root BTCPP_format="{version}" main_tree_to_execute="M">\n<BehaviorTree ID="M">\n{body}\n'
        f'</BehaviorTree><BehaviorTree ID="S"><Go/></BehaviorTree>{models}</root>'
    )
    problems = read_trees(text, "tree.xml").collector.problems()
    return [
        (problem.location.line, problem.rule)
        for problem in problems
        if not rules or problem.rule in rules
    ]


def recovery(retries: str, second: str, first: str = "<Go/>") -> str:
    return f"<RecoveryNode{retries}>{first}{second}</RecoveryNode>"


@pytest.mark.parametrize(
    ("retries", "second", "idle"),
    [
        (' number_of_retries="0"', "<Clear/>", True),
        (' number_of_retries="-1"', "<Clear/>", True),
        (' number_of_retries="1"', "<Clear/>", False),
        (' number_of_retries="{count}"', "<Clear/>", False),
        ("", "<Clear/>", False),
        ("", "<AlwaysFailure/>", True),
        ("", "<Sequence><Clear/><AlwaysFailure/></Sequence>", True),
        ("", "<Fallback><AlwaysFailure/><Clear/></Fallback>", False),
        ("", "<RoundRobin><AlwaysFailure/><AlwaysFailure/></RoundRobin>", True),
        ("", '<AlwaysFailure _successIf="ready"/>', False),
        ("", "<Inverter><AlwaysFailure/></Inverter>", False),
        ("", "<ReactiveFallback><GoalUpdated/><Clear/></ReactiveFallback>", False),
    ],
)
def test_a_recovery_that_never_helps(retries: str, second: str, idle: bool) -> None:
    assert bool(advice(recovery(retries, second), "GP821")) == idle


def test_a_recovery_node_of_ones_own_is_left_alone() -> None:
    assert advice('<RecoveryNode number_of_retries="0"><Go/></RecoveryNode>', "GP821") == []


ROUND = "<RoundRobin><A/><B/><C/></RoundRobin>"


@pytest.mark.parametrize(
    ("body", "lacking"),
    [
        (ROUND, True),
        ("<RoundRobin><A/></RoundRobin>", False),
        (f"<Sequence><Go/>{ROUND}</Sequence>", True),
        (recovery(' number_of_retries="2"', ROUND), True),
        (recovery(' number_of_retries="3"', ROUND), False),
        (recovery(' number_of_retries="2"', "<Clear/>", ROUND), False),
        (recovery(' number_of_retries="1"', "<Clear/>", ROUND), True),
        (recovery(' number_of_retries="0"', ROUND), False),  # GP821 says more
        (recovery(' number_of_retries="{count}"', ROUND), False),
        (f'<Repeat num_cycles="2">{recovery("", ROUND)}</Repeat>', True),
        (f'<Repeat num_cycles="3">{recovery("", ROUND)}</Repeat>', False),
        (f'<RetryUntilSuccessful num_attempts="-1">{ROUND}</RetryUntilSuccessful>', False),
        (f'<Repeat num_cycles="0"><Repeat num_cycles="-1">{ROUND}</Repeat></Repeat>', False),
        (f'<Repeat num_cycles="-1"><Repeat num_cycles="0">{ROUND}</Repeat></Repeat>', False),
        (f"<KeepRunningUntilFailure>{ROUND}</KeepRunningUntilFailure>", False),
        (recovery("", f"<ReactiveFallback><GoalUpdated/>{ROUND}</ReactiveFallback>"), True),
        (f"<ReactiveFallback>{ROUND}<Go/></ReactiveFallback>", False),
        (f"<PipelineSequence>{recovery('', ROUND)}<Go/></PipelineSequence>", False),
        (f"<Patrol>{ROUND}</Patrol>", False),
    ],
)
def test_a_round_robin_goes_round(body: str, lacking: bool) -> None:
    assert bool(advice(body, "GP822")) == lacking


def test_outputs_go_to_keys() -> None:
    finds = "<Sequence>\n" + "\n".join(
        f'<Find where="{text}"/>' for text in ("{spot}", "{=}", "=", "", "spot", "on {spot}")
    )
    body = f"{finds}\n</Sequence>"
    assert advice(body, "GP823", models=MODEL) == [(8, "GP823"), (9, "GP823")]
    assert advice(body, "GP823", models=MODEL, version="3") == []


@pytest.mark.parametrize("name", ["_skipIf", "_onHalted", "_post", "_uid", "_autoremap", "_colour"])
def test_attributes_that_are_read_or_belong_to_tools(name: str) -> None:
    text = "true" if name == "_autoremap" else "x = 1" if name == "_colour" else "1 == 1"
    assert advice(f'<SubTree ID="S" {name}="{text}"/>', "GP824") == []


@pytest.mark.parametrize(
    ("attribute", "version", "reported"),
    [
        ('_skipif="1 == 2"', "4", True),
        ('_OnSuccess="x := 1"', "4", True),
        ('_if="x &lt; 3"', "4", True),
        ('__shared_blackboard="true"', "4", True),
        ('__shared_blackboard="true"', "3", False),
        ('__autoremap="true"', "4", True),
        ('_autoRemap="true"', "4", True),
        ('_skipif="1 == 2"', "3", False),
    ],
)
def test_attributes_that_are_ignored(attribute: str, version: str, reported: bool) -> None:
    body = f'<SubTree ID="S" {attribute}/>'
    assert bool(advice(body, "GP824", version=version)) == reported


@pytest.mark.parametrize("attribute", ["_skipif", "_SkipIf", "_Failureif", "_if", "_onStart"])
def test_the_engine_ignores_what_it_does_not_know(attribute: str) -> None:
    module = pytest.importorskip("behaviortreepy", reason="behaviortreepy is not installed")
    text = (
        '<root BTCPP_format="4"><BehaviorTree ID="M">'
        '<AlwaysSuccess {}="1 == 1"/></BehaviorTree></root>'
    )
    factory = module.BehaviorTreeFactory()
    tree = factory.create_tree_from_text(text.format(attribute))
    assert tree.tick_exactly_once() == module.NodeStatus.SUCCESS
    broken = text.replace("1 == 1", "1 ==").format(attribute)
    module.BehaviorTreeFactory().create_tree_from_text(broken)  # not even read


@pytest.mark.parametrize(("text", "plain"), [(" 3", "3"), ("+3", "3"), ("3.0", "3"), ("-1", "")])
def test_numbers_of_version_4_are_plain(text: str, plain: str) -> None:
    body = f'<Repeat num_cycles="{text}"><Go/></Repeat>'
    assert bool(advice(body, "GP811")) == bool(plain)
    assert bool(advice(body, "GP811", version="3")) == (plain != "" and "." in text)


LOADS = (
    *('<Sleep msec="5"/>', '<Sleep msec="-1"/>', '<Sleep msec=" 5"/>', '<Sleep msec="{x}"/>'),
    *('<Delay delay_msec="-1"><AlwaysSuccess/></Delay>', '<Sleep msec="soon"/>'),
    *(
        '<Timeout msec="-1"><AlwaysSuccess/></Timeout>',
        '<Timeout msec="0"><AlwaysSuccess/></Timeout>',
    ),
    *("<Script/>", "<ScriptCondition/>", '<Script code="x := 1"/>', '<Script code=""/>'),
    '<Precondition else="FAILURE"><AlwaysSuccess/></Precondition>',
    '<Precondition if="1 == 1" else="FAILURE"><AlwaysSuccess/></Precondition>',
)


@pytest.mark.parametrize("body", LOADS)
def test_the_real_engine_loads_what_is_accepted(body: str) -> None:
    module = engine()
    text = f'<root BTCPP_format="4"><BehaviorTree ID="M">{body}</BehaviorTree></root>'
    try:
        module.BehaviorTreeFactory().create_tree_from_text(text)
        loads = True
    except RuntimeError:
        loads = False
    problems = read_trees(text, "t.xml").collector.problems()
    assert (not any(each.rule in ("GP811", "GP818") for each in problems)) is loads


def test_a_round_robin_that_is_entered_once_is_a_fallback() -> None:
    """Played tick by tick with the same answers, Nav2's node and Fallback do the same."""
    compared = 0
    for seed in range(1_500):
        text = ticks.random_tree(random.Random(seed))  # noqa: S311  (no secrets here)
        problems = read_trees(text, "tree.xml").collector.problems()
        once = sum("entered only once" in each.message for each in problems if each.rule == "GP822")
        if not once or once < text.count("<RoundRobin"):
            continue
        compared += 1
        for run in range(4):
            first = _played(text, seed + run)
            assert first == _played(text.replace("RoundRobin", "Fallback"), seed + run), text
    assert compared > 30


def _played(text: str, seed: int) -> Run:
    answers = random.Random(seed)  # noqa: S311

    def answer(name: str, visit: int) -> tuple[int, Answer]:
        del name, visit
        return answers.randint(0, 2), answers.choice(("SUCCESS", "FAILURE"))

    return ticks.play(text, random.Random(seed), answer)  # noqa: S311
