"""The deciders of equivalence: they check each other, and say what they do not know."""

from __future__ import annotations

import pytest

from gpsfsm.compile import compile_plan
from gpsfsm.equivalence import Difference, comparison, proof
from gpsfsm.equivalence.alignment import sides_of
from gpsfsm.equivalence.comparison import TooManyStatesError, lockstep
from gpsfsm.equivalence.pairs import Behaviour, Reaction
from gpsfsm.errors import InternalError
from tests.equivalence.pairs import differs, last_reactions, wide
from tests.oracle import P, par_all, par_any, plan, rec, seq
from tests.support import plan_of

WRONG = Difference((), Reaction((), None), Reaction((0,), None))
ONE_FORM = plan("a"), plan(seq("a"))
TWO_FORMS = plan(par_any(seq(), "a")), plan(par_any(seq(), seq("a", "b")))  # they do the same


def too_many(*_: object, **__: object) -> None:
    raise TooManyStatesError


def contradiction(one: P, other: P) -> None:
    with pytest.raises(InternalError, match="the two deciders differ"):
        differs(one, other, second_opinion=True)


def test_the_search_contradicts_the_normal_form(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(comparison, "lockstep", lambda *_, **__: WRONG)
    contradiction(*ONE_FORM)


def test_z3_contradicts_the_normal_form(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(comparison, "lockstep", too_many)
    assert differs(*ONE_FORM, second_opinion=True) is None
    monkeypatch.setattr(comparison, "prove", lambda *_, **__: WRONG)
    contradiction(*ONE_FORM)


def test_z3_contradicts_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    assert differs(*TWO_FORMS, second_opinion=True) is None
    monkeypatch.setattr(comparison, "prove", lambda *_, **__: WRONG)
    contradiction(*TWO_FORMS)
    monkeypatch.setattr(comparison, "prove", lambda *_, **__: None)
    contradiction(plan("a"), plan("b"))


def test_z3_finds_fewer_outcomes_than_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = plan("a", rec("b")), plan("a")
    difference = differs(one, other)
    assert difference is not None
    fewer = Difference((), difference.first, difference.second)
    monkeypatch.setattr(comparison, "prove", lambda *_, **__: fewer)
    contradiction(one, other)
    monkeypatch.setattr(comparison, "prove", lambda *_, **__: fewer.perhaps_not_first())
    assert differs(one, other, second_opinion=True) == difference  # z3 did not claim the fewest


# -- differences that may not be the shortest --------------------------------------------------


def test_the_search_says_that_it_met_its_limit_before_it_knew_the_shortest() -> None:
    one = plan(par_all(*(f"a x={number}" for number in range(9))), rec("b"))
    sides = sides_of(
        *(Behaviour(compile_plan(plan_of(each))) for each in (one, plan(one.children[0])))
    )
    outcome = lockstep(sides, max_work=20)
    assert outcome is not None
    assert (len(outcome.steps), outcome.shortest) == (1, False)
    again = lockstep(sides, max_work=10_000)
    assert again is not None
    assert (len(again.steps), again.shortest) == (1, True)


def test_z3_says_that_it_met_its_limit_before_it_knew_the_shortest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    whole = wide(120)
    changed = plan(*whole.children[:1], "x", *whole.children[1:])
    monkeypatch.setattr(proof, "_SHORTEN_RLIMIT", 1)
    difference = differs(whole, changed, decider="z3")
    assert difference is not None
    assert not difference.shortest
    behaviours = [Behaviour(compile_plan(plan_of(each))) for each in (whole, changed)]
    assert last_reactions(behaviours, difference) == (difference.first, difference.second)
