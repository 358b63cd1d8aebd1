"""Behaviour trees → automaton: what is unfolded, what it is called, what cannot be expressed."""

from __future__ import annotations

import pytest

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.compile import TreePlan, compile_plan
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.compile.trees import unfold
from gpsfsm.compile.units import TreeMachine
from gpsfsm.model.report import Verdict
from gpsfsm.syntax.source import DEFAULT_LIMITS
from gpsfsm.syntax.trees import read_trees


def tree(body: str, version: int = 4, **others: str) -> str:
    rest = "".join(
        f'<BehaviorTree ID="{name}">{text}</BehaviorTree>' for name, text in others.items()
    )
    return (
        f'<root BTCPP_format="{version}" main_tree_to_execute="Main">'
        f'<BehaviorTree ID="Main">{body}</BehaviorTree>{rest}</root>'
    )


def plan_of(text: str) -> TreePlan:
    parsed = read_plan(text)
    assert isinstance(parsed.plan, TreePlan), parsed.problems
    return parsed.plan


def lost(body: str, version: int = 4) -> str:
    """The message that says why the tree is no plan; its machine is decided all the same."""
    text = tree(body, version)
    report = check_text(text, "t.xml", CheckOptions())
    assert report.verdict is not Verdict.UNDECIDED
    assert report.facts is not None
    assert report.facts.machine is not None
    forest = read_trees(text, "t.xml", DEFAULT_LIMITS).forest
    assert forest is not None
    unfolded = unfold(forest)
    assert unfolded.plan is None
    (message,) = (each.message for each in unfolded.problems if each.rule == "GP813")
    return message


def test_uses_of_one_node_have_paths_of_their_own_and_its_place() -> None:
    plan = plan_of(
        tree(
            '<Repeat num_cycles="2"><SubTree ID="Dock"/></Repeat>',
            Dock='<RetryUntilSuccessful num_attempts="2"><Go/></RetryUntilSuccessful>',
        )
    )
    base = "/root/BehaviorTree[2]/RetryUntilSuccessful[1]/Go[1]"
    assert [plan.path(runner) for runner in plan.runners] == [
        base,
        *(f"{base}@{use}" for use in (2, 3, 4)),
    ]
    assert len({(runner.line, runner.column) for runner in plan.runners}) == 1


@pytest.mark.parametrize(
    ("version", "node", "expected"),
    [
        (4, '<SubTree ID="Dock" goal="hall"/>', "hall"),
        (4, '<SubTree ID="Dock" goal="{place}"/>', "{place}"),
        (4, '<SubTree ID="Dock" goal="{=}"/>', "{goal}"),
        (4, '<SubTree ID="Dock"/>', "{goal}"),
        (3, '<SubTree ID="Dock" goal="place"/>', "{place}"),
        (3, '<SubTreePlus ID="Dock" goal="hall"/>', "hall"),
    ],
)
def test_ports_of_a_subtree_are_put_in(version: int, node: str, expected: str) -> None:
    plan = plan_of(tree(node, version, Dock='<Go to="{goal}" name="drive"/>'))
    (runner,) = plan.runners
    assert (runner.interface, runner.provider, runner.text("to")) == ("Go", "Go", expected)


def test_a_shared_blackboard_hands_over_through_two_subtrees() -> None:
    text = tree(
        '<SubTree ID="A" goal="hall"/>',
        A='<SubTree ID="B" _autoremap="true"/>',
        B='<Go to="{goal}"/>',
    )
    assert plan_of(text).runners[0].text("to") == "hall"


def test_equal_actions_are_those_with_equal_known_ports() -> None:
    plan = plan_of(
        tree(
            '<Sequence><Go to="1" name="a"/><Go to="1.0"/><Go to="{x}"/><Go to="{x}"/>'
            '<Go id="1"/><Go id="2"/></Sequence>'
        )
    )
    actions = [runner.action for runner in plan.runners]
    assert actions[0] == actions[1]
    assert len(set(actions)) == 5


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("<ReactiveSequence><A/><B/></ReactiveSequence>", "this ReactiveSequence ticks"),
        ("<ReactiveFallback><A/><B/></ReactiveFallback>", "this ReactiveFallback ticks"),
        ("<KeepRunningUntilFailure><A/></KeepRunningUntilFailure>", "expressed as a plan"),
        ('<Timeout msec="5"><A/></Timeout>', "cannot be expressed as a plan"),
        ('<Repeat num_cycles="-1"><A/></Repeat>', "without a limit (num_cycles=-1)"),
        ('<Repeat num_cycles="0"><A/></Repeat>', "(num_cycles=0) never runs its child"),
        ('<Repeat num_cycles="{n}"><A/></Repeat>', "num_cycles of this Repeat comes from"),
        ('<Go _skipIf="x > 1"/>', "the condition _skipIf of this Go"),
        (
            '<Parallel success_count="1" failure_count="1"><A/><B/></Parallel>',
            "depends on which come first",
        ),
        ("<Parallel><A/><AlwaysFailure/></Parallel>", "children that end at once"),
        ("<MyControl><A/><B/></MyControl>", "what the node MyControl does with its children"),
        (
            '<RetryUntilSuccessful num_attempts="2"><SequenceWithMemory><A/></SequenceWithMemory>'
            "</RetryUntilSuccessful>",
            "resumes where it failed",
        ),
        ('<Switch2 variable="{x}" case_1="1" case_2="2"><A/><B/><C/></Switch2>', "as a plan"),
    ],
)
def test_what_is_no_plan_is_said_and_becomes_a_machine(body: str, words: str) -> None:
    assert words in lost(body)


def test_what_is_lost_in_a_tree_that_does_not_run_is_no_matter() -> None:
    parsed = read_plan(tree("<A/>", Other='<Timeout msec="5"><A/></Timeout>'))
    assert parsed.plan is not None
    assert not parsed.lost


@pytest.mark.parametrize(
    "body",
    [
        "<ReactiveSequence><A/></ReactiveSequence>",
        '<ReactiveSequence><Script code="x:=1"/><A/></ReactiveSequence>',
        "<ReactiveFallback><AlwaysFailure/><A/></ReactiveFallback>",
        "<SequenceWithMemory><A/></SequenceWithMemory>",
        '<Delay delay_msec="100"><A/></Delay>',
        '<Sequence><SetBlackboard value="1" output_key="k"/><A _onSuccess="n:=2"/></Sequence>',
    ],
)
def test_what_makes_no_difference_is_read(body: str) -> None:
    report = check_text(tree(body), "t.xml", CheckOptions())
    assert report.facts is not None
    assert (report.facts.runners, report.facts.completes.value) == (1, "sometimes")
    assert {finding.rule for finding in report.findings} == {"GP302"}


def test_unfolding_ends_at_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gpsfsm.compile.trees.MAX_NODES", 2_000)
    huge = '<Repeat num_cycles="999999999">' * 150 + "<A/>" + "</Repeat>" * 150
    many = '<Repeat num_cycles="300">' * 2 + "<A/>" + "</Repeat>" * 2
    for body in (huge, many):
        forest = read_trees(tree(body), "t.xml", DEFAULT_LIMITS).forest
        assert forest is not None
        unfolded = unfold(forest)
        assert (unfolded.plan, unfolded.over) == (None, True)
        assert isinstance(read_plan(tree(body)).plan, TreeMachine)
        (problem,) = unfolded.problems
        assert problem.rule == "GP103"
        assert "more than 2,000 nodes" in problem.message


def test_findings_speak_of_trees_and_tell_a_place_once() -> None:
    text = tree(
        '<Sequence name="visit"><Inverter><BatteryLow/></Inverter>\n'
        '<RetryUntilSuccessful num_attempts="3"><Go to="hall"/></RetryUntilSuccessful></Sequence>'
    )
    report = check_text(text, "t.xml", CheckOptions())
    assert [finding.message for finding in report.findings] == [
        "2 of 5 outcomes make the tree fail (line 2: last child of a Fallback or "
        "Retry; line 1: an Inverter turns it into a failure); no failure is "
        "needed",
    ]
    assert not any("plan" in finding.hint for finding in report.findings)


def test_a_parallel_halts_so_nothing_waits_or_is_left_behind() -> None:
    text = tree("<Fallback><Parallel><A/><B/></Parallel><C/></Fallback>")
    report = check_text(text, "t.xml", CheckOptions())
    assert {finding.rule for finding in report.findings} == {"GP302"}
    assert report.facts is not None
    assert report.facts.join_deadlocks == ()
    # An executor that halts nothing would leave these running.
    assert len(report.facts.orphans) == 2


def test_the_fault_no_start_has_no_effect_on_a_tree() -> None:
    text = tree("<Parallel><A/><B/></Parallel>")  # whose children are started in any case
    options = CheckOptions(analysis=AnalysisOptions(faults=("no-start",)))
    report = check_text(text, "t.xml", options)
    assert report.facts is None
    assert "GP908" in {finding.rule for finding in report.findings}


def test_the_fingerprint_tells_trees_apart_and_forgets_names() -> None:
    def fingerprint(body: str) -> str:
        return compile_plan(plan_of(tree(body))).automaton.fingerprint

    plain = fingerprint("<Sequence><A/><B/></Sequence>")
    assert fingerprint('<Sequence name="x"><A/><B/></Sequence>') == plain
    assert fingerprint("<Fallback><A/><B/></Fallback>") != plain
    three = "<A/><B/><C/></Parallel>"
    two_of_three = fingerprint(f'<Parallel success_count="2" failure_count="2">{three}')
    assert fingerprint(f'<Parallel success_count="1" failure_count="3">{three}') != two_of_three


@pytest.mark.parametrize(
    ("ports", "fewest"), [("", 1), (' max_failures="2"', 2), (' max_failures="-1"', 3)]
)
def test_a_parallel_all_counts_failures_and_waits_for_all(ports: str, fewest: int) -> None:
    body = f"<ParallelAll{ports}><A/><B/><C/></ParallelAll>"
    report = check_text(tree(f"<Fallback>{body}<D/></Fallback>"), "t.xml", CheckOptions())
    assert report.facts is not None
    assert report.facts.orphans == ()  # none runs on
    assert report.facts.fewest_failures_to_give_up == fewest + 1
    assert report.facts.loaded is not None
    assert report.facts.loaded.peak == 3


def test_a_parallel_all_that_cannot_count_is_refused() -> None:
    for port in ("0", "4", "-4"):
        text = tree(f'<ParallelAll max_failures="{port}"><A/><B/><C/></ParallelAll>')
        parsed = read_plan(text)
        assert parsed.plan is None
        (problem,) = parsed.problems
        assert problem.rule == "GP811"
        assert "a ParallelAll of 3 children cannot fail with" in problem.message
    assert "max_failures of this ParallelAll comes from the blackboard" in lost(
        '<ParallelAll max_failures="{n}"><A/><B/></ParallelAll>'
    )
    at_once = tree("<ParallelAll><A/><AlwaysFailure/></ParallelAll>")
    facts = check_text(at_once, "t.xml", CheckOptions()).facts
    assert facts is not None
    assert facts.completes.value == "never"


def test_braces_in_format_3_are_part_of_the_key_of_a_subtree() -> None:
    def goal(tag: str, text: str) -> str:
        whole = f"""<root BTCPP_format="3" main_tree_to_execute="Main"><BehaviorTree ID="Main">
        <Sequence><{tag} ID="Go" to="{text}"/><Beep/></Sequence></BehaviorTree>
        <BehaviorTree ID="Go"><Roll goal="{{to}}"/></BehaviorTree></root>"""
        plan = read_plan(whole).plan
        assert plan is not None
        return plan.runners[0].text("goal")

    assert goal("SubTree", "spot") == goal("SubTreePlus", "{spot}") == "{spot}"
    assert goal("SubTree", "{spot}") == "{{spot}}"
    assert goal("SubTreePlus", "spot") == "spot"
