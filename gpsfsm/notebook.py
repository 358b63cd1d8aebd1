"""What a notebook shows of plans, automata and reports; they ask for it themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.compile import compile_plan
from gpsfsm.picture import automaton_to_svg
from gpsfsm.report import _html

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.plan import Plan
    from gpsfsm.model.report import PlanReport, Report

__all__ = ["automaton_svg", "plan_report_html", "plan_svg", "report_html"]

_MOST_NODES = 2_000


def automaton_svg(automaton: Automaton) -> str | None:
    """The picture of an automaton; None for one that nobody could look at."""
    return automaton_to_svg(automaton) if len(automaton.nodes) <= _MOST_NODES else None


def plan_svg(plan: Plan) -> str | None:
    """The picture of a plan's automaton."""
    return automaton_svg(compile_plan(plan).automaton)


def plan_report_html(report: PlanReport) -> str:
    """Verdict, findings and picture of a plan."""
    return _html.plan_html(report)


def report_html(report: Report) -> str:
    """All plans of a report."""
    return _html.report_html(report)
