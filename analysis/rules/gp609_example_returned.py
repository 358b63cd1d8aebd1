"""GP609: the example of the prompt instead of an answer (reported for ``--task``)."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import ROUNDS, ROUNDS_TASK, go, plan, say
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP609",
    name="example-returned",
    severity=Severity.ERROR,
    summary="The plan does what an example of the prompt does.",
    why=(
        "A language model that repeats the example it was shown has not answered. The "
        "task names such plans below 'not_answers'; behaviour is compared, not text."
    ),
    fix="ask again for a plan for this task",
    bad=plan(go(9.0, 9.0), say("I am here.")),
    good=plan(*ROUNDS),
    options=ROUNDS_TASK,
)
