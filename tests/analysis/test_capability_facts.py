"""All answers about capabilities against brute force over every scenario and every order."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.analysis.decide import Decided, decide
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.capabilities.library import bind
from gpsfsm.compile import compile_plan
from tests import oracle
from tests.cases import many
from tests.oracle import par_all, par_any, plan, rec, seq
from tests.oracle.buffers import empty_answer, empty_flush, unflushed
from tests.oracle.capabilities import Described, Input, Output, Parameter, Prompt, World
from tests.oracle.clocks import energy, makespan, orphans, overlaps
from tests.oracle.orders import loaded
from tests.oracle.values import lost, missing, overwritten
from tests.strategies import constraints, faults
from tests.strategies_capabilities import (
    libraries,
    plans_over,
    races,
    to_library,
    with_own_providers,
)
from tests.support import facts_as_dict, plan_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from gpsfsm.analysis.options import SolverChoice

FREE, NO_START, HANG = frozenset[str](), frozenset({"no-start"}), frozenset({"hang"})
SOLVERS: tuple[SolverChoice, ...] = ("structural", "z3", "auto")
all_solvers = pytest.mark.parametrize("solver", SOLVERS)


def decided_over(
    whole: oracle.P,
    library: tuple[Described, ...],
    *,
    faults: Iterable[str] = (),
    consistent: bool = False,
    assumptions: tuple[str, ...] = (),
    solver: SolverChoice = "auto",
) -> Decided:
    """The verdicts of the product on a plan over a library."""
    plan = plan_of(whole)
    bindings = bind(plan, to_library(library))
    compiled = compile_plan(plan, start_chain="no-start" in faults, bindings=bindings)
    allowed = constraints_of(
        plan,
        faults=faults,
        consistent=consistent,
        assumptions=assumptions,
        bindings=compiled.bindings,
    )
    options = AnalysisOptions(
        faults=tuple(sorted(faults)), consistent=consistent, assumptions=assumptions, solver=solver
    )
    return decide(compiled, allowed, options)


# ---- one comparison per answer -----------------------------------------------------------------


def same_values(decided: Decided, world: World) -> None:
    paths, answer = world.system.paths, decided.answers["data_flow"]
    assert {(paths[e.runner], e.name): str(e.how) for e in answer.missing} == missing(world)
    assert {(paths[e.runner], e.name): str(e.how) for e in answer.overwritten} == overwritten(world)
    assert {(paths[e.source], e.name, paths[e.runner]) for e in answer.lost} == lost(world)


def same_prompts(decided: Decided, world: World) -> None:
    paths, answer = world.system.paths, decided.answers["prompts"]
    assert {paths[number] for number in answer.unflushed} == unflushed(world)
    assert {paths[number] for number in answer.empty_flush} == empty_flush(world)
    assert {(paths[e.runner], e.name) for e in answer.empty_answers} == empty_answer(world)


def same_overlaps(decided: Decided, world: World) -> None:
    """The answer names one pair for each control and resource, the first in document order."""
    paths = world.system.paths
    units = decided.deciders.compiled.units
    wanted = overlaps(world)
    named = set()
    for entry in decided.answers["overlaps"]:
        pair = paths[entry.first], paths[entry.second], entry.resource
        assert pair in wanted
        named.add((_element(decided, units, entry.block), *pair))
    for one, other, resource in wanted:
        order = world.system.index[one], world.system.index[other]
        assert any(
            (one.startswith(block + "/") or other.startswith(block + "/"))
            and kind == resource
            and (world.system.index[first], world.system.index[second]) <= order
            for block, first, second, kind in named
        ), (one, other, resource)


def _element(decided: Decided, units: Any, unit: int) -> str:
    plan = decided.deciders.compiled.automaton.plan
    return str(plan.path(units.elements[unit]))


def same_numbers(decided: Decided, world: World) -> None:
    facts = decided.facts()
    if facts is None:
        assert not world.runs
        return
    for bounds, wanted in ((facts.makespan, makespan(world)), (facts.energy, energy(world))):
        assert (None if bounds is None else (bounds.min, bounds.max)) == wanted
    assert set(facts.orphans) == orphans(world)
    assert facts.loaded is not None
    assert (facts.loaded.peak, facts.loaded.all) == loaded(world)


def same_declared_outcomes(decided: Decided, world: World, whole: oracle.P, **options: Any) -> None:
    """The facts of section 5 under declared outcomes."""
    wanted = oracle.facts(whole, faults=world.faults, constraint=world.allows, **options)
    assert decided.contradictory == (wanted is None)
    if wanted and any(one.described and one.described.duration for one in world.instances):
        del wanted["orphans"]  # they depend on the durations
    facts = facts_as_dict(decided.facts())
    assert facts is None or {name: facts[name] for name in wanted or {}} == wanted


QUESTIONS: dict[str, tuple[Callable[[Decided, World], None], dict[str, bool]]] = {
    "values": (same_values, {"values": True}),
    "prompts": (same_prompts, {"prompts": True}),
    "prompts that values reach": (same_prompts, {"prompts": True, "values": True}),
    "overlaps": (same_overlaps, {"clocks": True}),
    "overlaps that values reach": (same_overlaps, {"clocks": True, "values": True}),
    "numbers": (same_numbers, {"clocks": True}),
    "numbers that values reach": (same_numbers, {"clocks": True, "values": True}),
}
each_question = pytest.mark.parametrize("question", QUESTIONS)


# ---- plans that are easily got wrong -----------------------------------------------------------

HELD = (
    Described("Go", resources=("base",), duration=(1, 2), energy=(3, 4)),
    Described("Slow", resources=("base",), duration=(2, None), energy=(0, None)),
    Described("Tick", duration=(1, 1)),
    Described("Mute"),
)
TALK = (
    Described("Give", outputs=(Output("text"), Output("why", oracle.FAILED))),
    Described("Maybe", outputs=(Output("text", optional=True), Output("uuid"))),
    Described("Take", parameters=(Parameter("text", required=True),)),
    Described("Outside", inputs=(Input("text", required=True, sources=("external",)),)),
    Described(
        "Ask",
        parameters=(Parameter("uuid"), Parameter("flush", default=False)),
        outputs=(Output("text"),),
        prompt=Prompt(answer="text"),
    ),
    Described("Sure", never_fails=True, parameters=(Parameter("x"),), unless=(("x", 1),)),
)
_WORDS = (Parameter("t", type="string"), Parameter("free"))
TEXTS = (
    Described(
        "Sure",
        parameters=_WORDS,
        inputs=(Input("text", fallback="t", type="string"), Input("said", fallback="free")),
        never_fails=True,
        unless=(("text", "1"), ("said", 1)),
    ),
    Described(
        "Ask",
        parameters=(*_WORDS, Parameter("uuid", type="string"), Parameter("flush", default=False)),
        inputs=(Input("uuid", fallback="t", type="string"),),
        prompt=Prompt(),
    ),
    Described("Wait", parameters=_WORDS, inputs=(Input("s", fallback="t"),), duration=("s", "s")),
)
TIMED = (
    Described("Give", outputs=(Output("s", optional=True), Output("x", oracle.FAILED))),
    Described("Sure", never_fails=True, parameters=(Parameter("x"),), unless=(("x", 1),)),
    Described(
        "Wait",
        parameters=(Parameter("s", default=1, type="double"),),
        duration=("s", "s"),
        energy=(0, "s"),
    ),
    Described(
        "Fall",
        inputs=(Input("s", fallback="t", type="double"),),
        parameters=(Parameter("t", default=2, type="double"),),
        duration=("s", "s"),
    ),
    Described("Zero", duration=(0, 0), resources=("base",)),
    Described("Three", duration=(3, 3), resources=("base",)),
)
_ENDS = seq("Mute", par_any(seq(), seq("Go")))
TRAPS: dict[str, tuple[oracle.P, tuple[Described, ...]]] = {
    "two outcomes at the instant of the end": (plan(par_any(_ENDS, _ENDS)), HELD),
    "over when it begins": (plan(par_any(seq(), seq("Go", "Go"), seq("Go"))), HELD),
    "an orphan beside a later step": (plan(par_any("Go", "Tick"), "Go"), HELD),
    "a recovery beside what runs on": (plan(par_all("Go", "Tick"), rec("Slow")), HELD),
    "one after the other on the clock": (
        plan(par_all(seq("Tick", "Go"), seq("Tick", "Tick", "Tick", "Go"))),
        HELD,
    ),
    "too late for the clock": (plan(par_any("Tick", seq("Tick", "Go"), "Slow")), HELD),
    "recoveries drop values": (plan("Give", rec("Mute"), "Take", rec("Take text=$why")), TALK),
    "a parallel hands on what triggers it": (plan("Maybe", par_all("Take", "Take text=a")), TALK),
    "what arrives does not count": (plan("Unknown", "Outside"), TALK),
    "a failed fill": (plan("Ask uuid=a", rec("Ask uuid=a flush=true")), TALK),
    "a flush beside the fill": (plan(par_all("Ask uuid=a", "Ask uuid=a flush=true")), TALK),
    "a flush after the end": (plan(par_any("Give", seq("Ask uuid=a", "Ask flush=true"))), TALK),
    "a uuid that arrives": (plan("Ask uuid=a", "Maybe", "Ask uuid=b flush=true"), TALK),
    "a uuid that is empty": (plan("Ask uuid=", "Ask uuid= flush=true"), TALK),
    "an answer that nobody reads": (plan("Ask uuid=a", "Give"), TALK),
    "an empty answer": (plan("Ask uuid=a", "Take text=b"), TALK),
    "true is not 1": (plan("Sure x=true", "Take"), TALK),
    "unless": (plan("Sure x=1.0", "Sure x=2", "Take text=a"), TALK),
    "unless, and it arrives": (plan("Give", rec("Sure x=2"), "Sure x=2"), TIMED),
    "unless, and it may arrive": (plan("Unknown", "Sure x=2"), TIMED),
    "unless, a text that stands in": (plan("Sure t=1", "Sure t=01", "Sure t=1 text=2"), TEXTS),
    "unless, in both readings": (plan("Sure free=1.0", "Sure free=2", "Sure said=1"), TEXTS),
    "buffers of texts": (plan("Ask t=01", "Ask t=1 flush=true"), TEXTS),
    "a buffer of a text": (plan("Ask t=01", "Ask uuid=01 flush=true"), TEXTS),
    "a text is no duration": (plan(par_any("Wait t=2", "Wait s=3")), TEXTS),
    "a duration that may arrive": (plan(par_any(seq("Give", "Wait s=2"), "Three")), TIMED),
    "a duration that nobody knows": (plan("Unknown", "Wait"), TIMED),
    "a duration that does not arrive": (plan("Give", rec("Wait s=2"), "Wait s=3"), TIMED),
    "a duration of the fallback": (plan(par_any("Fall", "Fall t=3", "Fall s=4 t=5")), TIMED),
    "no time at all": (plan(par_any("Zero", seq("Zero", "Zero", "Three"), "Three")), TIMED),
}


@all_solvers
@pytest.mark.parametrize("name", TRAPS)
def test_traps(solver: SolverChoice, name: str) -> None:
    whole, library = with_own_providers(*TRAPS[name])
    for models in [FREE] if solver == "structural" else [FREE, NO_START, HANG]:
        world = World(whole, library, faults=models)
        answers = decided_over(whole, library, faults=models, solver=solver)
        same_declared_outcomes(answers, world, whole)
        for compare in (same_values, same_prompts, same_overlaps, same_numbers):
            compare(answers, world)


# ---- the comparisons ---------------------------------------------------------------------------


@each_question
@given(data=st.data())
def test_free_outcomes(question: str, data: st.DataObject) -> None:
    compare, kinds = QUESTIONS[question]
    library = data.draw(libraries(**kinds))
    whole = data.draw(plans_over(library, max_runners=6))
    world = World(whole, library)
    for solver in SOLVERS:
        compare(decided_over(whole, library, solver=solver), world)


@each_question
@given(data=st.data(), models=faults(), consistent=st.booleans())
def test_fault_models_and_declared_outcomes(
    question: str, data: st.DataObject, models: frozenset[str], consistent: bool
) -> None:
    compare, kinds = QUESTIONS[question]
    library = data.draw(libraries(**kinds, outcomes=data.draw(st.booleans())))
    whole = data.draw(plans_over(library, max_runners=4))
    world = World(whole, library, faults=models, consistent=consistent)
    answers = decided_over(whole, library, faults=models, consistent=consistent)
    assert answers.contradictory == (not world.runs)
    if world.runs:
        compare(answers, world)


@each_question
@given(data=st.data(), models=faults())
def test_assumptions(question: str, data: st.DataObject, models: frozenset[str]) -> None:
    compare, kinds = QUESTIONS[question]
    library = data.draw(libraries(**kinds))
    whole = data.draw(plans_over(library, max_runners=4))
    assume(oracle.runner_paths(whole))
    constraint = data.draw(constraints(whole, faults=models))
    world = World(whole, library, faults=models, constraint=constraint)
    answers = decided_over(whole, library, faults=models, assumptions=(str(constraint),))
    assert answers.contradictory == (not world.runs)
    if world.runs:
        compare(answers, world)


@all_solvers
@given(race=races(), data=st.data())
def test_races(
    solver: SolverChoice, race: tuple[oracle.P, tuple[Described, ...]], data: st.DataObject
) -> None:
    whole, library = race
    models = FREE if solver == "structural" else data.draw(faults())
    world = World(whole, library, faults=models)
    answers = decided_over(whole, library, faults=models, solver=solver)
    same_overlaps(answers, world)
    same_numbers(answers, world)


@all_solvers
@given(data=st.data(), models=faults(), consistent=st.booleans())
def test_the_facts_of_section_5_under_declared_outcomes(
    solver: SolverChoice, data: st.DataObject, models: frozenset[str], consistent: bool
) -> None:
    library = data.draw(libraries(values=data.draw(st.booleans()), outcomes=True))
    if solver == "structural":
        models, consistent = FREE, False
        library = tuple(  # more is not for the structural pass
            replace(described, may_hang=False, never_succeeds=False) for described in library
        )
    whole = data.draw(plans_over(library, max_runners=5))
    world = World(whole, library, faults=models, consistent=consistent)
    answers = decided_over(whole, library, faults=models, consistent=consistent, solver=solver)
    same_declared_outcomes(answers, world, whole, consistent=consistent)


@settings(max_examples=many(40))
@given(data=st.data())
def test_both_ways_agree_on_larger_plans(data: st.DataObject) -> None:
    kinds = {"values": True, "prompts": True, "clocks": data.draw(st.booleans())}
    library = data.draw(libraries(**kinds))
    whole = data.draw(plans_over(library, min_runners=8, max_runners=20))
    by_structure = decided_over(whole, library, solver="structural")
    by_solver = decided_over(whole, library, solver="z3")
    assert by_structure.answers == by_solver.answers
    assert by_structure.facts() == by_solver.facts()
