"""Whether two plans do the same, whatever the outcomes and in whatever order they come."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from gpsfsm.analysis.solver import Inconclusive
from gpsfsm.compile import Compiled, compile_plan
from gpsfsm.errors import GpsfsmError, InternalError, UsageError
from gpsfsm.model.automaton import PAPER
from gpsfsm.tasks.behaviour import Behaviour
from gpsfsm.tasks.late import difference_of_late_pairs
from gpsfsm.tasks.likeness import sides_of
from gpsfsm.tasks.lockstep import TooManyStatesError, lockstep
from gpsfsm.tasks.pairs import Difference, Pair, Step
from gpsfsm.tasks.proof import NotProvedError, prove
from gpsfsm.tasks.together import difference_of_sets

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.model.plan import Plan
    from gpsfsm.tasks.pairs import Sides

__all__ = [
    "DEFAULT_RLIMIT",
    "Decider",
    "Difference",
    "Pair",
    "Step",
    "UndecidedError",
    "compare",
]

Decider = Literal["auto", "lockstep", "z3"]
"""``auto``: the normal forms, then the search, and z3 where the search meets its limit."""

DEFAULT_RLIMIT = 50_000_000
"""z3's own steps per question."""

_WORK = 300_000
_WORK_PER_RUNNER = 40
_MORE_WORK = 4
_SECOND_OPINION_UP_TO = 200
_SECOND_WORK = 60_000
_SECOND_RLIMIT = 5_000_000
_CONTRADICTION = "the two deciders differ on whether the plans do the same"


class UndecidedError(GpsfsmError):
    """Neither equal nor different could be shown within the limits."""


def compare(
    first: Plan | Compiled,
    second: Plan | Compiled,
    *,
    consistent: bool = False,
    assumptions: Sequence[str] = (),
    tolerance: float = 0.0,
    decider: Decider = "auto",
    second_opinion: bool = False,
    rlimit: int = DEFAULT_RLIMIT,
) -> Difference | None:
    """The first difference in behaviour, or None if no observer can tell the plans apart.

    ``consistent``: equal actions have equal outcomes, in either plan. ``assumptions``: only
    outcomes count that these admit in both plans. ``tolerance``: numbers of a parameter that differ
    by no more are equal. ``second_opinion``: of plans of up to 200 runners another decider is asked
    too. Raises UndecidedError; AssumptionError, or GpsfsmError where the assumptions contradict
    each other; and InternalError if the deciders do. The meaning is defined in docs/tasks.md.

    >>> from gpsfsm.syntax import parse
    >>> go = '<Runner interface="a/Go" x="1"/>'
    >>> one = parse(f"<Plan>{go}</Plan>").plan
    >>> other = parse(f"<Plan><Control type='sequential'>{go}</Control></Plan>").plan
    >>> compare(one, other) is None
    True
    """
    one, other = _compiled(first), _compiled(second)
    admission = None
    if assumptions:
        from gpsfsm.tasks.admission import admission_of  # noqa: PLC0415  (loads the analyses)

        admission = admission_of(one, other, assumptions, consistent=consistent)
    sides = sides_of(
        Behaviour(one),
        Behaviour(other),
        tolerance=tolerance,
        consistent=consistent,
        admission=admission,
    )
    try:
        return _decide(sides, decider, rlimit, second_opinion=second_opinion)
    except Inconclusive:
        raise UndecidedError("z3 met its limit on the assumptions") from None


def _compiled(plan: Plan | Compiled) -> Compiled:
    compiled = plan if isinstance(plan, Compiled) else compile_plan(plan)
    if compiled.automaton.traits != PAPER:
        raise UsageError("plans are compared as docs/semantics.md defines them, not as engines do")
    return compiled


def _decide(
    sides: Sides, decider: Decider, rlimit: int, *, second_opinion: bool
) -> Difference | None:
    size = len(sides.kinds[0]) + len(sides.kinds[1])
    confirms = second_opinion and size <= 2 * _SECOND_OPINION_UP_TO
    max_work = max(_WORK, _WORK_PER_RUNNER * size)
    if decider == "z3":
        return _by_z3(sides, rlimit)
    if decider == "auto" and sides.same_form:
        if confirms and not _searched(sides):
            _confirm(sides, min(rlimit, _SECOND_RLIMIT), None)
        return None
    try:
        found = lockstep(sides, max_work=max_work)
    except TooManyStatesError:
        if decider == "lockstep":
            raise UndecidedError(
                "the plans have more states than are searched; z3 may decide it"
            ) from None
        return _beyond(sides, max_work, rlimit)
    if confirms:
        _confirm(sides, min(rlimit, _SECOND_RLIMIT), found)
    return found


def _beyond(sides: Sides, max_work: int, rlimit: int) -> Difference | None:
    """Where there are too many states for the search."""
    for search in (difference_of_sets, difference_of_late_pairs):
        found = search(sides, max_work=max_work // 2)
        if found is not None:
            return found
    try:
        return _by_z3(sides, rlimit)
    except UndecidedError as undecided:
        try:
            return lockstep(sides, max_work=max_work * _MORE_WORK)
        except TooManyStatesError:
            raise undecided from None


def _by_z3(sides: Sides, rlimit: int) -> Difference | None:
    try:
        return prove(sides, rlimit=rlimit)
    except NotProvedError:
        raise UndecidedError(
            "neither a proof that the plans do the same nor a difference was found within the "
            "limits: they have too many states, or too many equal actions side by side"
        ) from None


def _searched(sides: Sides) -> bool:
    """Whether the search, too, finds that plans of one normal form do the same."""
    try:
        found = lockstep(sides, max_work=_SECOND_WORK)
    except TooManyStatesError:
        return False
    if found is not None:
        raise InternalError(_CONTRADICTION)
    return True


def _confirm(sides: Sides, rlimit: int, found: Difference | None) -> None:
    """Ask z3 too; that it does not decide says nothing. Raises InternalError if it differs."""
    try:
        other = prove(sides, rlimit=rlimit)
    except NotProvedError:
        return
    same = (other is None) == (found is None)
    if same and other is not None and found is not None and other.shortest and found.shortest:
        same = len(other.steps) == len(found.steps)
    if not same:
        raise InternalError(_CONTRADICTION)
