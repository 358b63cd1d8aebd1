"""GP101: a text that is not well-formed XML."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan, say
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP101",
    name="malformed-xml",
    severity=Severity.ERROR,
    summary="The text breaks the rules of XML.",
    why=(
        "An executor reads a plan with an XML parser, which refuses the whole text at the first "
        "error or, worse, guesses. gpsfsm reports all errors of a text at once. Where an error can "
        'be repaired in one place, such as a stray "&", the rest of the check goes on as if it '
        "were; tags that do not match leave open what the plan means, so nothing more is said "
        "about it."
    ),
    fix=(
        'correct the text at the marked place. In attribute values "&" is written "&amp;" and "<" '
        'is written "&lt;"'
    ),
    bad=plan(go(2.0, -0.5), say("Lab & office checked")),
    good=plan(go(2.0, -0.5), say("Lab &amp; office checked")),
)
