"""Grading answers of language models against a task, by the paper's rubric (docs/tasks.md)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import TYPE_CHECKING

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.analysis.rules import rule, select_rules
from gpsfsm.capabilities.library import bind
from gpsfsm.checking import CheckOptions
from gpsfsm.compile import TreePlan, compile_plan
from gpsfsm.fixing.engine import fix_text
from gpsfsm.model.finding import Severity
from gpsfsm.reading import read_plan
from gpsfsm.selection import Selection
from gpsfsm.tasks.deciding import decide_task
from gpsfsm.tasks.echo import Echo, echo_of
from gpsfsm.tasks.gist import gist_of

if TYPE_CHECKING:
    from gpsfsm.compile import Compiled
    from gpsfsm.model.capability import Binding
    from gpsfsm.model.finding import Problem
    from gpsfsm.model.plan import Plan
    from gpsfsm.syntax import Parsed
    from gpsfsm.tasks.deciding import Decision
    from gpsfsm.tasks.task import Task

__all__ = ["Grade", "Graded", "Grader"]


class Grade(StrEnum):
    """``success``: syntax and theory right; ``partial``: one of them; ``failed``: neither.

    ``undecided``: the theory could not be decided, so that there is no grade.
    """

    SUCCESS = "success"
    PARTIAL = "partial"
    FAILED = "failed"
    UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True)
class Graded:
    """The grade of one answer.

    ``syntax``: it reads as a plan without mending; ``theory``: the plan, mended if need be, fulfils
    the task (None: undecided). ``reason`` says why, in a line.
    """

    path: str
    grade: Grade
    syntax: bool
    theory: bool | None
    reason: str


_SYNTAX = "GP1"
_NO_TEXT = ("GP103",)


@dataclass(slots=True)
class Grader:
    """Grades answers against one task."""

    task: Task
    options: CheckOptions = field(default_factory=CheckOptions)

    def grade(self, text: str | bytes, path: str) -> Graded:
        """Grade one answer; never raises for anything that is in it."""
        parsed = self._parse(text, path)
        errors = [one for one in parsed.problems if _is_error(one)]
        if any(one.rule in _NO_TEXT for one in errors):
            return Graded(path, Grade.UNDECIDED, False, None, errors[0].message)
        plan, syntax = parsed.plan, not errors
        if errors:
            plan = self._mended(text, path)
        if plan is None or not plan.runners:
            why = "there is no plan in it" if plan is None else "the plan does nothing"
            return self._graded(path, syntax and plan is not None, False, _with(errors, why))
        compiled = compile_plan(plan, bindings=self._bindings(plan))
        name = self._echoed(compiled)
        if name:
            return Graded(path, Grade.FAILED, syntax, False, f"example returned: it is {name}")
        decision = self._decide(plan, compiled)
        return self._graded(path, syntax, decision.fulfilled, _with(errors, _why(decision)))

    def _parse(self, text: str | bytes, path: str) -> Parsed:
        return read_plan(text, file=path, limits=self.options.limits, from_response=True)

    def _mended(self, text: str | bytes, path: str) -> Plan | None:
        """The plan that was meant: the mended one, or else the gist of the text, or None."""
        selection = Selection(select=select_rules((_SYNTAX,)))
        options = replace(self.options, selection=selection, from_response=True, task=None)
        fixed = fix_text(text, options, path=path, unsafe=True)
        parsed = self._parse(fixed.text, path)
        if not any(map(_is_error, parsed.problems)):
            return parsed.plan
        return self._parse(gist_of(fixed.original), path).plan

    def _bindings(self, plan: Plan) -> tuple[Binding | None, ...] | None:
        if isinstance(plan, TreePlan):  # its nodes are no runners of a library
            return None
        return bind(plan, self.options.described.library)

    def _echoed(self, compiled: Compiled) -> str:
        """What the example is called that the plan is; "" if it is none."""
        for example in self.task.not_answers:
            if echo_of(compiled, compile_plan(example.plan)) is Echo.SAME:
                return example.name
        return ""

    def _decide(self, plan: Plan, compiled: Compiled) -> Decision:
        analysis = self.options.analysis
        constraints = constraints_of(
            plan,
            faults=analysis.faults,
            consistent=analysis.consistent,
            assumptions=analysis.assumptions,
            bindings=compiled.bindings,
        )
        if constraints.no_start:
            compiled = compile_plan(plan, start_chain=True, bindings=compiled.bindings)
        return decide_task(compiled, constraints, self.task)

    def _graded(self, path: str, syntax: bool, theory: bool | None, reason: str) -> Graded:
        if theory is None:
            return Graded(path, Grade.UNDECIDED, syntax, theory, reason)
        grades = (Grade.FAILED, Grade.PARTIAL, Grade.SUCCESS)
        return Graded(path, grades[syntax + theory], syntax, theory, reason)


def _is_error(problem: Problem) -> bool:
    return rule(problem.rule).severity is Severity.ERROR


def _why(decision: Decision) -> str:
    if decision.departures:
        first = decision.departures[0]
        told = "; ".join(first.scenario.story)
        return f"{first.rule} {first.message}: {told}"
    if decision.undecided:
        return f"not decided: {', '.join(decision.undecided)}"
    return "the task is fulfilled"


def _with(errors: list[Problem], reason: str) -> str:
    """The first syntax error, if there is any, and the reason."""
    if not errors:
        return reason
    first = errors[0]
    return f"{first.rule} in line {first.location.line}: {first.message}; mended: {reason}"
