"""Random programs of LangGraph: what is said of their drawings against their supersteps."""

from __future__ import annotations

from hypothesis import strategies as st

from tests.campaigns.base import Pair
from tests.compile.formats.test_langgraph import described, judged

PAIR = Pair(
    name="langgraph",
    about="drawings of random LangGraph programs: the check against an interpreter of supersteps",
    cases=lambda: st.integers(0, 10**9),
    judge=judged,
    text=described,
    full=20_000,
    batch=100,
)
