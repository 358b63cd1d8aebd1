"""Choices and moments: the two runners that machines have of their own.

A runner has two outcomes. What other tools say with more, or with what a machine does not know (a
value on a blackboard, a clock), becomes a *choice*: it holds (SUCCEEDED) or it does not (FAILED),
and nobody knows which. Of n outcomes, n - 1 choices in a row choose one:

    NAV  SUCCEEDED → target of "arrived";  FAILED → choice "NAV: blocked"
    choice "NAV: blocked"  SUCCEEDED → target of "blocked";  FAILED → target of "lost"

A *tick* is a moment that passes: it always succeeds. A loop in which nothing acts has one, since a
loop passes through an outcome (semantics, 9.1).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from gpsfsm.model.capability import Interface, Outcomes, Parameter, Provider, Span, ValueType

if TYPE_CHECKING:
    from collections.abc import Mapping

CHOICE: Final = "gpsfsm/ChoiceRunner"
"""The interface, and the provider, of a choice; its parameter ``of`` says what is chosen."""

TICK: Final = "gpsfsm/TickRunner"
"""The interface, and the provider, of a moment that passes."""


def _described(
    name: str,
    description: str,
    outcomes: Outcomes,
    duration: Span,
    configuration: tuple[Parameter, ...] = (),
) -> tuple[Interface, Provider]:
    interface = Interface(name, description, "1", name)
    provider = Provider(
        name,
        name,
        description=description,
        version="1",
        described=True,
        configuration=configuration,
        outcomes=outcomes,
        duration=duration,
    )
    return interface, provider


_OF = Parameter("of", ValueType.STRING, required=True, description="What is chosen.")

OWN: Final[Mapping[str, tuple[Interface, Provider]]] = {
    CHOICE: _described(
        CHOICE, "Holds or does not; nothing says which.", Outcomes(), Span(0.0, None), (_OF,)
    ),
    TICK: _described(TICK, "A moment that passes.", Outcomes(never_fails=True), Span(0.0, 0.0)),
}
"""Both by their names, described. No file describes them, and no model is offered them.

A choice may be one about a value, made at once, or a clock: it takes any time.
"""
