"""Formulas over outcomes: evaluation, folding, SMT-LIB."""

from __future__ import annotations

import itertools

import pytest
import z3
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.analysis.assumptions import formula as logic
from gpsfsm.model.event import Outcome
from tests.analysis.assumptions.support import F, H, N, S, bind, scenarios
from tests.oracle import par_any, plan, rec, seq
from tests.support import decided

SIZE = 3
ATOMS = st.builds(
    logic.Atom, st.integers(0, SIZE - 1), st.frozensets(st.sampled_from(list(Outcome)))
)
AGREES = st.lists(st.integers(0, SIZE - 1), unique=True).map(
    lambda n: logic.Agree(tuple(sorted(n)))
)


def branches(inner: st.SearchStrategy[logic.Formula]) -> st.SearchStrategy[logic.Formula]:
    parts = st.lists(inner, max_size=4).map(tuple)
    return st.one_of(
        inner.map(lambda part: logic.Not((part,))),
        parts.map(logic.And),
        parts.map(logic.Or),
        st.tuples(inner, inner).map(logic.Iff),
        st.builds(logic.Count, st.integers(-1, 5), st.integers(-1, 5), parts),
        inner.map(logic.negation),
        parts.map(logic.conjunction),
        parts.map(logic.disjunction),
        st.builds(logic.count, st.integers(-1, 5), st.integers(-1, 5), parts),
    )


FORMULAS = st.recursive(st.builds(logic.Constant, st.booleans()) | ATOMS | AGREES, branches)


KINDS = {S: "s", N: "n", H: "h"}


def symbolic(runner: int, outcomes: frozenset[Outcome]) -> str:
    """A term over s (succeeds), n (does not start), h (hangs); FAILED is none of these."""
    kinds = {outcome: f"{kind}{runner}" for outcome, kind in KINDS.items()}
    terms = {**kinds, F: f"(not (or {' '.join(kinds.values())}))"}
    return f"(or false {' '.join(terms[outcome] for outcome in sorted(outcomes))})"


@given(FORMULAS)
@settings(deadline=None)
def test_smt_agrees_with_evaluation(formula: logic.Formula) -> None:
    compare_with_z3(formula)


@pytest.mark.parametrize(("least", "most"), list(itertools.product(range(SIZE + 1), repeat=2)))
def test_smt_of_counts(least: int, most: int) -> None:
    atoms = tuple(logic.Atom(runner, frozenset({F, N})) for runner in range(SIZE))
    compare_with_z3(logic.Count(least, most, atoms))


@pytest.mark.parametrize("runners", [(), (1,), (0, 2), (0, 1, 2)])
def test_smt_of_agreement(runners: tuple[int, ...]) -> None:
    compare_with_z3(logic.Agree(runners))


def test_the_last_of_three_agrees_too() -> None:
    """After a failure of A neither B nor C succeeds, so nothing gets as far as D."""
    whole = plan("a/A", rec(seq(par_any("a/B", "a/C"), "a/D")))
    unreachable = "/Plan/Control[1]/Control[1]/Runner[1]"
    for same, expected in (("A, B, C", (unreachable,)), ("A, B", ())):
        facts = decided(whole, assumptions=[f"same: {same}"]).facts()
        assert facts is not None
        assert facts.unreachable == expected


def test_one_constant_may_decide() -> None:
    free = logic.Atom(0, frozenset({S}))
    assert logic.disjunction((free, logic.Constant(True))) == logic.Constant(True)
    assert logic.conjunction((free, logic.Constant(False))) == logic.Constant(False)


def compare_with_z3(formula: logic.Formula) -> None:
    names = [f"{kind}{runner}" for runner in range(SIZE) for kind in "snh"]
    solver = z3.SolverFor("QF_FD")
    declarations = "".join(f"(declare-const {name} Bool)" for name in [*names, "q0"])
    solver.from_string(f"{declarations}(assert (= q0 {logic.to_smt(formula, symbolic)}))")
    for scenario in scenarios(SIZE):
        true = {f"{KINDS[o]}{n}" for n, o in enumerate(scenario) if o in KINDS}
        assignment = [z3.Bool(name) if name in true else z3.Not(z3.Bool(name)) for name in names]
        expected = logic.holds(formula, scenario)
        holds, fails = z3.Bool("q0"), z3.Not(z3.Bool("q0"))
        assert solver.check(*assignment, holds if expected else fails) == z3.sat
        assert solver.check(*assignment, fails if expected else holds) == z3.unsat


FEW: tuple[logic.Formula, ...] = (
    logic.Constant(True),
    logic.Constant(False),
    logic.Atom(0, frozenset({S})),
    logic.Atom(1, frozenset({S})),
)


@pytest.mark.parametrize("size", range(4))
def test_folding_changes_no_meaning(size: int) -> None:
    bounds = list(itertools.product(range(-1, 5), repeat=2))
    for parts in itertools.product(FEW, repeat=size):
        pairs: list[tuple[logic.Formula, logic.Formula]] = [
            (logic.conjunction(parts), logic.And(parts)),
            (logic.disjunction(parts), logic.Or(parts)),
            *((logic.negation(part), logic.Not((part,))) for part in parts),
            *((logic.count(n, m, parts), logic.Count(n, m, parts)) for n, m in bounds),
        ]
        for scenario in itertools.product((S, F), repeat=2):
            for folded, plain in pairs:
                assert logic.holds(folded, scenario) == logic.holds(plain, scenario), plain


@given(FORMULAS)
def test_unary_says_the_same_as_the_formula(formula: logic.Formula) -> None:
    allowed = logic.unary(formula)
    if allowed is not None:
        for scenario in scenarios(SIZE):
            single = all(scenario[runner] in outcomes for runner, outcomes in allowed.items())
            assert single == logic.holds(formula, scenario)


@given(st.lists(ATOMS, max_size=5), st.booleans())
def test_unary_splits_conjunctions_of_single_constraints(
    atoms: list[logic.Atom], flip: bool
) -> None:
    formula: logic.Formula = logic.And(tuple(atoms))
    if flip:
        formula = logic.Not((logic.Or(tuple(map(logic.negation, atoms))),))
    assert logic.unary(formula) is not None


def test_unary_of_what_does_not_split() -> None:
    assert logic.unary(bind("line 2 fails or line 4 fails")) is None
    assert logic.unary(bind("same: line 2, line 4")) is None
    assert logic.unary(logic.Constant(False)) is None
    assert logic.unary(logic.Constant(True)) == {}
    assert logic.unary(bind("not line 2 fails and not line 2 hangs")) == {0: frozenset({S})}


def test_nested_counts_stay_small() -> None:
    text = "line 2 fails"
    for _ in range(40):
        text = f"exactly 1 of ({text}, line 4 hangs, line 5:5 fails)"
    assert len(logic.to_smt(bind(text), symbolic)) < 40 * 300


def test_wide_and_deep_formulas() -> None:
    atoms = tuple(logic.Atom(runner, frozenset({S})) for runner in range(100_000))
    deep: logic.Formula = logic.Count(1, 1, atoms)
    for _ in range(10_001):
        deep = logic.Not((deep,))
    scenario = [F] * 99_999 + [S]
    assert not logic.holds(logic.And(atoms), scenario)
    assert logic.holds(logic.Or(atoms), scenario)
    assert not logic.holds(deep, scenario)
    assert len(logic.runners(deep)) == 100_000
    assert len(logic.unary(logic.And(atoms)) or {}) == 100_000
    assert logic.to_smt(logic.Or(atoms), lambda runner, _: f"s{runner}").count(" ") == 100_000


@given(FORMULAS)
def test_by_deviations_is_holds(formula: logic.Formula) -> None:
    test = logic.by_deviations(formula)
    for outcomes in itertools.product(Outcome, repeat=SIZE):
        deviations = [
            (number, outcome)
            for number, outcome in enumerate(outcomes)
            if outcome is not Outcome.SUCCEEDED
        ]
        assert test(deviations) is logic.holds(formula, outcomes)
