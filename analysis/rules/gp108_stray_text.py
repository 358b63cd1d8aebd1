"""GP108: text between or around the elements."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan, say
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP108",
    name="stray-text",
    severity=Severity.ERROR,
    summary="Text stands where only elements may be.",
    why=(
        "A plan holds elements and comments, no text of its own. Text around it is what a language "
        "model says before or after its plan, text inside it is often a remark or the rest of a "
        "broken tag. Some executors refuse the plan, others skip the text."
    ),
    fix=(
        "remove the text, or make it a comment: <!-- … -->. Check a language model's raw answer "
        "with --from-response"
    ),
    bad=plan(go(2.0, -0.5), "then announce it:", say("Hall checked.")),
    good=plan(go(2.0, -0.5), "<!-- then announce it: -->", say("Hall checked.")),
)
