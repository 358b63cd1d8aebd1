"""SARIF 2.1.0, which code scanning services and editors read.

Scenarios become code flows; suppressed findings are kept as suppressed results; what kept gpsfsm
from deciding a plan is also a notification of the invocation.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from typing import Any
from urllib.parse import quote

from gpsfsm.analysis.rules import says_no_verdict
from gpsfsm.model.finding import Confidence, Finding, Scenario, Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.printable import clip
from gpsfsm.model.report import PlanReport, Report, Verdict
from gpsfsm.report import Format, RenderOptions
from gpsfsm.report._words import MAX_MESSAGE, setting_line
from gpsfsm.streams import Form
from gpsfsm.version import REPOSITORY, VERSION

_Json = dict[str, Any]

_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
_LEVELS = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.INFO: "note"}
_PRECISIONS = {
    Confidence.PROVED: "very-high",
    Confidence.MAY: "medium",
    Confidence.HEURISTIC: "medium",
}
_FINGERPRINT = "gpsfsmFinding/v1"

_dump = json.JSONEncoder(ensure_ascii=True, allow_nan=False).encode


def _render(report: Report, options: RenderOptions) -> str:
    rules = _rules()
    indices = {rule["id"]: index for index, rule in enumerate(rules)}
    driver: _Json = {"name": "gpsfsm", "informationUri": REPOSITORY, "rules": rules}
    if options.version:
        driver["version"] = options.version
    results = (result for plan in report.plans for result in _results(plan, indices))
    lines = ",\n".join(map(_dump, results))
    # One line per result, not an indentation: that would rule out the fast encoder.
    return (
        f'{{"$schema": "{_SCHEMA}", "version": "2.1.0", "runs": [{{\n'
        f'"tool": {_dump({"driver": driver})},\n'
        f'"columnKind": "unicodeCodePoints",\n'
        f'"invocations": [{_dump(_invocation(report))}],\n'
        f'"results": [\n{lines}\n]}}]}}\n'
    )


def _rules() -> list[_Json]:
    from gpsfsm.analysis.rules import all_rules
    from gpsfsm.report._rule_docs import rule_markdown

    return [
        {
            "id": rule.code,
            "name": rule.name,
            "shortDescription": _message(rule.summary),
            "fullDescription": _message(f"{rule.summary} {rule.why}"),
            "helpUri": f"{REPOSITORY}/blob/v{VERSION}/docs/rules/{rule.code}.md",
            "help": {**_message(rule.fix), "markdown": _escape_braces(rule_markdown(rule))},
            "defaultConfiguration": {"level": _LEVELS[rule.severity]},
            "properties": {"precision": _PRECISIONS[rule.confidence]},
        }
        for rule in all_rules()
    ]


def _invocation(report: Report) -> _Json:
    undecided = [plan for plan in report.plans if plan.verdict is Verdict.UNDECIDED]
    invocation: _Json = {"executionSuccessful": bool(report.plans) and not undecided}
    if undecided:
        invocation["toolExecutionNotifications"] = [
            notification for plan in undecided for notification in _notifications(plan)
        ]
    if report.settings:
        invocation["toolConfigurationNotifications"] = [
            {"level": "note", "message": _message(setting_line(used))} for used in report.settings
        ]
    return invocation


def _notifications(plan: PlanReport) -> list[_Json]:
    """Tell why gpsfsm did not decide, or at least that it did not."""
    causes = [finding for finding in plan.findings if says_no_verdict(finding.rule)]
    if not causes:
        message = _message("the plan is undecided")
        location = _location(plan.path, Location(0, 0))
        return [{"level": "error", "message": message, "locations": [location]}]
    return [
        {
            "level": "error",
            "message": _message(finding.message),
            "descriptor": {"id": finding.rule},
            "locations": [_location(plan.path, finding.location, finding.length)],
        }
        for finding in causes
    ]


def _results(plan: PlanReport, indices: dict[str, int]) -> list[_Json]:
    results = [_result(plan, finding, indices) for finding in plan.findings]
    for finding in plan.suppressed:
        result = _result(plan, finding, indices)
        result["suppressions"] = _suppressions(finding)
        results.append(result)
    return results


def _suppressions(finding: Finding) -> list[_Json]:
    """A comment is in the source; options and baselines are not."""
    suppressions: list[_Json] = []
    if finding.suppressed_by == "comment" or finding.excused:
        reason = {"justification": clip(finding.justification, MAX_MESSAGE)}
        suppressions.append({"kind": "inSource", **(reason if finding.excused else {})})
    if finding.suppressed_by != "comment":
        suppressions.append({"kind": "external"})
    return suppressions


def _result(plan: PlanReport, finding: Finding, indices: dict[str, int]) -> _Json:
    result: _Json = {"ruleId": finding.rule}
    if finding.rule in indices:
        result["ruleIndex"] = indices[finding.rule]
    result |= {
        "level": _LEVELS[finding.severity],
        "message": _message(finding.message),
        "locations": [_location(plan.path, finding.location, finding.length)],
        "partialFingerprints": {_FINGERPRINT: _fingerprint(finding)},
        "properties": {
            "confidence": finding.confidence.value,
            "hint": clip(finding.hint, MAX_MESSAGE),
        },
    }
    if finding.related:
        result["relatedLocations"] = [
            {
                "id": number,
                **_location(plan.path, other.location),
                "message": _message(other.message or other.location.element or "see also"),
            }
            for number, other in enumerate(finding.related, start=1)
        ]
    if finding.scenario is not None and finding.scenario.trace:
        result["codeFlows"] = [_code_flow(plan.path, finding.scenario)]
    return result


def _code_flow(path: str, scenario: Scenario) -> _Json:
    steps = []
    for number, step in enumerate(scenario.trace, start=1):
        location = _location(path, Location(step.line, 0, step.element, step.file))
        location["message"] = _message(f"{step.event.value} of {step.element}")
        steps.append({"location": location, "executionOrder": number})
    cut = " (only the last events)" if scenario.trace_truncated else ""
    return {
        "message": _message(f"a run in which {scenario.ending}{cut}"),
        "threadFlows": [{"locations": steps}],
    }


def _location(path: str, location: Location, length: int | None = None) -> _Json:
    """``length`` None: the whole line (from the column on)."""
    physical: _Json = {"artifactLocation": {"uri": _uri(location.file or path)}}
    if location.line > 0:
        region: _Json = {"startLine": location.line}
        if location.column > 0:
            region["startColumn"] = location.column
            if length is not None:
                region["endColumn"] = location.column + max(1, length)
        physical["region"] = region
    row: _Json = {"physicalLocation": physical}
    if location.element:
        name = clip(location.element, MAX_MESSAGE)
        row["logicalLocations"] = [{"fullyQualifiedName": name, "kind": "element"}]
    return row


def _uri(path: str) -> str:
    """Encode a path; a relative one stays relative, an absolute one becomes a file URI."""
    slashed = path.replace("\\", "/") if os.name == "nt" else path
    try:
        encoded = quote(slashed.encode("utf-8", "surrogateescape"))
    except UnicodeEncodeError:  # a surrogate that never was a byte
        encoded = quote(slashed.encode("utf-8", "replace"))
    if slashed.startswith("/"):
        return f"file://{encoded}"
    return f"file:///{quote(slashed, safe='/:')}" if re.match("[A-Za-z]:/", slashed) else encoded


_LINK = re.compile(r"\[(?=[^\]]*\]\()")


def _message(text: str) -> _Json:
    """Make a plain text message: no placeholders, nothing that reads as a link (SARIF 3.11)."""
    plain = _escape_braces(clip(text, MAX_MESSAGE))
    return {"text": _LINK.sub(r"\\[", plain) or "-"}


def _escape_braces(text: str) -> str:
    return text.replace("{", "{{").replace("}", "}}")


def _fingerprint(finding: Finding) -> str:
    """Stays the same as long as the element keeps its path, wherever its line moves."""
    identity = "\0".join((finding.rule, finding.location.element, finding.message))
    return hashlib.sha256(identity.encode("utf-8", "backslashreplace")).hexdigest()[:32]


FORMAT = Format(name="sarif", render=_render, form=Form.JSON)
