"""GP502 where a real run takes longer than the declared durations add up to."""

from __future__ import annotations

import pytest

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.analysis.rules.base import plan, wait
from gpsfsm.checking import CheckOptions, check_text


@pytest.mark.parametrize(
    ("deadline_s", "late"), [(20.0, True), (22.9, True), (23.0, False), (25.0, False)]
)
def test_a_real_run_adds_its_allowance_once_and_for_each_action(
    deadline_s: float, late: bool
) -> None:
    # two actions of 10 s, and 1 s three times: as the run begins, and for each action
    options = AnalysisOptions(deadline_s=deadline_s, allowance_s=1.0)
    report = check_text(plan(wait(10), wait(10)), "plan.xml", CheckOptions(analysis=options))
    messages = [finding.message for finding in report.findings if finding.rule == "GP502"]
    assert bool(messages) is late
    assert all(
        "plus 3 s for the overhead of a real run of up to 2 actions" in each for each in messages
    )


def test_declared_durations_alone_have_no_allowance() -> None:
    options = AnalysisOptions(deadline_s=20.0)
    report = check_text(plan(wait(10), wait(10)), "plan.xml", CheckOptions(analysis=options))
    assert "GP502" not in {finding.rule for finding in report.findings}
