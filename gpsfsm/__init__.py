"""gpsfsm: formal checks for robot plans that language models write.

>>> import gpsfsm
>>> gpsfsm.check("<Plan/>").plans[0].verdict.value
'accept'
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from gpsfsm.model.showing import Show, offer
from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from gpsfsm.analysis.rules import Rule, all_rules
    from gpsfsm.api import check
    from gpsfsm.compile import compile_plan
    from gpsfsm.errors import GpsfsmError, InputError, InternalError, UsageError
    from gpsfsm.gating import gate
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.event import End, Event, Outcome
    from gpsfsm.model.finding import Finding, Scenario, Severity
    from gpsfsm.model.plan import Location, Plan
    from gpsfsm.model.report import Facts, PlanReport, Report, Verdict
    from gpsfsm.report import render
    from gpsfsm.syntax import Limits, parse

__all__ = [
    "Automaton",
    "End",
    "Event",
    "Facts",
    "Finding",
    "GpsfsmError",
    "InputError",
    "InternalError",
    "Limits",
    "Location",
    "Outcome",
    "Plan",
    "PlanReport",
    "Report",
    "Rule",
    "Scenario",
    "Severity",
    "UsageError",
    "Verdict",
    "__version__",
    "all_rules",
    "check",
    "compile_plan",
    "gate",
    "parse",
    "render",
]

__version__ = VERSION

_HOMES = {
    "analysis.rules": ("Rule", "all_rules"),
    "api": ("check",),
    "compile": ("compile_plan",),
    "errors": ("GpsfsmError", "InputError", "InternalError", "UsageError"),
    "gating": ("gate",),
    "model.automaton": ("Automaton",),
    "model.event": ("End", "Event", "Outcome"),
    "model.finding": ("Finding", "Scenario", "Severity"),
    "model.plan": ("Location", "Plan"),
    "model.report": ("Facts", "PlanReport", "Report", "Verdict"),
    "report": ("render",),
    "syntax": ("Limits", "parse"),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}


def _later(name: str) -> Show:
    """Load what draws only when a notebook asks for it."""

    def show(value: Any) -> str | None:
        found: str | None = getattr(importlib.import_module("gpsfsm.notebook"), name)(value)
        return found

    return show


for _name in ("automaton_svg", "plan_svg", "plan_report_html", "report_html"):
    offer(_name, _later(_name))


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'gpsfsm' has no attribute '{name}'")
    return getattr(importlib.import_module(f"gpsfsm.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
