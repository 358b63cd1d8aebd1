"""Random files of YASMIN: what is said of them against an interpreter of its factory."""

from __future__ import annotations

from hypothesis import strategies as st

from tests.campaigns.base import Pair
from tests.compile.formats.test_yasmin import judged
from tests.compile.formats.yasmin_machines import YasminMachine

PAIR = Pair(
    name="yasmin",
    about="random files of YASMIN: the check against an interpreter of its factory and core",
    cases=lambda: st.integers(0, 10**9).map(lambda seed: YasminMachine(seed).text),
    judge=judged,
    text=str,
    full=20_000,
    batch=100,
)
