"""Equivalence of plans: do two plans act alike, whatever the outcomes (docs/tasks.md)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.equivalence.comparison import Decider, UndecidedError, compare
from gpsfsm.equivalence.pairs import Difference, Pair, Step
from gpsfsm.errors import InternalError, UsageError

if TYPE_CHECKING:
    from gpsfsm.model.plan import Plan

__all__ = [
    "Decider",
    "Difference",
    "Pair",
    "Step",
    "UndecidedError",
    "compare",
    "convert_plan",
    "targets",
]


def targets() -> tuple[str, ...]:
    """The names of the formats that can be written."""
    from gpsfsm.compile.formats import formats

    return tuple(name for name, each in formats().items() if each.write is not None)


def convert_plan(plan: Plan, to: str) -> str:
    """The text in another format that does the same as a plan, which is proved by comparing both.

    Raises UsageError for a format that is not there, CannotSayError for a node that it cannot say,
    UndecidedError if the comparison meets a limit, and InternalError if the text does something
    else.
    """
    from gpsfsm.compile import compile_plan
    from gpsfsm.compile.formats import formats
    from gpsfsm.compile.plan_text import read_plan_or_machine

    chosen = formats().get(to)
    if chosen is None or chosen.write is None:
        raise UsageError(f"there is no format '{to}'; there are {', '.join(targets())}")
    text = chosen.write(compile_plan(plan).automaton)
    again = read_plan_or_machine(text, file=plan.file)
    if again.plan is None:
        reasons = "; ".join(problem.message for problem in again.problems[:3])
        raise InternalError(f"what was written as {to} cannot be read: {reasons}")
    if compare(plan, again.plan) is not None:
        raise InternalError(f"what was written as {to} does something else")
    return text
