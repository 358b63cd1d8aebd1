"""Machines that are written in other formats: what the texts do, by judges of these formats."""

from __future__ import annotations

from hypothesis import strategies as st

from tests.campaigns.base import Pair
from tests.compile.formats.written import judged

PAIR = Pair(
    name="writers",
    about="random machines written as SCXML and YASMIN: interpreters of both do the same",
    cases=lambda: st.integers(0, 10**9),
    judge=judged,
    text=str,
    full=10_000,
    batch=100,
    few=30,
)
