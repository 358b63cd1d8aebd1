"""What could not be decided on an engine is never reported as fine."""

from __future__ import annotations

import pytest

import gpsfsm
from gpsfsm.model.report import Verdict
from tests.engines.test_facts import both

GO = '<Runner interface="a/Go" provider="a/Go"/>'
DONE = "fabric_capabilities/FabricCompletionRunner"
PLAN = f'<Plan>{GO}<Control type="recovery">{GO}</Control>{{}}</Plan>'


@both
@pytest.mark.parametrize("named", [False, True])
def test_assumptions_that_admit_no_scenario_on_the_engine_alone(engine: str, named: bool) -> None:
    """A completion runner that is named last is no runner in the paper, but is one there."""
    text = PLAN.format(f'<Runner interface="{DONE}" provider="{DONE}"/>' if named else "")
    assume = [f"never {verb}: FabricCompletionRunner" for verb in ("fails", "succeeds")]
    [plan] = gpsfsm.check(text, assume=assume, engine=engine).plans
    codes = {finding.rule for finding in plan.findings}
    assert ("GP902" in codes) is named
    assert (plan.verdict is Verdict.UNDECIDED) is named
    assert (plan.facts is None) is named


@both
@pytest.mark.parametrize("rlimit", [1, 100, 1_000, 10_000])
def test_a_limit_leaves_the_difference_undecided(engine: str, rlimit: int) -> None:
    """Which outcomes can come next is asked of z3 where they depend on each other."""
    text = f'<Plan>{GO}<Control type="parallel_all">{GO}{GO}</Control></Plan>'
    options = {"consistent": True, "faults": ["no-start", "hang"], "rlimit": rlimit}
    [plan] = gpsfsm.check(text, engine=engine, **options).plans
    codes = {finding.rule for finding in plan.findings}
    assert "GP903" not in codes
    assert "GP904" in codes or "GP703" in codes
    assert (plan.verdict is Verdict.UNDECIDED) is ("GP904" in codes)
