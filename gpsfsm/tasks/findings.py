"""Where a plan leaves its task, as findings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules import rule
from gpsfsm.analysis.words import listed
from gpsfsm.compile import compile_plan
from gpsfsm.tasks.deciding import Effort, decide_task
from gpsfsm.tasks.echo import Echo, echo_of
from gpsfsm.tasks.search import DEFAULT_MOVES

if TYPE_CHECKING:
    from gpsfsm.analysis.context import Context
    from gpsfsm.model.finding import Finding
    from gpsfsm.tasks.task import Task

__all__ = ["task_findings"]

MOST_MOVES = DEFAULT_MOVES


def task_findings(context: Context, task: Task) -> tuple[list[Finding], list[str], list[str]]:
    """The findings GP6xx of a plan, and what could not be decided.

    That is the names of demands beyond the limits, and what is to be said of demands that values
    decide which arrive.
    """
    compiled, plan = context.compiled, context.plan
    findings: list[Finding] = []
    undecided: list[str] = []
    for example in task.not_answers:
        echo = echo_of(compiled, compile_plan(example.plan))
        if echo is Echo.SAME:
            message = f"this plan does what '{example.name}' does, which is no answer to the task"
            findings.append(rule("GP609").finding(message, plan.location(0)))
        elif echo is Echo.UNDECIDED:
            undecided.append(f"whether the plan is '{example.name}'")
    constraints = context.deciders.constraints
    options = context.options
    effort = Effort(options.solver, MOST_MOVES, options.rlimit, options.second_opinion)
    decision = decide_task(compiled, constraints, task, effort=effort)
    for departure in decision.departures:
        element = 0 if departure.runner is None else plan.runners[departure.runner].index
        scenario = departure.scenario if context.options.max_scenarios else None
        findings.append(
            rule(departure.rule).finding(
                departure.message, plan.location(element), scenario=scenario
            )
        )
    told = [
        f"{each.demand} cannot be decided: what arrives as {listed(list(each.names))} at "
        f"{context.place(plan.runners[each.runner])} counts more than what the plan writes, and "
        "decides whether that action is meant"
        for each in decision.unknown
    ]
    open_ = {each.demand for each in decision.unknown}
    undecided += (name for name in decision.undecided if name not in open_)
    return findings, undecided, told
