"""Whether a fixed plan does what the plan did before: the proof that a safe fix is one."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING

from gpsfsm.analysis.rules import rule
from gpsfsm.compile import compile_plan
from gpsfsm.model.finding import Severity
from gpsfsm.reading import read_plan
from gpsfsm.tasks.equivalence import UndecidedError, compare
from gpsfsm.tasks.normal import Label, one_form

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.checking import CheckOptions
    from gpsfsm.compile import Compiled
    from gpsfsm.fixing.edit import Fix
    from gpsfsm.model.plan import Plan

__all__ = ["Sameness", "keeps", "sameness"]

_NAMING = "GP2"
_COORDINATES = "GP111"  # writes one parameter as two


class Sameness(StrEnum):
    """What two texts have in common.

    ``same``: they do the same (docs/tasks.md). ``renamed``: they do, but for the interfaces,
    providers and parameters of runners, which stand in the same places. ``different``: they do not.
    """

    SAME = "same"
    RENAMED = "renamed"
    DIFFERENT = "different"


def sameness(before: str, after: str, options: CheckOptions) -> Sameness | None:
    """Compare two texts; None if either has errors, or if it was not decided within a limit."""
    plans = _plans(before, after, options)
    if plans is None:
        return None
    found = _by_form(*plans)
    if found is not None:
        return found
    try:
        difference = compare(*plans, decider="lockstep")
    except UndecidedError:
        return None
    return Sameness.SAME if difference is None else Sameness.DIFFERENT


def keeps(before: str, after: str, fixes: Iterable[Fix], options: CheckOptions) -> bool:
    """Whether safe fixes provably keep what the plan does, where it was clear what it does.

    Fixes of names and of parameters may change these, and nothing else. Linear but for a logarithm.
    """
    plans = _plans(before, after, options)
    if plans is None:
        return True
    naming = any(fix.rule.startswith(_NAMING) or fix.rule == _COORDINATES for fix in fixes)
    found = _by_form(*plans)
    return found is Sameness.SAME or (naming and found is Sameness.RENAMED)


def _plans(before: str, after: str, options: CheckOptions) -> tuple[Plan, Plan] | None:
    first = _plan(before, options)
    second = None if first is None else _plan(after, options)
    return None if first is None or second is None else (first, second)


def _plan(text: str, options: CheckOptions) -> Plan | None:
    """The plan of a text without errors."""
    read = read_plan(text, limits=options.limits, from_response=options.from_response)
    if any(rule(problem.rule).severity is Severity.ERROR for problem in read.problems):
        return None
    return read.plan


def _by_form(first: Plan, second: Plan) -> Sameness | None:
    """What the normal forms of the plans prove; None: nothing."""
    compiled = compile_plan(first), compile_plan(second)
    numbers: dict[object, int] = {}
    labels = [
        [Label(numbers.setdefault(runner.action, len(numbers))) for runner in plan.runners]
        for plan in (first, second)
    ]
    if one_form(compiled, (labels[0], labels[1])):
        return Sameness.SAME
    if one_form(compiled, (_places(compiled[0]), _places(compiled[1]))):
        return Sameness.RENAMED
    return None


def _places(compiled: Compiled) -> list[Label]:
    """Every instance is equal to the one in the same place of the other plan."""
    return [Label(number) for number in range(len(compiled.automaton.plan.runners))]
