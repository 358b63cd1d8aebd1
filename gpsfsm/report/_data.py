"""Reports as data for programs in Python: dictionaries, and tables of pandas."""

from __future__ import annotations

import importlib
import json
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import UsageError
from gpsfsm.model.report import Report
from gpsfsm.report import render

if TYPE_CHECKING:
    from gpsfsm.model.report import PlanReport

_COLUMNS = ("path", "verdict", "rule", "name", "severity", "message", "line", "column", "hint")


def report_data(report: Report) -> dict[str, Any]:
    """What the format ``json`` writes."""
    data: dict[str, Any] = json.loads(render(report, "json"))
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
