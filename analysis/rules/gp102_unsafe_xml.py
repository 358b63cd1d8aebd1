"""GP102: a DOCTYPE or entities."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan, say
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP102",
    name="unsafe-xml",
    severity=Severity.ERROR,
    summary="The text has a DOCTYPE or defines entities.",
    why=(
        "A DOCTYPE can make an XML parser read files of the robot, open network connections, or "
        "fill the memory by entities that expand to each other. No plan needs one. gpsfsm never "
        "reads or expands it; an executor might."
    ),
    fix="remove the DOCTYPE and everything in it; write the text of an entity where it is used",
    bad='<!DOCTYPE Plan [<!ENTITY dock SYSTEM "file:///etc/hostname">]>\n'
    + plan(go(2.0, -0.5), say("&dock;")),
    good=plan(go(2.0, -0.5), say("dock")),
)
