"""GP609: the example of the prompt instead of an answer (reported for ``--task``)."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import control, go, plan, say
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
    good=plan(
        go(4.0, 1.0),
        go(6.5, 3.0),
        control("recovery", go(6.5, 5.0)),
        go(0.5, 3.0),
    ),
    options=("--task", "docs/examples/rounds.yaml"),
)
