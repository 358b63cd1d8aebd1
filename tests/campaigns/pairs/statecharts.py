"""Random statecharts: what is said of them against an interpreter of SCXML's appendix D."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hypothesis import strategies as st

from tests.campaigns.base import Pair
from tests.compile.formats.random_statecharts import EventfulChart, OddChart, ReturningChart, odder
from tests.compile.formats.test_scxml_meaning import disagreements

if TYPE_CHECKING:
    from collections.abc import Iterator


def judged(text: str) -> Iterator[str]:
    """Compared, or why not: refused, too many configurations."""
    wrong = disagreements(text)
    if isinstance(wrong, str):
        yield wrong
        return
    assert not wrong, wrong
    yield "compared"


def _drawn(seed: int) -> str:
    if seed % 4 == 0:
        return OddChart(seed, 5).text
    text = (ReturningChart if seed % 4 == 3 else EventfulChart)(seed).text
    return odder(text, seed) if seed % 4 == 1 or seed % 8 == 3 else text


PAIR = Pair(
    name="statecharts",
    about="random statecharts that send themselves events: the check against appendix D",
    cases=lambda: st.integers(0, 10**9).map(_drawn),
    judge=judged,
    text=str,
    full=20_000,
    batch=100,
)
