"""GP115: what was taken out of a model's answer."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP115",
    name="extracted-plan",
    severity=Severity.INFO,
    summary="The plan was taken out of a language model's answer.",
    why=(
        "With --from-response gpsfsm looks for the last complete plan in a model's raw answer and "
        "leaves out the rest: prose, Markdown fences, what the model thought, earlier plans. This "
        "tells which lines were taken, so that you can see whether it is the plan that you mean."
    ),
    fix=(
        "nothing, if that is the plan you mean. Ask the model to answer with the plan alone to "
        "avoid it"
    ),
    bad=f"Sure! This plan sends the robot to the hall:\n```xml\n{plan(go(2.0, -0.5))}```\n",
    good=plan(go(2.0, -0.5)),
    options=("--from-response",),
)
