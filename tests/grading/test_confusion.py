"""The agreement of two who grade the same answers."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.grading.grader import Grade
from gpsfsm.grading.tables import GRADES, confusion_of

PAIRS = st.lists(st.tuples(st.sampled_from([*GRADES, None]), st.sampled_from(list(Grade))))
S, P, F = GRADES


@given(PAIRS)
def test_numbers_are_those_of_the_definition(pairs: list[tuple[Grade | None, Grade]]) -> None:
    confusion = confusion_of(pairs)
    both = [(human, ours) for human, ours in pairs if human is not None]
    same = [human for human, ours in both if human is ours]
    assert (confusion.labelled, confusion.equal) == (len(both), len(same))
    if not both:
        assert (confusion.accuracy, confusion.kappa) == (None, None)
        return
    observed = Fraction(len(same), len(both))
    assert confusion.accuracy == float(observed)
    by_chance = sum(
        Fraction(sum(human is grade for human, _ in both), len(both))
        * Fraction(sum(ours is grade for _, ours in both), len(both))
        for grade in Grade
    )
    if by_chance == 1:
        assert confusion.kappa is None
    else:
        assert confusion.kappa == pytest.approx(float((observed - by_chance) / (1 - by_chance)))


@given(PAIRS.filter(lambda pairs: any(human is not None for human, _ in pairs)))
def test_kappa_is_one_only_for_perfect_agreement(pairs: list[tuple[Grade | None, Grade]]) -> None:
    confusion = confusion_of(pairs)
    if confusion.kappa is not None:
        assert -1 <= confusion.kappa <= 1
        assert (confusion.kappa == 1) == (confusion.equal == confusion.labelled)


def test_by_hand() -> None:
    """Cohen's example in small: 6 of 10 equal, 0.36 by chance."""
    pairs = [(S, S)] * 3 + [(S, P)] * 2 + [(P, P)] * 2 + [(P, F)] + [(F, S)] + [(F, F)]
    confusion = confusion_of([*pairs, (None, S)])
    assert confusion.counts[S, P] == 2
    assert (confusion.labelled, confusion.equal, confusion.accuracy) == (10, 6, 0.6)
    assert confusion.kappa == pytest.approx((0.6 - 0.36) / (1 - 0.36))
