"""Makespan, energy and loading: by hand, both ways against each other, and against brute force."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gpsfsm.analysis.constraints import Constraints, constraints_of
from gpsfsm.analysis.decide import decide
from gpsfsm.analysis.decisions import energy, loading, makespan
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.analysis.solver import Solver
from gpsfsm.analysis.structure import Structure
from gpsfsm.analysis.timing.clocks import (
    Clocks,
    RealSolver,
    earliest_bounds,
    free_durations,
    greatest,
)
from gpsfsm.analysis.timing.loads import UNKNOWN
from gpsfsm.compile import Compiled, compile_plan
from gpsfsm.model.capability import Binding, Interface, Outcomes, Provider, Span
from gpsfsm.model.event import Outcome
from tests import oracle
from tests.cases import many
from tests.oracle import C, P, par_all, par_any, plan, rec, seq
from tests.oracle.capabilities import Described, World
from tests.oracle.clocks import energy as energy_by_force
from tests.oracle.clocks import makespan as makespan_by_force
from tests.oracle.orders import loaded
from tests.strategies import ACTIONS, PROVIDERS, constraints, faults, plans
from tests.support import plan_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from gpsfsm.analysis.options import Purse
    from gpsfsm.model.plan import Plan

Bounds = tuple[float, float | None] | None
INTERFACES = sorted({action.split()[0] for action in ACTIONS})


def _span(bounds: Any) -> Span | None:
    return None if bounds is None else Span(*bounds)


def _binding(described: Described) -> Binding:
    provider = Provider(
        described.provider,
        described.interface,
        outcomes=Outcomes(
            never_fails=described.never_fails,
            never_succeeds=described.never_succeeds,
            may_hang=described.may_hang,
        ),
        duration=_span(described.duration),
        energy=_span(described.energy),
    )
    return Binding(Interface(described.interface), provider, {})


def bindings_of(whole: Plan, library: Iterable[Described]) -> tuple[Binding | None, ...]:
    described = {(one.interface, one.provider): _binding(one) for one in library}
    return tuple(described.get((runner.interface, runner.provider)) for runner in whole.runners)


def takes(name: str, *bounds: float | None, sure: bool = False) -> Described:
    """A runner whose duration and energy have these bounds; ``sure``: it never fails."""
    least, most = bounds if len(bounds) == 2 else (bounds[0], bounds[0])
    assert least is not None
    span = (least, most)
    return Described(name, "demo_runners/Demo", duration=span, energy=span, never_fails=sure)


def both(module: Any, whole: P, library: Sequence[Described] = ()) -> Any:
    """The answer of an analysis, after both ways were seen to agree."""
    tree = plan_of(whole)
    bindings = bindings_of(tree, library)
    compiled = compile_plan(tree, bindings=bindings)
    limits = constraints_of(tree, bindings=bindings)
    assert limits.independent
    answer = module.by_structure(Structure(compiled, limits))
    assert answer == module.by_solver(Solver(compiled, limits))
    return answer


def by_solver(module: Any, whole: P, library: Sequence[Described]) -> Any:
    """The answer of an analysis, where only z3 decides."""
    tree = plan_of(whole)
    bindings = bindings_of(tree, library)
    compiled = compile_plan(tree, bindings=bindings)
    return module.by_solver(Solver(compiled, constraints_of(tree, bindings=bindings)))


A = takes("d/A", 2, 5)
B = takes("d/B", 3, 4)
E = takes("d/E", 1, 10)
SURE_A = takes("d/A", 2, 5, sure=True)
SURE_B = takes("d/B", 3, 4, sure=True)
SURE_E = takes("d/E", 1, 10, sure=True)


@pytest.mark.parametrize(
    ("whole", "library", "expected"),
    [
        pytest.param(plan("d/A"), [A], (2, 5), id="runner"),
        pytest.param(plan("d/A", "d/B"), [A, B], (2, 9), id="sequence: A fails, or both"),
        pytest.param(plan("d/A", "d/B"), [SURE_A, SURE_B], (5, 9), id="sequence that succeeds"),
        pytest.param(plan("d/A", "d/B"), [SURE_A, B], (5, 9), id="sequence that fails late"),
        pytest.param(plan("d/A", rec("d/B")), [A, B], (2, 9), id="guard"),
        pytest.param(plan("d/A", rec("d/B")), [SURE_A, B], (2, 5), id="guard of what never fails"),
        pytest.param(
            plan("d/A", rec("d/B"), rec("d/E")), [A, B, E], (2, 19), id="guard of a guard"
        ),
        pytest.param(
            plan("d/A", rec("d/B", "d/E")), [A, SURE_B, E], (2, 9), id="the second is not reached"
        ),
        pytest.param(plan(par_all("d/A", "d/B")), [SURE_A, SURE_B], (3, 5), id="all succeed"),
        pytest.param(plan(par_all("d/A", "d/B")), [A, B], (2, 5), id="all: the first failure"),
        pytest.param(plan(par_all("d/A", "d/E")), [SURE_A, E], (1, 10), id="all: one can fail"),
        pytest.param(plan(par_any("d/A", "d/E")), [A, E], (1, 10), id="any: one alone"),
        pytest.param(plan(par_any("d/A", "d/E")), [SURE_A, E], (1, 5), id="any: one is sure"),
        pytest.param(plan(par_any("d/A", "d/B")), [SURE_A, SURE_B], (2, 4), id="any: both are"),
        pytest.param(plan(par_any("d/A", C("sequential"))), [A], (0, 0), id="any at once"),
        pytest.param(plan(C("sequential"), "d/A"), [A], (2, 5), id="an empty control"),
        pytest.param(plan(rec("d/B"), "d/A"), [A, B], (2, 5), id="a dead recovery"),
        pytest.param(plan("d/A", "d/X"), [A], (2, None), id="undeclared"),
        pytest.param(plan("d/X", "d/A"), [A], (0, None), id="the undeclared one fails first"),
        pytest.param(plan(par_any("d/A", "d/X")), [SURE_A], (0, 5), id="undeclared, but in vain"),
        pytest.param(plan("d/A"), [takes("d/A", 2, None)], (2, None), id="no greatest"),
        pytest.param(  # the exact sum of the two floats, rounded once
            plan("d/A", "d/B"),
            [takes("d/A", 0.1), takes("d/B", 0.2)],
            (0.1, 0.1 + 0.2),
            id="floats",
        ),
        pytest.param(plan("d/X"), [], None, id="nothing declared"),
        pytest.param(plan(rec("d/A")), [A], None, id="nothing reachable declared"),
    ],
)
def test_makespan_by_hand(
    whole: P, library: list[Described], expected: tuple[float, float | None] | None
) -> None:
    assert both(makespan, whole, library) == expected


@pytest.mark.parametrize(
    ("whole", "library", "expected"),
    [
        pytest.param(plan("d/A"), [A], (2, 5), id="runner"),
        pytest.param(plan("d/A", "d/B"), [A, B], (2, 9), id="sequence"),
        pytest.param(plan("d/A", rec("d/B")), [A, B], (2, 9), id="guard"),
        pytest.param(plan(par_all("d/A", "d/B")), [A, B], (5, 9), id="all go on to their end"),
        pytest.param(plan(par_any("d/A", "d/B")), [A, B], (5, 9), id="any leaves orphans"),
        pytest.param(
            plan(par_any("d/A", seq("d/B", "d/E"))), [A, B, E], (5, 19), id="orphans go on too"
        ),
        pytest.param(
            plan(par_all(seq("d/A", "d/B"), "d/E")), [A, SURE_B, SURE_E], (3, 19), id="one can fail"
        ),
        pytest.param(plan("d/A", "d/X"), [A], (2, 5), id="undeclared counts as nothing"),
        pytest.param(plan("d/A"), [takes("d/A", 2, None)], (2, None), id="no greatest"),
        pytest.param(plan("d/X"), [], None, id="nothing declared"),
    ],
)
def test_energy_by_hand(
    whole: P, library: list[Described], expected: tuple[float, float | None] | None
) -> None:
    assert both(energy, whole, library) == expected


_AT_ONCE = par_any(C("sequential"), "d/Y")


@pytest.mark.parametrize(
    ("whole", "peak", "kinds"),
    [
        pytest.param(plan(), 0, 0, id="empty"),
        pytest.param(plan("d/A", "d/B", "d/C"), 1, 3, id="sequence"),
        pytest.param(plan(par_all("d/A", "d/A")), 1, 1, id="equal runners are loaded once"),
        pytest.param(plan(par_all("d/A", seq("d/A", "d/B"), "d/C")), 3, 3, id="side by side"),
        pytest.param(plan(par_any("d/A", "d/B"), "d/C"), 2, 3, id="an orphan beside what follows"),
        pytest.param(
            plan(par_any("d/A", "d/B", "d/D"), "d/C"), 3, 4, id="two orphans beside what follows"
        ),
        pytest.param(
            plan(par_all("d/A", "d/B"), rec("d/C", "d/D")), 2, 4, id="orphans of a failed block"
        ),
        pytest.param(plan(rec("d/A"), "d/B"), 1, 2, id="dead"),
        pytest.param(plan("d/A", par_any(C("sequential"), "d/Y", "d/Z")), 2, 3, id="at the end"),
        pytest.param(
            plan(par_any(C("sequential"), seq("d/Y", par_all("d/A", "d/B")))), 1, 3, id="too late"
        ),
        pytest.param(
            plan(par_any(seq("d/A", _AT_ONCE), seq("d/A", par_any(C("sequential"), "d/Z")))),
            2,
            3,
            id="two outcomes at one instant",
        ),
    ],
)
def test_loading_by_hand(whole: P, peak: int, kinds: int) -> None:
    loads = both(loading, whole)
    assert (loads.peak, loads.all) == (peak, kinds)


def test_numbers_that_differ_contradict_unless_one_is_unknown() -> None:
    """Both deciders are asked, so a wrong one would be noticed."""
    two = loading.Answer(2, 3)
    assert two == loading.Answer(2, 3) == loading.Answer(UNKNOWN, 3)
    assert two != loading.Answer(1, 3)
    assert two != loading.Answer(2, 4)


_AMOUNTS = st.none() | st.tuples(
    st.sampled_from([0, 1, 2, 0.125, 7.5]), st.sampled_from([None, 2, 3, 8, 20.25])
).map(lambda pair: (pair[0], None if pair[1] is None else max(pair[0], pair[1])))


def libraries() -> st.SearchStrategy[list[Described]]:
    """What is known about the runners of ``plans()``."""

    def one(interface: str, provider: str) -> st.SearchStrategy[Described | None]:
        return st.none() | st.builds(
            Described,
            st.just(interface),
            st.just(provider),
            duration=_AMOUNTS,
            energy=_AMOUNTS,
            never_fails=st.sampled_from([False, False, True]),
            may_hang=st.sampled_from([False, False, False, True]),
        )

    pairs = [one(interface, provider) for interface in INTERFACES for provider in PROVIDERS]
    return st.tuples(*pairs).map(lambda library: [each for each in library if each is not None])


@settings(max_examples=many(100))
@given(
    whole=plans(max_runners=6),
    library=libraries(),
    models=st.just(frozenset[str]()) | faults(),
    consistent=st.booleans(),
    data=st.data(),
)
def test_all_ways_agree_with_brute_force(
    whole: P,
    library: list[Described],
    models: frozenset[str],
    consistent: bool,
    data: st.DataObject,
) -> None:
    constraint = None
    if oracle.runner_paths(whole) and data.draw(st.booleans()):
        constraint = data.draw(constraints(whole, faults=models))
    world = World(whole, library, faults=models, consistent=consistent, constraint=constraint)
    assume(world.runs)
    tree = plan_of(whole)
    bindings = bindings_of(tree, library)
    texts = [] if constraint is None else [str(constraint)]
    limits = constraints_of(
        tree, faults=models, consistent=consistent, assumptions=texts, bindings=bindings
    )
    compiled = compile_plan(tree, bindings=bindings, start_chain=limits.no_start)
    load = loaded(world)
    assert load is not None
    expected: dict[Any, Any] = {
        makespan: makespan_by_force(world),
        energy: energy_by_force(world),
        loading: loading.Answer(*load),
    }
    for module, wanted in expected.items():
        assert module.by_solver(Solver(compiled, limits)) == wanted
        if limits.independent:
            answer = module.by_structure(Structure(compiled, limits))
            assert answer == wanted
            assert module is not loading or answer.peak != UNKNOWN


@st.composite
def described_plans(draw: st.DrawFn) -> tuple[Compiled, Constraints]:
    """A plan whose instances all differ, with outcomes that are independent."""
    tree = plan_of(draw(plans(max_runners=14)))
    bindings = tuple(
        draw(st.none() | st.builds(Described, st.just("d/A"), duration=_AMOUNTS, energy=_AMOUNTS))
        for _ in tree.runners
    )
    compiled = compile_plan(tree, bindings=tuple(one and _binding(one) for one in bindings))
    allowed = tuple(
        draw(st.sampled_from([both_ways, both_ways, both_ways - {Outcome.FAILED}]))
        for both_ways in constraints_of(tree).allowed
    )
    return compiled, Constraints(allowed)


@settings(max_examples=many(100))
@given(case=described_plans())
def test_both_ways_agree_on_larger_plans(case: tuple[Compiled, Constraints]) -> None:
    for module in (makespan, energy, loading):
        by_structure = module.by_structure(Structure(*case))  # type: ignore[attr-defined]
        assert by_structure == module.by_solver(Solver(*case))  # type: ignore[attr-defined]


@given(low=st.integers(-9, 9), more=st.integers(0, 30), values=st.sets(st.integers(-9, 40)))
def test_the_search_finds_the_greatest_value(low: int, more: int, values: set[int]) -> None:
    values = {value for value in values if value <= low + more} | {low}

    def find(target: int) -> int | None:
        return min((value for value in values if value >= target), default=None)

    assert greatest(low, low + more, find) == max(values)


def test_exact_clocks_show_one_time_each() -> None:
    tree = plan_of(plan(par_any("d/A", "d/B"), par_all("d/A", "d/E")))
    compiled = compile_plan(tree)
    real = RealSolver(Solver(compiled, constraints_of(tree)))
    automaton = compiled.automaton
    texts, assertions = free_durations([(2, 5), (3, 4), (2, 5), (1, 10)])
    bounds = earliest_bounds(automaton, real.constraints, [2, 3, 2, 1])
    clocks = Clocks(automaton, real.encoding, texts, sense="exact", inside=bounds)
    real.tell([*assertions, *clocks.definitions])
    done = real.encoding.triggered(automaton.complete)
    clock = f"c{automaton.complete}"
    # the first of two that take 2 to 5 and 3 to 4, then the last of 2 to 5 and 1 to 10
    for number, expected in ((3.9, False), (4, True), (15, True), (15.1, False)):
        assert real.must_check([real.name(f"(and {done} (= {clock} {number}))")]) is expected


def test_the_search_for_the_peak_keeps_the_limit_of_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    limits: list[int] = []

    class Watched(Solver):
        def __init__(
            self, compiled: Compiled, constraints: Constraints, *, rlimit: int, purse: Purse
        ) -> None:
            limits.append(rlimit)
            super().__init__(compiled, constraints, rlimit=rlimit, purse=purse)

    monkeypatch.setattr(loading, "Solver", Watched)
    tree = plan_of(plan(par_all(seq("d/A", "d/B"), seq("d/C", "d/E"))))
    compiled, actual = compile_plan(tree), constraints_of(tree)
    for rlimit in (400_000, 50_000_000):
        assert loading.by_solver(Solver(compiled, actual, rlimit=rlimit)) == loading.Answer(2, 4)
    assert limits == [400_000, 500_000]


def test_where_the_loads_are_too_many_nothing_contradicts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gpsfsm.analysis.timing.loads._FEW", 1)
    monkeypatch.setattr("gpsfsm.analysis.timing.loads._MAX_STEPS", 3)
    monkeypatch.setattr("gpsfsm.analysis.decisions.loading._MAX_RUNNERS", 1)
    tree = plan_of(plan(par_any("d/A", seq("d/B", "d/C")), par_any("d/A", "d/B"), "d/E"))
    compiled, actual = compile_plan(tree), constraints_of(tree)
    decided = decide(compiled, actual, AnalysisOptions())
    facts = decided.facts()
    assert facts is not None
    assert facts.loaded is not None
    assert (facts.loaded.peak, facts.loaded.all) == (None, 4)
    assert not decided.inconclusive
