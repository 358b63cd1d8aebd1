"""The front end against the grammars: what one accepts, the other accepts.

RELAX NG and XSD describe plans as people write them; the grammar in Lark describes what a model is
allowed to write, which is a part of it.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from hypothesis import strategies as st

from gpsfsm.capabilities.library import builtin_capabilities
from tests.campaigns.base import Pair
from tests.grammars import texts
from tests.grammars.engines import Engines, errors
from tests.grammars.libraries import canonical_plans
from tests.grammars.test_grammars import _verdicts

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hypothesis.strategies import DrawFn


def _texts() -> st.SearchStrategy[str]:
    spoiled = st.one_of(texts.spoiled_plans(), texts.wild_texts()).map(lambda each: each.text)
    return st.one_of(texts.plans(), spoiled, texts.mutated_plans())


def judge(text: str) -> Iterator[str]:
    """RELAX NG, XSD and the front end say the same of a text."""
    verdicts = _verdicts(text)
    assert len(set(verdicts.values())) == 1, verdicts
    yield "accepted" if verdicts["front end"] else "refused"


@cache
def _engines() -> Engines:
    return Engines.of(builtin_capabilities())


@st.composite
def _nearly_canonical(draw: DrawFn) -> str:
    """A plan as models are bound to write it, or one with a piece taken out or doubled."""
    text = draw(canonical_plans(builtin_capabilities().library, depth=4))
    if draw(st.booleans()):
        start = draw(st.integers(0, len(text)))
        stop = min(len(text), start + draw(st.sampled_from([0, 1, 1, 2, 5, 20])))
        place = draw(st.integers(0, len(text)))
        inserted = text[place : place + draw(st.sampled_from([0, 0, 1, 5, 20]))]
        text = text[:start] + inserted + text[stop:]
    return text


def judge_lark(text: str) -> Iterator[str]:
    """All engines of the grammars agree, and what they accept is checked without errors."""
    said = _engines().verdicts(text)
    assert len(set(said.values())) == 1, said
    if said["lark"]:
        assert errors(text, builtin_capabilities()) == []
    yield "accepted" if said["lark"] else "refused"


PAIRS = [
    Pair(
        name="grammar",
        about="texts: the front end against RELAX NG and XSD",
        cases=_texts,
        judge=judge,
        text=str,
        batch=100,
    ),
    Pair(
        name="lark",
        about="plans as models may write them: Lark, GBNF and llguidance, and the check",
        cases=_nearly_canonical,
        judge=judge_lark,
        text=str,
    ),
]
