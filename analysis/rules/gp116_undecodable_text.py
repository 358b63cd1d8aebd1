"""GP116: a text that is no text."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan, say
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP116",
    name="undecodable-text",
    severity=Severity.ERROR,
    summary="The text is not in the encoding it should be in, or has characters that XML forbids.",
    why=(
        "Bytes that are no text in the declared encoding mean a damaged file, a binary file, or "
        "one saved in another encoding. Control characters such as NUL are forbidden in XML: "
        "parsers refuse them, or end the text there."
    ),
    fix="save the file as UTF-8 and remove control characters",
    bad=plan(go(2.0, -0.5), say("Hall checked.\0")),
    good=plan(go(2.0, -0.5), say("Hall checked.")),
)
