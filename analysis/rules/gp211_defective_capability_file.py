"""GP211: the capability files themselves are defective."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, go, plan
from gpsfsm.model.finding import Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.model.finding import Finding

_SHOWN = 3
_MAX_DEFECT = 200


def find(context: Context) -> Iterator[Finding]:
    """One finding for the whole plan, at its beginning."""
    defects = context.capabilities.defects
    if not defects:
        return
    shown = "; ".join(clip(defect, _MAX_DEFECT) for defect in defects[:_SHOWN])
    count = "a defect" if len(defects) == 1 else f"{len(defects)} defects"
    more = f"; and {len(defects) - _SHOWN} more" if len(defects) > _SHOWN else ""
    yield RULE.finding(
        f"the capability files have {count}: {shown}{more}", Location(1, 1, "/Plan"), length=1
    )


RULE = Rule(
    code="GP211",
    name="defective-capability-file",
    severity=Severity.WARNING,
    summary="A capability file cannot be used as it is.",
    why=(
        "What is defective is left out, so that runners may count as unknown or undescribed that "
        "the file was meant to describe."
    ),
    fix="mend the files; 'gpsfsm capabilities check DIR' shows everything that is wrong with them",
    bad="",
    good=plan(go(2.0, -0.5)),
    find=find,
)
