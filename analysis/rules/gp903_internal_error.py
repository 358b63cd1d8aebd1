"""GP903: gpsfsm contradicts itself, or the check of a plan failed."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP903",
    name="internal-error",
    severity=Severity.ERROR,
    summary="gpsfsm contradicts itself or its check failed, so there is no verdict.",
    why=(
        "Every answer is checked in a second way: by another procedure, or by replaying the "
        "scenario. Here the two do not agree, or the check itself failed: there was an unexpected "
        "error, or the process of the check was killed. Nothing is known "
        "of the plan then, so it must not be dispatched. Contradictions and unexpected errors are "
        "defects of gpsfsm, not of the plan."
    ),
    fix="please report it, with the plan and the options",
    bad="",
    good=plan(go(1.0, 1.0), go(2.0, 2.0)),
)
