"""Findings of the paper's semantics in the words of an engine that cannot give up."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from gpsfsm.model.event import End
from gpsfsm.model.finding import Severity

if TYPE_CHECKING:
    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.on_engine import OnEngine
    from gpsfsm.model.finding import Finding, Scenario

__all__ = ["without_give_up"]

_RULES = frozenset({"GP302", "GP303"})
_GIVES_UP = "the plan gives up"
_HANGS = "the plan hangs"


def without_give_up(finding: Finding, seen: OnEngine) -> Finding:
    """A failure or a join that makes the plan give up is an error on an engine that cannot.

    The scenario is told as it goes on there, if it does: other
    connections may lead elsewhere before, which is told by findings of their own.
    """
    if finding.rule not in _RULES or finding.severity is not Severity.WARNING:
        return finding
    scenario, then = finding.scenario, ""
    if scenario is None or seen.same or _hangs(scenario, seen.context):
        then = ": the plan hangs"
        if scenario is not None:
            story = tuple(line.replace(_GIVES_UP, _HANGS) for line in scenario.story)
            scenario = replace(scenario, ends=End.HANG, story=story)
    return replace(
        finding,
        severity=Severity.ERROR,
        message=f"{finding.message}; {seen.name} cannot give up{then}",
        scenario=scenario,
    )


def _hangs(scenario: Scenario, context: Context) -> bool:
    """Whether the scenario happens on the engine, and every run of it hangs."""
    numbers = {
        context.plan.path(runner): number for number, runner in enumerate(context.plan.runners)
    }
    if not all(path in numbers for path, _ in scenario.outcomes):
        return False
    decisions = {numbers[path]: outcome for path, outcome in scenario.outcomes}
    evaluator = context.deciders.evaluator
    reached = evaluator.surely(decisions).triggered
    if not all(context.automaton.runner_node(number) in reached for number in decisions):
        return False
    return evaluator.possibly(decisions).ends is End.HANG
