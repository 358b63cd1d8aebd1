"""GP114: something inside a runner."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan, say
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP114",
    name="runner-content",
    severity=Severity.ERROR,
    summary="A runner holds elements or text.",
    why=(
        "A runner is a leaf: what is inside it never runs. Often its tag should have ended with "
        '"/>", so that the following elements stand behind it and not inside. The check ignores '
        "what is inside."
    ),
    fix=(
        'end the tag of the runner with "/>" and move what is inside behind it; write texts as '
        "attributes"
    ),
    bad=plan(go(2.0, -0.5).replace("/>", ">"), "    " + say("Hall checked."), "</Runner>"),
    good=plan(go(2.0, -0.5), say("Hall checked.")),
)
