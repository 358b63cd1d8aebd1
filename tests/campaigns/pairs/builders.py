"""Python that builds machines: the reader against a process that runs it with stand-ins."""

from __future__ import annotations

from hypothesis import strategies as st

from tests.campaigns.base import Pair
from tests.compile.formats.builder_programs import judged, program

PAIR = Pair(
    name="builders",
    about="programs that build SMACH and FlexBE machines: the reader against running them",
    cases=lambda: st.integers(0, 10**9).map(program),
    judge=judged,
    text=str,
    batch=100,
)
