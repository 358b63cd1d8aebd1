"""Which actions a task means, where a provider says what their parameters are."""

from __future__ import annotations

import pytest

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.capabilities.library import Library
from gpsfsm.compile import compile_plan
from gpsfsm.model.capability import Input, Interface, Output, Parameter, Provider, ValueType
from gpsfsm.tasks.deciding import decide_task
from gpsfsm.tasks.ltlf import parse_formula
from gpsfsm.tasks.monitor import Matching
from gpsfsm.tasks.task import Pattern, Place, Rule, Step, Task
from tests import oracle
from tests.support import plan_of

GO = Provider(
    "d/Go",
    "d/Go",
    described=True,
    configuration=(
        Parameter("x", ValueType.DOUBLE, aliases=("target_x",)),
        Parameter("own", ValueType.BOOL, default=True, aliases=("own_audio",)),
        Parameter("text", ValueType.STRING),
        Parameter("spare", ValueType.STRING),
        Parameter("to", ValueType.STRING, default="Bay"),
        Parameter("free"),
    ),
    inputs=(Input("said", ValueType.STRING, fallback="spare"),),
)
GIVE = Provider(
    "d/Give", "d/Give", described=True, outputs=(Output("x", ValueType.DOUBLE), Output("to"))
)
LIBRARY = Library(interfaces=(Interface("d/Go"), Interface("d/Give")), providers=(GIVE, GO))


def matching_of(*words: str) -> Matching:
    runners = plan_of(oracle.plan(*(described(each) for each in words))).runners
    return Matching(runners, [LIBRARY.bind(each) for each in runners])


def described(words: str) -> oracle.R:
    return oracle.R(words, provider=words.partition(" ")[0])


@pytest.mark.parametrize(
    ("name", "value", "written", "meant"),
    [
        ("own", True, "d/Go own=true", True),
        ("own", True, "d/Go own_audio=true", True),  # an alias
        ("own", True, "d/Go", True),  # the default
        ("own", True, "d/Go own=false", False),
        ("own", True, "d/Go own_audio=false", False),
        ("own_audio", True, "d/Go own=true", True),
        ("own_audio", True, "d/Go", True),
        ("own_audio", False, "d/Go", False),
        ("target_x", 1, "d/Go x=1", True),
        ("x", 1, "d/Go target_x=1.0", True),
        ("target_x", 1, "d/Go target_x=1 x=2", False),  # the name wins over its alias
        ("x", 2, "d/Go target_x=1 x=2", True),
        ("text", "42", "d/Go text=42", True),  # a text is a text, whatever it looks like
        ("text", 42, "d/Go text=42", True),
        ("text", "42", "d/Go text=042", False),
        ("text", 42, "d/Go text=042", True),
        ("free", "1", "d/Go free=1", True),
        ("free", 1, "d/Go free=1", True),
        ("said", "7", "d/Go spare=7", True),  # the fallback
        ("said", "7", "d/Go spare=7 said=8", False),
        ("other", 1, "d/Go other=1", True),  # nobody describes it, but it is written
        ("other", 1, "d/Go", False),
        ("own", True, "d/Give", False),
    ],
)
def test_aliases_defaults_and_fallbacks_count(
    name: str, value: bool | int | str, written: str, meant: bool
) -> None:
    matching = matching_of(written)
    assert matching(Pattern("p", parameters=((name, value),)), 0) is meant
    place = Place("there", ((name, value),))
    assert matching(Pattern("p", place=place), 0) is meant


def test_a_place_may_be_the_default_or_a_text_that_looks_like_a_number() -> None:
    matching = matching_of("d/Go", "d/Go to=Bay", "d/Go to=7", "d/Go to=07")
    bay, seven = (Pattern(name, place=Place(name, ())) for name in ("Bay", "7"))
    assert [matching(bay, number) for number in range(4)] == [True, True, False, False]
    assert [matching(seven, number) for number in range(4)] == [False, False, True, False]


def test_actions_that_are_equal_and_work_with_other_texts_are_told_apart() -> None:
    matching = matching_of("d/Go text=1", "d/Go text=01", "d/Go text=1")
    assert matching.runners[0].action == matching.runners[1].action
    pattern = Pattern("p", parameters=(("text", "01"),))
    assert [matching(pattern, number) for number in range(3)] == [False, True, False]


def test_a_runner_that_nobody_describes_matches_by_its_attributes() -> None:
    runners = plan_of(oracle.plan("d/Go own_audio=true")).runners
    for name, meant in (("own_audio", True), ("own", False)):
        pattern = Pattern("p", parameters=((name, True),))
        assert Matching(runners)(pattern, 0) is meant


@pytest.mark.parametrize(
    ("place", "whole", "fulfilled"),
    [
        (Place("dock", (("target_x", 1),)), ["d/Go target_x=1"], True),
        (Place("dock", (("target_x", 1),)), ["d/Go x=1"], True),
        (Place("dock", (("target_x", 1),)), ["d/Give", "d/Go target_x=1"], None),
        (Place("dock", (("target_x", 1),)), ["d/Give", "d/Go x=1"], None),
        (Place("dock", (("x", 1),)), ["d/Give", "d/Go target_x=1"], None),
        (Place("Bay", ()), ["d/Go"], True),
        (Place("Bay", ()), ["d/Give", "d/Go"], None),  # what arrives wins over the default
        (Place("dock", (("free", 1),)), ["d/Give", "d/Go free=1"], True),
    ],
)
def test_a_step_that_an_arriving_value_decides_is_undecided(
    place: Place, whole: list[str], fulfilled: bool | None
) -> None:
    task = Task(steps=(Step((Pattern("there", ("Go",), place=place),)),), others=True)
    assert fulfils(task, whole) is fulfilled


@pytest.mark.parametrize(
    ("pattern", "whole", "fulfilled"),
    [
        (Pattern("p", ("Go",), (("own_audio", True),)), ["d/Go"], False),
        (Pattern("p", ("Go",), (("target_x", 1),)), ["d/Give", "d/Go x=7"], None),
        (Pattern("p", ("Go",), (("target_x", 1),)), ["d/Go x=7"], True),
        (Pattern("p", ("Go",), place=Place("Lab", ())), ["d/Go"], True),
        (Pattern("p", ("Go",), place=Place("Lab", ())), ["d/Give", "d/Go"], None),
    ],
)
def test_a_rule_that_an_arriving_value_decides_is_undecided(
    pattern: Pattern, whole: list[str], fulfilled: bool | None
) -> None:
    rule = Rule("never", "never", parse_formula("G !start(p)"))
    assert fulfils(Task(rules=(rule,), patterns=(pattern,)), whole) is fulfilled


def fulfils(task: Task, whole: list[str]) -> bool | None:
    plan = plan_of(oracle.plan(*(described(each) for each in whole)))
    compiled = compile_plan(plan, bindings=tuple(map(LIBRARY.bind, plan.runners)))
    return decide_task(compiled, constraints_of(plan, bindings=compiled.bindings), task).fulfilled
