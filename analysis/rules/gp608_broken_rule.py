"""GP608: a rule of the task that a run breaks (reported for ``--task``)."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import ROUNDS, ROUNDS_TASK, plan, say
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP608",
    name="broken-rule",
    severity=Severity.ERROR,
    summary="A run of the plan breaks a rule of the task.",
    why=(
        "The rules of a task must hold in every run, whatever fails and in whatever order "
        "things happen."
    ),
    fix="change the plan so that the run in the scenario keeps the rule",
    bad=plan(say("Good evening."), *ROUNDS),
    good=plan(*ROUNDS),
    options=ROUNDS_TASK,
)
