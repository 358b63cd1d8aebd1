"""Counterexamples of random plans: canonical for both deciders, true however they are filled."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hypothesis import strategies as st

from tests import oracle
from tests.analysis.test_scenarios import check_canonical, findings_of
from tests.campaigns.base import Pair
from tests.strategies import faults, plans
from tests.support import decided

if TYPE_CHECKING:
    from collections.abc import Iterator

_ENDS = {"COMPLETED": "completed", "GAVE_UP": "gave_up", "STUCK": "stuck"}


def judge(case: tuple[oracle.P, frozenset[str]]) -> Iterator[str]:
    """The scenarios of both deciders are those of the brute force, and what they show is true."""
    whole, models = case
    for solver in ("z3", "structural") if not models else ("z3",):
        decision = decided(whole, faults=models, solver=solver)
        check_canonical(whole, decision, faults=models)
    for finding in findings_of(decision):
        if finding.scenario is None:
            continue
        end = _ENDS[finding.scenario.ends]
        assert oracle.holds_for_all_fillings(
            whole,
            {path: str(outcome) for path, outcome in finding.scenario.outcomes},
            lambda run, end=end: bool(getattr(run, end)),
            faults=models,
        ), finding
        yield f"{finding.rule} {finding.scenario.ends}"
    yield "decided"


PAIR = Pair(
    name="scenarios",
    about="random plans: the counterexamples of both deciders against brute force",
    cases=lambda: st.tuples(plans(max_runners=5), st.one_of(st.just(frozenset[str]()), faults())),
    judge=judge,
    text=lambda case: f"<!-- faults: {sorted(case[1])} -->\n{oracle.to_xml(case[0])}",
)
