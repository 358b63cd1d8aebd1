"""GitLab's code quality report: one entry per finding, shown in merge requests."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.printable import clip, printable
from gpsfsm.model.report import PlanReport, Report, Verdict
from gpsfsm.report import Format, RenderOptions
from gpsfsm.report._words import MAX_MESSAGE
from gpsfsm.streams import Form

_SEVERITIES = {Severity.ERROR: "critical", Severity.WARNING: "minor", Severity.INFO: "info"}


def _render(report: Report, _: RenderOptions) -> str:
    seen: dict[str, int] = {}
    entries = []
    for plan in report.plans:
        if plan.verdict is not Verdict.ACCEPTED and not any(map(_is_error, plan.findings)):
            entries.append(_entry(plan, None, seen))  # else it would be passed over in silence
        entries += [_entry(plan, finding, seen) for finding in (*plan.findings, *plan.excused)]
    return json.dumps(entries, indent=1) + "\n"


def _is_error(finding: Finding) -> bool:
    return finding.severity is Severity.ERROR


def _entry(plan: PlanReport, finding: Finding | None, seen: dict[str, int]) -> dict[str, Any]:
    path = printable(plan.path).removeprefix("./")
    if finding is None:
        undecided = plan.verdict is Verdict.UNDECIDED
        rule, element, line, severity = "gpsfsm", "", 1, "critical"
        message = "the plan is undecided" if undecided else "the plan is rejected"
    else:
        path = printable(plan.file_of(finding.location)).removeprefix("./")
        rule, element = finding.rule, finding.location.element
        line, severity = max(1, finding.location.line), _SEVERITIES[finding.severity]
        hint = f" ({finding.hint})" if finding.hint else ""
        message = f"{finding.rule} {finding.name}: {finding.message}{hint}"
        if finding.suppressed_by:
            message += f" (suppressed by a comment: {finding.justification})"
    return {
        "description": clip(message, MAX_MESSAGE),
        "check_name": printable(rule),
        "fingerprint": _fingerprint((path, rule, element, message), seen),
        "severity": severity,
        "location": {"path": path, "lines": {"begin": line}},
    }


def _fingerprint(parts: tuple[str, ...], seen: dict[str, int]) -> str:
    """Stays the same wherever the line moves; findings that are told alike are numbered."""
    identity = "\0".join(parts)
    seen[identity] = number = seen.get(identity, 0) + 1
    content = f"{identity}\0{number}".encode("utf-8", "backslashreplace")
    return hashlib.sha256(content).hexdigest()


FORMAT = Format(name="gitlab", render=_render, form=Form.JSON)
