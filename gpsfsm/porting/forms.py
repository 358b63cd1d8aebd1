"""The tree of units → steps that an engine runs one after the other, and the losses.

The engines run a sequence of steps as the paper specifies, each a runner with further runners that
are tried one after the other when it fails. Controls without an effect are ignored. For any other
unit, the loss is recorded, and the unit is read in the closest form that does nothing that the
paper does not do: parallel units are put in sequence, and a recovery that the engine cannot start
is removed, so that the plan stops there.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.compile.units import UnitKind, Units, group_units
from gpsfsm.porting.result import Lost, Reason

if TYPE_CHECKING:
    from gpsfsm.model.plan import Plan


@dataclass(slots=True)
class Step:
    """``runners``: units, each tried when the one before has failed.

    ``recovery`` is the element that the further ones stand in: a recovery, or a parallel_any that
    is read as one; -1 without further ones. ``closed``: a step that would have followed its failure
    is left out, so nothing else may follow. ``quiet``: in the plan nothing follows from it when the
    last of the runners fails, so a recovery may not follow here either.
    """

    runners: list[int]
    recovery: int = -1
    closed: bool = False
    quiet: bool = False


class _Dropped(NamedTuple):
    """An element that is left out, and why."""

    element: int
    why: str


@dataclass(slots=True)
class Form:
    """A unit as steps.

    ``fails`` says whether it can fail; without steps it cannot. ``dropped`` are elements that
    change nothing.
    """

    steps: list[Step] = field(default_factory=list)
    fails: bool = False
    lost: list[Lost] = field(default_factory=list)
    dropped: list[_Dropped] = field(default_factory=list)

    def take(self, other: Form) -> None:
        """Add the steps of a unit behind these, and all that is to be said of it."""
        self.steps += other.steps
        self.tell(other)

    def tell(self, other: Form) -> None:
        """Add what is to be said of a unit."""
        self.lost += other.lost
        self.dropped += other.dropped


_EMPTY = "it runs nothing"
_DEAD = "nothing before it can fail, so it is never triggered"
_NEVER = "the step that it guards never fails, so it is never triggered"


def form_of(plan: Plan) -> tuple[Form, Units]:
    """The whole plan; linear, for any depth."""
    units = group_units(plan)
    forms: dict[int, Form] = {}
    dead: list[_Dropped] = []
    for unit in reversed(range(len(units))):  # parents come before their children
        inside = [forms.pop(child) for child in units.children[unit]]
        if units.kinds[unit] is UnitKind.DEAD:
            dead.append(_Dropped(units.elements[unit], _DEAD))
            continue
        forms[unit] = _form(units, unit, inside)
    whole = forms[0]
    whole.dropped = sorted([*whole.dropped, *dead])
    whole.lost.sort(key=lambda lost: (lost.element, lost.reason.value))
    return whole, units


def _form(units: Units, unit: int, inside: list[Form]) -> Form:
    kind, element = units.kinds[unit], units.elements[unit]
    if kind is UnitKind.RUNNER:
        return Form([Step([unit])], fails=True)
    if kind is UnitKind.SEQUENCE:
        return _row(inside)
    if kind is UnitKind.GUARD:
        return _guard(element, inside)
    if kind is UnitKind.ALL:
        return _all(element, inside)
    if kind is UnitKind.ANY:
        return _any(element, inside)
    return Form(dropped=[_Dropped(element, _EMPTY)])


def _row(inside: list[Form]) -> Form:
    """One after the other."""
    if not inside:
        return Form()
    form, *others = inside
    for other in others:
        form.fails |= other.fails
        form.take(other)
    return form


def _guard(element: int, inside: list[Form]) -> Form:
    form, *others = inside
    if not form.fails:
        form.dropped.append(_Dropped(element, _NEVER))
        return form
    if form.steps[-1].quiet:
        # of seq(a, any(b, empty)) a alone can fail; behind b the engine would start it for b
        form.steps[-1].closed = True
        form.lost.append(Lost(element, Reason.GUARDS_BEFORE_LAST, len(form.steps)))
        form.fails = all(each.fails for each in others)
        return form
    if len(form.steps) > 1:
        form.lost.append(Lost(element, Reason.GUARDS_ROW, len(form.steps)))
    _chain(form, element, others, beside=False)
    return form


def _chain(form: Form, element: int, others: list[Form], *, beside: bool) -> None:
    """The last step of ``form`` is followed by other units when it fails.

    ``beside``: they are alternatives that the plan has started anyway.
    """
    form.fails = all(each.fails for each in others)
    step = form.steps[-1]
    for other in others:
        count = len(other.steps)
        if step.closed and not beside:
            form.lost.append(Lost(element, Reason.BEHIND_LEFT_OUT, count))
            return
        if count == 1:
            step.recovery = element if step.recovery < 0 else step.recovery
            step.runners += other.steps[0].runners
            step.closed |= other.steps[0].closed
            step.quiet = other.steps[0].quiet
            form.tell(other)
            if not other.fails:  # what follows it is never triggered
                step.quiet = True
                return
        elif beside:
            step.closed = True
            form.lost.append(Lost(element, Reason.ALTERNATIVE_LEFT_OUT, count))
        else:
            step.closed = True
            reason = Reason.ROW_IN_RECOVERY if count else Reason.IGNORES_FAILURE
            form.lost.append(Lost(element, reason, count))
            return


def _all(element: int, inside: list[Form]) -> Form:
    busy = [form for form in inside if form.steps]
    form = _row(inside)
    if len(busy) > 1:
        form.lost.append(Lost(element, Reason.ALL, len(busy)))
    return form


def _any(element: int, inside: list[Form]) -> Form:
    busy = [form for form in inside if form.steps]
    if len(inside) == 1 or not busy:
        return _row(inside)
    if len(busy) < len(inside):  # it goes on at once, and what is in it runs beside all the rest
        form = _row(inside)
        form.fails = False
        form.steps[-1].quiet = True
        form.lost.append(Lost(element, Reason.BACKGROUND, len(busy)))
        return form
    form, *others = inside
    form.lost.append(Lost(element, Reason.ANY, len(busy)))
    if not form.fails:
        return form
    if len(form.steps) > 1:
        form.lost.append(Lost(element, Reason.ALTERNATIVE_ROW, len(form.steps)))
    _chain(form, element, others, beside=True)
    return form
