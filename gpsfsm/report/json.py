"""JSON for programs: the contract, version 3 (``gpsfsm-report-3.schema.json``).

One line per fact and per finding: it can be read, searched with grep, and is written by the fast
encoder, which an indentation would rule out.
"""

from __future__ import annotations

import importlib
import json
import re
from importlib import resources
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import UsageError
from gpsfsm.model.report import Report
from gpsfsm.report import Format, RenderOptions
from gpsfsm.streams import Form

if TYPE_CHECKING:
    from gpsfsm.model.finding import Finding, Scenario
    from gpsfsm.model.plan import Location
    from gpsfsm.model.report import Facts, Interval, PlanReport, SettingUsed

_VERSION = 3
_SCHEMA = "gpsfsm-report-3.schema.json"
_COLUMNS = ("path", "verdict", "rule", "name", "severity", "message", "line", "column", "hint")


def schema() -> dict[str, Any]:
    """Return the JSON schema that every output of this format obeys."""
    text = (resources.files("gpsfsm.report") / _SCHEMA).read_text(encoding="utf-8")
    document: dict[str, Any] = json.loads(text)
    return document


def _render(report: Report, _: RenderOptions) -> str:
    plans = ",".join(map(_plan, report.plans))
    settings = ",".join(f"\n {_dump(_setting(each))}" for each in report.settings)
    text = (
        f'{{"version": {_VERSION}, "plans": [{plans}{_break(plans)}],\n'
        f'"settings": [{settings}{_break(settings)}]}}\n'
    )
    return _readable(text)


def plan_line(plan: PlanReport) -> str:
    """The entry of a plan in one line, with the version: line breaks in values are escapes."""
    entry = _plan(plan).strip().removeprefix("{")
    return _readable(_INDENTED.sub(" ", f'{{"version": {_VERSION}, {entry}')) + "\n"


def _plan(plan: PlanReport) -> str:
    findings = ",\n   ".join(_dump(_finding(finding)) for finding in plan.findings)
    suppressed = ",\n   ".join(_dump(_suppressed(finding)) for finding in plan.suppressed)
    approximations = ",\n   ".join(map(_dump, approximations_as_data(plan)))
    return (
        f'\n {{"path": {_dump(plan.path)},'
        f'\n  "verdict": {_dump(plan.verdict.value)},'
        f'\n  "facts": {_facts(plan.facts)},'
        f'\n  "decided_by": {_dump({} if plan.proof is None else plan.proof.decided_by)},'
        f'\n  "unproved": {_dump({} if plan.proof is None else plan.proof.unproved)},'
        f'\n  "approximations": [{_line(approximations)}],'
        f'\n  "findings": [{_line(findings)}],'
        f'\n  "suppressed": {len(plan.suppressed)},'
        f'\n  "suppressed_findings": [{_line(suppressed)}],'
        f'\n  "notes": {_dump(plan.notes)}}}'
    )


def _facts(facts: Facts | None) -> str:
    if facts is None:
        return "null"
    fields: dict[str, Any] = {
        "runners": facts.runners,
        "completes": facts.completes.value,
        "gives_up": facts.gives_up.value,
        "stuck": facts.stuck.value,
        "unreachable": facts.unreachable,
        "dangling": [
            {"runner": each.runner, "event": each.event.value, "effect": each.effect}
            for each in facts.dangling
        ],
        "join_deadlocks": [
            {"control": each.control, "effect": each.effect} for each in facts.join_deadlocks
        ],
        "orphans": facts.orphans,
        "fewest_failures_to_give_up": facts.fewest_failures_to_give_up,
        "makespan": _interval(facts.makespan),
        "energy": _interval(facts.energy),
        "loaded": facts.loaded and {"peak": facts.loaded.peak, "all": facts.loaded.all},
    }
    if facts.swallowed:
        fields["swallowed"] = facts.swallowed
    if facts.engine is not None:
        fields["engine"] = {
            "name": facts.engine.name,
            "hangs": facts.engine.hangs.value,
            "aborts": facts.engine.aborts.value,
        }
    if facts.machine is not None:
        fields["machine"] = {
            "endless": facts.machine.endless.value,
            "completes_if_fair": facts.machine.completes_if_fair.value,
            "loops": [{"runners": loop.runners, "trap": loop.trap} for loop in facts.machine.loops],
        }
        fields["precision"] = {name: each.value for name, each in facts.precision.items()}
    inner = ",\n   ".join(f"{_dump(name)}: {_dump(value)}" for name, value in fields.items())
    return f"{{\n   {inner}}}"


def _interval(interval: Interval | None) -> dict[str, Any] | None:
    return None if interval is None else {"min": interval.min, "max": interval.max}


def finding_as_data(finding: Finding) -> dict[str, Any]:
    """A finding for JSON, with the fields that a finding of any kind of work has."""
    return {
        "rule": finding.rule,
        "name": finding.name,
        "severity": finding.severity.value,
        "message": finding.message,
        "location": _location(finding.location),
        "related": [
            {**_location(other.location), "message": other.message} for other in finding.related
        ],
        "scenario": None if finding.scenario is None else scenario_as_data(finding.scenario),
        "hint": finding.hint,
    }


def approximations_as_data(plan: PlanReport) -> list[dict[str, Any]]:
    """The constructs that were not read exactly, for JSON."""
    return [
        {
            "reading": each.reading.value,
            "construct": each.construct,
            "cause": each.cause.value,
            "location": _location(each.location),
        }
        for each in plan.approximations
    ]


def _finding(finding: Finding) -> dict[str, Any]:
    data = {**finding_as_data(finding), "confidence": finding.confidence.value}
    return data if finding.if_proved is None else {**data, "if_proved": finding.if_proved.value}


def _suppressed(finding: Finding) -> dict[str, Any]:
    return {
        **_finding(finding),
        "suppressed_by": finding.suppressed_by,
        "justification": finding.justification,
    }


def _setting(used: SettingUsed) -> dict[str, Any]:
    return {
        "setting": used.setting,
        "file": used.file or None,
        "effect": used.effect.value,
        "findings": used.findings,
        "errors": used.errors,
    }


def _location(location: Location) -> dict[str, Any]:
    place = {"line": location.line, "column": location.column, "element": location.element}
    return {**place, "file": location.file} if location.file else place


def scenario_as_data(scenario: Scenario) -> dict[str, Any]:
    """A scenario for JSON; ``gpsfsm run --scenario`` takes it."""
    return {
        "outcomes": [
            {"element": element, "outcome": outcome.value} for element, outcome in scenario.outcomes
        ],
        "ends": scenario.ends.value,
        "trace": [
            {
                **{"event": step.event.value, "element": step.element, "line": step.line},
                **({"file": step.file} if step.file else {}),
            }
            for step in scenario.trace
        ],
        "trace_truncated": scenario.trace_truncated,
        "story": list(scenario.story),
    }


def _line(inner: str) -> str:
    return f"\n   {inner}" if inner else ""


def _break(inner: str) -> str:
    return "\n" if inner else ""


def report_data(report: Report) -> dict[str, Any]:
    """The document that the format ``json`` writes."""
    data: dict[str, Any] = json.loads(_render(report, RenderOptions()))
    return data


def plan_report_data(plan: PlanReport) -> dict[str, Any]:
    """The entry of one plan in it."""
    entry: dict[str, Any] = report_data(Report((plan,)))["plans"][0]
    return entry


def report_frame(report: Report) -> Any:
    """A pandas DataFrame of the findings. Raises UsageError where pandas is not installed."""
    try:
        pandas = importlib.import_module("pandas")
    except ImportError as error:
        raise UsageError(
            "to_frame needs pandas, which is not installed: pip install pandas; to_dict() and "
            "findings need nothing"
        ) from error
    rows = [
        (
            *(plan.path, plan.verdict.value, each.rule, each.name, each.severity.value),
            *(each.message, each.location.line, each.location.column, each.hint),
        )
        for plan in report.plans
        for each in plan.findings
    ]
    return pandas.DataFrame(rows, columns=list(_COLUMNS))


_INDENTED = re.compile(r"\n *")
_ESCAPES = re.compile(
    r"\\\\|\\ud[89ab][0-9a-f]{2}\\ud[c-f][0-9a-f]{2}|(?P<lone>\\ud[89a-f][0-9a-f]{2})"
)
"""In JSON text: an escaped backslash, an escaped pair of surrogates, or half of one."""


def _readable(text: str) -> str:
    return _ESCAPES.sub(_replaced, text) if "\\ud" in text else text


def _replaced(match: re.Match[str]) -> str:
    """Half a surrogate pair (from a path that is no UTF-8, say) would stop strict readers."""
    return "\\ufffd" if match["lone"] else match[0]


_dump = json.JSONEncoder(ensure_ascii=True, allow_nan=False).encode


FORMAT = Format(name="json", render=_render, form=Form.JSON)
