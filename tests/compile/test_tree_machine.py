"""Behaviour trees → machine: what the real BehaviorTree.CPP does, and what is left open."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

import gpsfsm
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.compile.tree_scripts import Scripts
from gpsfsm.compile.units import TreeMachine
from gpsfsm.model.report import Facts, Frequency, Verdict
from tests.cases import batches
from tests.compile.test_trees import tree
from tests.conftest import SHARED
from tests.oracle import ticks
from tests.oracle.btcpp import Answer, against_facts, disagreement, engine, follows, play

if TYPE_CHECKING:
    from pathlib import Path


def machine_of(body: str, version: int = 4, **others: str) -> TreeMachine:
    plan = read_plan(tree(body, version, **others)).plan
    assert isinstance(plan, TreeMachine)
    return plan


def facts_of(body: str, version: int = 4, **others: str) -> Facts:
    report = check_text(tree(body, version, **others), "t.xml", CheckOptions())
    assert report.facts is not None
    return report.facts


@pytest.mark.parametrize("batch", batches(16))
def test_the_real_engine_does_what_the_machine_can_do(batch: int) -> None:
    engine()
    for seed in range(20 * batch, 20 * batch + 20):
        parted, _ = disagreement(seed, runs=3)
        assert not parted, (seed, parted)


@pytest.mark.parametrize("seed", [842277])
def test_a_tree_that_once_differed(seed: int) -> None:
    """All children of a SequenceWithMemory are skipped when it runs again."""
    engine()
    parted, labels = disagreement(seed)
    assert not parted
    assert "SKIPPED" in labels


@pytest.mark.parametrize("batch", batches(4))
def test_the_real_engine_keeps_to_the_ties_of_conditions(batch: int) -> None:
    """Leaves that always end the same, and conditions on keys that scripts write."""
    engine()
    for seed in range(20 * batch, 20 * batch + 20):
        parted, _ = disagreement(seed, runs=3, consistent=True)
        assert not parted, (seed, parted)


@pytest.mark.parametrize("batch", batches(8))
def test_nodes_that_the_engine_lacks_do_what_the_machine_can_do(batch: int) -> None:
    for seed in range(20 * batch, 20 * batch + 20):
        parted, labels = ticks.disagreement(seed, runs=3)
        assert not parted, (seed, parted)
        errors = {label for label in labels if label.startswith("GP")}
        assert errors <= {"GP301"}, seed  # a leaf that no run reaches
        assert (Verdict.REJECTED.value in labels) is bool(errors)


def test_a_reactive_sequence_asks_again_and_halts() -> None:
    machine = machine_of("<ReactiveSequence><IsBatteryLow/><Drive/></ReactiveSequence>")
    assert not machine.approximations
    names = [runner.interface for runner in machine.runners]
    assert names == ["IsBatteryLow", "IsBatteryLow", "Drive"]
    automaton = machine.automaton
    clear, watch, drive = (automaton.runner_node(number) for number in range(3))
    edges = {(source, event.value, target) for source, event, target in automaton.edges}
    assert {(clear, "SUCCEEDED", drive), (clear, "SUCCEEDED", watch)} <= edges
    assert (watch, "SUCCEEDED", watch) in edges
    stops = {(source, event.value, target) for source, event, target in automaton.stops}
    assert stops == {
        (watch, "FAILED", drive),
        (drive, "SUCCEEDED", watch),
        (drive, "FAILED", watch),
    }
    facts = facts_of("<ReactiveSequence><IsBatteryLow/><Drive/></ReactiveSequence>")
    assert facts.machine is not None
    assert facts.machine.endless is Frequency.NEVER
    assert facts.fewest_failures_to_give_up == 1


@pytest.mark.parametrize(
    ("body", "completes", "gives_up", "endless"),
    [
        ("<KeepRunningUntilFailure><A/></KeepRunningUntilFailure>", "never", "sometimes", True),
        (
            "<KeepRunningUntilFailure><AlwaysSuccess/></KeepRunningUntilFailure>",
            "never",
            "never",
            True,
        ),
        (
            '<Repeat num_cycles="-1"><ForceSuccess><A/></ForceSuccess></Repeat>',
            "never",
            "never",
            True,
        ),
        (
            '<RetryUntilSuccessful num_attempts="-1"><A/></RetryUntilSuccessful>',
            "sometimes",
            "never",
            True,
        ),
        ('<Repeat num_cycles="0"><A/></Repeat>', "always", "never", False),
        (
            '<Parallel success_count="1" failure_count="1"><A/><B/></Parallel>',
            "sometimes",
            "sometimes",
            False,
        ),
        ("<Parallel><A/><AlwaysFailure/></Parallel>", "never", "always", False),
        ('<Timeout msec="5"><AlwaysSuccess/></Timeout>', "always", "never", False),
        ("<TryCatch><A/><Clean/></TryCatch>", "sometimes", "sometimes", False),
        # What answers RUNNING without running anything is asked again.
        (
            '<Sequence><WaitValueUpdate entry="{x}"><A/></WaitValueUpdate><B/></Sequence>',
            "sometimes",
            "sometimes",
            True,
        ),
        ('<Precondition if="x" else="RUNNING"><A/></Precondition>', "sometimes", "sometimes", True),
        (
            '<Parallel success_count="2" failure_count="2"><A _skipIf="x"/><B/><C/></Parallel>',
            "sometimes",
            "sometimes",
            True,
        ),
        (
            "<PipelineSequence><AlwaysSuccess/><ForceFailure><A/></ForceFailure></PipelineSequence>",
            "never",
            "always",
            False,
        ),
    ],
)
def test_how_trees_end(body: str, completes: str, gives_up: str, endless: bool) -> None:
    facts = facts_of(body)
    assert (facts.completes.value, facts.gives_up.value) == (completes, gives_up)
    assert facts.machine is not None
    assert (facts.machine.endless is not Frequency.NEVER) is endless
    assert facts.stuck is Frequency.NEVER


def test_what_stands_behind_the_child_that_decides_at_once_never_starts() -> None:
    body = '<Parallel success_count="1" failure_count="1"><AlwaysSuccess/><Go/></Parallel>'
    facts = facts_of(body)
    assert (facts.runners, len(facts.unreachable)) == (1, 1)
    body = '<Parallel success_count="1" failure_count="1"><Go/><AlwaysSuccess/></Parallel>'
    assert "Go" in [each.interface for each in machine_of(body).runners]


@pytest.mark.parametrize(
    ("body", "lines"),
    [
        ('<Timeout msec="5"><A/></Timeout>', 1),
        ('<Switch2 variable="{x}" case_1="a" case_2="b"><A/><B/><C/></Switch2>', 1),
        ('<A _skipIf="x > 1"/>', 1),
        ('<Repeat num_cycles="40"><ReactiveSequence><A/><B/></ReactiveSequence></Repeat>', 2),
        ("<MyControl><A/><B/></MyControl>", 1),
        ("<PipelineSequence><A/><B/></PipelineSequence>", 1),
        ('<Repeat num_cycles="-1"><A/></Repeat>', 0),
        ('<RetryUntilSuccessful num_attempts="3"><WhileDoElse><Condition ID="C"/><A/><B/>'
         "</WhileDoElse></RetryUntilSuccessful>", 0),
    ],
)  # fmt: skip
def test_what_is_left_open_is_said(body: str, lines: int) -> None:
    assert len(machine_of(body).approximations) == lines
    report = check_text(tree(body), "t.xml", CheckOptions())
    assert report.verdict is Verdict.ACCEPTED
    assert ("GP816" in {finding.rule for finding in report.findings}) is bool(lines)


def test_a_recovery_node_tries_as_often_as_it_says() -> None:
    body = '<RecoveryNode number_of_retries="2"><Drive/><Clear/></RecoveryNode>'
    machine = machine_of(body)
    assert [each.interface for each in machine.runners] == ["Drive"] * 3 + ["Clear"] * 2
    assert facts_of(body).fewest_failures_to_give_up == 2  # Drive, and then Clear


def test_a_deep_tree_is_no_matter() -> None:
    body = "<Inverter>" * 190 + '<Timeout msec="1"><A/></Timeout>' + "</Inverter>" * 190
    assert facts_of(body).completes is Frequency.SOMETIMES


def test_a_tree_that_is_no_plan_is_a_tree_all_the_same() -> None:
    text = tree('<ReactiveFallback><Condition ID="Home"/><Drive/></ReactiveFallback>')
    (report,) = gpsfsm.check(text).plans
    (finding,) = (each for each in report.findings if each.rule == "GP302")
    assert "makes the tree fail" in finding.message
    assert not any(each.rule.startswith("GP2") for each in report.findings)


LOOP = '<LoopInt queue="1;2" value="{v}" if_empty="%s"><A0/></LoopInt>'
SKIPS = '<Parallel success_count="%d" failure_count="%d"><A0 _skipIf="1==1"/><A1/><A2/></Parallel>'


@pytest.mark.parametrize(
    "body",
    [
        *(LOOP % each for each in ("SUCCESS", "FAILURE", "SKIPPED")),
        *(SKIPS % (success, failure) for success in (-2, -1, 2, 3) for failure in (1, 2, 3)),
    ],
)
@pytest.mark.parametrize("succeeding", ["A0 A1 A2", "A1", ""])
def test_what_the_real_engine_does_at_the_end_is_possible(body: str, succeeding: str) -> None:
    """LoopInt answers if_empty once its queue is empty; what is skipped may count for Parallel."""
    engine()

    def answer(name: str, _visit: int) -> tuple[int, Answer]:
        return 0, "SUCCESS" if name in succeeding.split() else "FAILURE"

    text = tree(body)
    leaves = [name for name in ("A0", "A1", "A2") if name in body]
    run = play(text, leaves, answer, most_ticks=8)
    plan = read_plan(text).plan
    assert isinstance(plan, TreeMachine)
    assert follows(run, plan, exact=not plan.approximations) == ""
    (report,) = gpsfsm.check(text).plans
    assert against_facts(run, report, text) == ""


def test_a_path_may_be_reached_while_the_child_of_path_longer_on_approach_runs() -> None:
    facts = facts_of("<PathLongerOnApproach><A/></PathLongerOnApproach>")
    assert facts.completes is Frequency.SOMETIMES
    body = "<PathLongerOnApproach><ForceFailure><A/></ForceFailure></PathLongerOnApproach>"
    assert facts_of(body).completes is Frequency.SOMETIMES


def test_failures_on_one_line_are_said_to_be_on_one_line() -> None:
    (report,) = gpsfsm.check(tree("<ReactiveSequence><A/><B/></ReactiveSequence>")).plans
    (finding,) = (each for each in report.findings if each.rule == "GP302")
    assert "2 failures make the tree fail (line 1: " in finding.message


# -- conditions that have one answer ----------------------------------------------------------


TWICE = (
    "<Sequence>{}<IfThenElse><ScriptCondition code='x == 1'/><Sequence><A/>"
    "<ForceSuccess><Sequence><AlwaysSuccess/>{}</Sequence></ForceSuccess>"
    "<Precondition if=' x  ==  1 ' else='FAILURE'><B/></Precondition></Sequence><C/></IfThenElse>"
    "</Sequence>"
)
"""If ``x == 1`` has one answer, it takes the failure of a leaf that the tree fails."""

MODEL = (
    "<TreeNodesModel><Action ID='Reads'><input_port name='key'/></Action>"
    "<Action ID='Writes'><output_port name='key'/></Action></TreeNodesModel>"
)


@pytest.mark.parametrize(
    ("one", "two", "free"),
    [
        ("", "", False),
        ("<Script code='x := 1'/>", "", False),  # before both
        ("", "<Script code='x := 2'/>", True),
        ("", "<Script code='y := 2'/>", False),
        ("", "<SetBlackboard value='1' output_key='x'/>", True),
        ("", "<SetBlackboard value='1' output_key='{x}'/>", True),
        ("", "<UnsetBlackboard key='x'/>", True),
        ("", "<Look key='{x}'/>", True),
        ("", "<Look key='{@x}'/>", True),
        ("", "<Look key='{y}'/>", False),
        ("", "<Look key='x'/>", False),
        ("", "<Reads key='{x}'/>", False),
        ("", "<Writes key='{x}'/>", True),
        ("", "<Look _onSuccess='x := 1'/>", True),
        ("", "<Look _onFailure='x := 1'/>", True),  # it may be more careful than that
        ("", "<Look _onHalted='x := 1'/>", True),
        ("", "<Look _skipIf='x := 1'/>", True),
        ("", "<Own key='{x}'><C/></Own>", True),
        ("", "<SubTree ID='Other' z='{x}'/>", True),
        ("", "<SubTree ID='Other' z='{y}'/>", False),
        ("", "<SubTree ID='Other' z='1'/>", False),
        ("", "<SubTree ID='Other' x='{y}'/>", False),
        ("", "<SubTree ID='Other' _autoremap='true'/>", False),
        ("", "<SubTree ID='Same' _autoremap='true'/>", True),
    ],
)
def test_a_condition_has_one_answer_until_its_keys_may_be_written(
    one: str, two: str, free: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    others = (
        "<BehaviorTree ID='Other'><Set key='{z}'/></BehaviorTree>"
        "<BehaviorTree ID='Same'><Script code='x := 3'/></BehaviorTree>"
    )
    body = TWICE.format(one, two)
    text = (
        f"<root BTCPP_format='4' main_tree_to_execute='M'><BehaviorTree ID='M'>{body}"
        f"</BehaviorTree>{others}{MODEL}</root>"
    )
    # as if the program had written all keys: then nothing throws
    monkeypatch.setattr(Scripts, "may_throw", lambda *_: False)
    (report,) = gpsfsm.check(text, consistent=True).plans
    assert report.facts is not None
    assert report.facts.fewest_failures_to_give_up == (0 if free else 1)


@pytest.mark.parametrize(
    ("first", "second", "tied"),
    [
        ("if='x == 1'", "if=' x  ==  1 '", True),
        ("if=\"x == 'a b'\"", "if=\"x == 'a b'\"", True),
        ("if=\"x == 'a b'\"", "if=\"x == 'a  b'\"", False),
        ("if='x == 1'", "if='x == 2'", False),
    ],
)
def test_conditions_of_one_text_are_one(first: str, second: str, tied: bool) -> None:
    one, two = (
        f"<Precondition {each} else='SUCCESS'><A/></Precondition>" for each in (first, second)
    )
    machine = machine_of(f"<Sequence>{one}{two}</Sequence>")
    assert [len(each.runners) for each in machine.ties] == ([2] if tied else [1, 1])


def test_a_case_of_a_switch_may_be_a_key() -> None:
    """Whoever writes the key of the case may change the answer."""
    switch = (
        "<Switch2 variable='{x}' case_1='{y}' case_2='b'><AlwaysSuccess/><AlwaysSuccess/>"
        "<AlwaysFailure/></Switch2>"
    )
    for between, resets in (("<Script code='y := 1'/>", 1), ("<Script code='z := 1'/>", 0)):
        tie = machine_of(f"<Sequence>{switch}{between}{switch}</Sequence>").ties[0]
        assert len(tie.runners) == 2
        assert bool(tie.resets) is bool(resets), between


def test_conditions_of_two_trees_are_two() -> None:
    inner = "<Precondition if='x == 1' else='FAILURE'><A/></Precondition>"
    body = f"<Sequence><SubTree ID='T'/>{inner}</Sequence>"
    text = (
        f"<root BTCPP_format='4' main_tree_to_execute='M'><BehaviorTree ID='M'>{body}"
        f"</BehaviorTree><BehaviorTree ID='T'>{inner}</BehaviorTree></root>"
    )
    machine = read_plan(text).plan
    assert isinstance(machine, TreeMachine)
    assert [len(each.runners) for each in machine.ties] == [1, 1]


def test_without_consistent_a_condition_may_change_its_answer() -> None:
    assert facts_of(TWICE.format("", "")).fewest_failures_to_give_up == 0


def test_a_blackboard_check_that_answers_running_is_asked_again() -> None:
    body = (
        '<BlackboardCheckInt value_A="{x}" value_B="1" return_on_mismatch="RUNNING"><A/>'
        "</BlackboardCheckInt>"
    )
    facts = facts_of(body, 3)
    assert facts.stuck is Frequency.NEVER
    assert facts.completes is Frequency.SOMETIMES
    assert facts.machine is not None
    assert facts.machine.endless is Frequency.SOMETIMES


NAV2 = sorted(path.name for path in (SHARED / "trees" / "nav2").glob("*.xml"))


@pytest.mark.parametrize("name", NAV2 or ["none"])
def test_trees_of_nav2_are_decided(name: str, shared_corpus: Path) -> None:
    text = (shared_corpus / "trees" / "nav2" / name).read_text(encoding="utf-8")
    (report,) = gpsfsm.check(text).plans
    assert report.verdict is Verdict.ACCEPTED
    assert report.facts is not None
    assert report.facts.stuck is Frequency.NEVER
