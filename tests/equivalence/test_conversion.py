"""Conversion: what is written does the same, here and in the real BehaviorTree.CPP."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.compile import compile_plan
from gpsfsm.compile.formats import CannotSayError, formats
from gpsfsm.compile.formats.scxml_writing import write_regions
from gpsfsm.compile.plan_text import read_plan, read_plan_or_machine
from gpsfsm.equivalence import compare, convert_plan, targets
from gpsfsm.errors import InternalError, UsageError
from gpsfsm.model.plan import Plan
from tests.analysis.machines.random_machines import automaton_of, machine
from tests.compile.formats.statecharts import Chart
from tests.compile.test_trees import tree
from tests.equivalence.pairs import seeded
from tests.equivalence.test_normal_form import trees
from tests.oracle import P, to_xml
from tests.oracle.btcpp import engine, play
from tests.strategies import plans
from tests.support import plan_of

CORPUS = Path(__file__).parents[2] / "corpus"


def converted(plan: Plan, to: str) -> str | CannotSayError:
    try:
        return convert_plan(plan, to)
    except CannotSayError as error:
        return error


def test_the_targets_are_those_that_help_names() -> None:
    assert targets() == ("plan", "scxml", "tree", "yasmin")


@given(plans(max_runners=8, max_depth=4))
def test_a_plan_becomes_a_tree_and_a_plan_again(whole: P) -> None:
    plan = plan_of(to_xml(whole))
    text = converted(plan, "tree")
    if isinstance(text, CannotSayError):
        assert text.why.startswith(("nothing ever triggers it", "a tree has one name for it"))
        return
    again = read_plan(text).plan
    assert isinstance(again, Plan)
    back = read_plan(convert_plan(again, "plan")).plan
    assert back is not None
    assert compare(plan, back) is None


def test_an_unknown_format_is_refused_with_all_formats() -> None:
    plan = plan_of('<Plan><Runner interface="a/B" provider="a/B"/></Plan>')
    with pytest.raises(UsageError) as refused:
        convert_plan(plan, "promela")
    assert str(refused.value) == (
        "there is no format 'promela'; the formats are: "
        "dot, graphml, json, mermaid, plan, scxml, tree, yasmin"
    )


@pytest.mark.parametrize("name", ["ID", "_skipIf"])
def test_a_parameter_that_means_something_else_in_a_tree_is_refused(name: str) -> None:
    plan = plan_of(f'<Plan><Runner interface="a/B" provider="a/B" {name}="x"/></Plan>')
    with pytest.raises(CannotSayError, match=f"{name}='x' means something else in a tree"):
        convert_plan(plan, "tree")


@given(trees())
def test_a_tree_becomes_a_plan_or_says_what_no_plan_can_say(body: str) -> None:
    plan = read_plan(tree(body)).plan
    assert plan is not None
    text = converted(plan, "plan")
    if isinstance(text, CannotSayError):
        words = ("Inverter", "Force", "Parallel", "IfThenElse", "Always")
        assert any(word in body for word in words)
        assert text.why.startswith(("a plan cannot", "it is a machine"))
        return
    assert text.startswith("<Plan>")


@given(plans(max_runners=5, max_depth=3), st.integers(0, 2**20))
def test_the_real_engine_runs_what_a_plan_becomes(whole: P, seed: int) -> None:
    """It starts the same actions in the same order, where they come one after the other."""
    engine()
    plan = plan_of(to_xml(whole))
    text = converted(plan, "tree")
    if isinstance(text, CannotSayError):
        return
    names = list(dict.fromkeys(each.interface for each in plan.runners))
    short = {name: f"A{number}" for number, name in enumerate(names)}
    for name, other in short.items():
        text = text.replace(f'<Action ID="{name}"', f'<Action ID="{other}"')
    body = text[: text.index("  <TreeNodesModel>")] + "</root>"
    for attribute in {name for each in plan.runners for name in each.parameters}:
        assert attribute  # own nodes of the wheel have no ports
        body = "\n".join(_without(line, attribute) for line in body.splitlines())
    chance = seeded(seed)
    run = play(body, short.values(), lambda *_: (1, chance.choice(("SUCCESS", "FAILURE"))))
    assert run.status in ("SUCCESS", "FAILURE")


def _without(line: str, attribute: str) -> str:
    head, before, rest = line.partition(f' {attribute}="')
    return head + rest[rest.index('"') + 1 :] if before and "<Action" in line else line


@pytest.mark.parametrize("to", ["tree", "plan", "scxml", "yasmin"])
def test_plans_of_the_corpus_are_converted_or_refused_at_a_node(to: str) -> None:
    said = 0
    for path in sorted((CORPUS / "plans").glob("*.xml")):
        plan = read_plan_or_machine(path.read_bytes(), file=str(path)).plan
        if plan is None:
            continue
        text = converted(plan, to)
        said += isinstance(text, str)
        if isinstance(text, CannotSayError):
            assert to == "yasmin", text
            assert text.path in {plan.path(element) for element in plan.elements}
    assert said >= 9


def test_real_plans_are_converted(shared_corpus: Path) -> None:
    for path in sorted((shared_corpus / "plans").rglob("*.xml")):
        plan = read_plan_or_machine(path.read_bytes(), file=str(path)).plan
        if plan is not None:
            for to in targets():
                convert_plan(plan, to)


@pytest.mark.parametrize(
    ("body", "to", "why"),
    [
        ("<Inverter><A/></Inverter>", "plan", "a plan cannot turn a success into a failure"),
        ('<A goal="{g}"/>', "plan", "its port goal reads {g} from the blackboard"),
        ('<KeepRunningUntilFailure><A/></KeepRunningUntilFailure>', "plan", "it is a machine"),
        (
            '<Parallel success_count="1" failure_count="1"><A/><B/></Parallel>',
            "scxml",
            "a join of some of its inputs that can come again",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_said_is_named(body: str, to: str, why: str) -> None:
    plan = read_plan(tree(body)).plan
    assert plan is not None
    with pytest.raises(CannotSayError) as caught:
        convert_plan(plan, to)
    assert caught.value.why.startswith(why)


def test_a_loop_becomes_a_chart() -> None:
    plan = read_plan(
        tree('<RetryUntilSuccessful num_attempts="-1"><A/></RetryUntilSuccessful>')
    ).plan
    assert plan is not None
    assert '<transition event="A.failed" target="A"/>' in convert_plan(plan, "scxml")


@pytest.mark.parametrize(
    ("lines", "to", "why"),
    [
        (["start SUCCEEDED end"], "yasmin", "the machine ends before a state runs"),
        (
            ["start SUCCEEDED a", "a SUCCEEDED j", "a FAILED j", "j SUCCEEDED a"],
            "yasmin",
            "it fires again only once all its inputs have come",
        ),
        (
            ["start SUCCEEDED a", "a SUCCEEDED j", "a FAILED j", "j SUCCEEDED a"],
            "scxml",
            "a join of some of its inputs that can come again",
        ),
    ],
)
def test_a_machine_that_has_no_counterpart_is_refused(lines: list[str], to: str, why: str) -> None:
    """They were internal errors: what was written did something else."""
    text = converted(automaton_of(machine(*lines, j=1)).plan, to)
    assert isinstance(text, CannotSayError)
    assert text.why == why


def test_a_join_of_the_start_alone_is_not_armed_again() -> None:
    """Its macrostep would never end."""
    lines = ("start SUCCEEDED a", "start SUCCEEDED j", "j SUCCEEDED b", "a SUCCEEDED end")
    text = write_regions(automaton_of(machine(*lines, j=1)))
    chart = Chart(text)
    (moment,) = chart.first()
    active = {each for each in chart.active(moment.at) if each.endswith("_active")}
    assert sorted(each[0] for each in active) == ["a", "b"]


def test_what_does_something_else_is_not_written(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = plan_of('<Plan><Runner interface="a/B" provider="a/B"/></Plan>')
    other = '<Plan><Runner interface="a/C" provider="a/C"/></Plan>'
    chosen = formats()["plan"]
    wrong = type(chosen)("plan", "", chosen.recognises, None, lambda _: other)
    monkeypatch.setitem(formats(), "plan", wrong)
    with pytest.raises(InternalError, match="does something else"):
        convert_plan(plan, "plan")
    assert compile_plan(plan).automaton.runners
