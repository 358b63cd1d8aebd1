"""The canonical form of an assumption."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.analysis.assumptions import parse_assumption
from gpsfsm.analysis.assumptions.parser import (
    Claim,
    InterfaceSelector,
    LabelSelector,
    Quantifier,
    Verb,
)
from tests.analysis.assumptions.support import MEANINGS


@pytest.mark.parametrize("text", [text for text, _ in MEANINGS])
def test_the_canonical_form_parses_to_the_same(text: str) -> None:
    assumption = parse_assumption(text)
    assert parse_assumption(str(assumption)).statement == assumption.statement


LABELS = st.text(min_size=1, max_size=8)


@given(LABELS, LABELS, st.text("abz_09.-", min_size=1, max_size=5))
def test_any_name_can_be_quoted(interface: str, value: str, name: str) -> None:
    selector = InterfaceSelector(interface, ((name, value),), literal=True)
    verb = Verb("fail")
    statement = Claim(Quantifier("any"), (selector, LabelSelector(value)), verb)
    assert parse_assumption(str(statement)).statement == statement
