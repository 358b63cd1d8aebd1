"""Whether two plans do the same, whatever the outcomes and in whatever order they come."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from gpsfsm.compile import Compiled, compile_plan
from gpsfsm.errors import GpsfsmError, InternalError
from gpsfsm.tasks.behaviour import Behaviour
from gpsfsm.tasks.likeness import sides_of
from gpsfsm.tasks.lockstep import TooManyStatesError, lockstep
from gpsfsm.tasks.pairs import Difference, Pair, Step
from gpsfsm.tasks.proof import NotProvedError, prove

if TYPE_CHECKING:
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
"""``auto``: the search, and z3 where the search meets its limit."""

DEFAULT_RLIMIT = 50_000_000
"""z3's own steps per question."""

_WORK = 300_000
_WORK_PER_RUNNER = 40
_MORE_WORK = 4
_SECOND_OPINION_UP_TO = 200


class UndecidedError(GpsfsmError):
    """Neither equal nor different could be shown within the limits."""


def compare(
    first: Plan | Compiled,
    second: Plan | Compiled,
    *,
    consistent: bool = False,
    tolerance: float = 0.0,
    decider: Decider = "auto",
    second_opinion: bool = False,
    rlimit: int = DEFAULT_RLIMIT,
) -> Difference | None:
    """The first difference in behaviour, or None if no observer can tell the plans apart.

    ``consistent``: equal actions have equal outcomes, in either plan. ``tolerance``: numbers of a
    parameter that differ by no more are equal. ``second_opinion``: plans of up to 200 runners are
    also given to z3. Raises UndecidedError, and InternalError if the deciders contradict each
    other. The meaning is defined in docs/tasks.md.

    >>> from gpsfsm.syntax import parse
    >>> go = '<Runner interface="a/Go" x="1"/>'
    >>> one = parse(f"<Plan>{go}</Plan>").plan
    >>> other = parse(f"<Plan><Control type='sequential'>{go}</Control></Plan>").plan
    >>> compare(one, other) is None
    True
    """
    behaviours = [Behaviour(_compiled(plan)) for plan in (first, second)]
    sides = sides_of(*behaviours, tolerance=tolerance, consistent=consistent)
    if decider == "z3":
        return _by_z3(sides, rlimit)
    size = len(sides.kinds[0]) + len(sides.kinds[1])
    max_work = max(_WORK, _WORK_PER_RUNNER * size)
    try:
        found = lockstep(sides, max_work=max_work)
    except TooManyStatesError:
        if decider == "lockstep":
            raise UndecidedError(
                "the plans have more states than are searched; z3 may decide it"
            ) from None
        try:
            return _by_z3(sides, rlimit)
        except UndecidedError as undecided:
            return _again(sides, max_work * _MORE_WORK, undecided)
    if second_opinion and size <= 2 * _SECOND_OPINION_UP_TO:
        _confirm(sides, rlimit, found)
    return found


def _compiled(plan: Plan | Compiled) -> Compiled:
    return plan if isinstance(plan, Compiled) else compile_plan(plan)


def _again(sides: Sides, max_work: int, undecided: UndecidedError) -> Difference | None:
    """What the search finds with more work, now that nothing else has helped."""
    try:
        return lockstep(sides, max_work=max_work)
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
        raise InternalError("the two deciders differ on whether the plans do the same")
