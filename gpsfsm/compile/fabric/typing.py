"""The parameters of a runner, as the engines type them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from gpsfsm.compile.fabric.numbers import read_double, read_int
from gpsfsm.model.engine import OptionType, Parameter

if TYPE_CHECKING:
    from gpsfsm.model.engine import EngineElement

__all__ = ["NOT_TYPED", "integer", "raw_parameters", "string", "typed", "typed_parameters"]

NOT_TYPED = ("interface", "provider")
"""The attributes of a runner that are no parameters to any engine."""


def typed(name: str, text: str) -> Parameter:
    """A parameter as the second version types it: exactly true or false, integer, number, text.

    >>> typed("x", "1e3").text, typed("x", "2147483648").text, typed("x", "True").type.name
    ('1000.000000', '-2147483648', 'STRING')
    """
    if text in ("true", "false"):
        return Parameter(name, OptionType.BOOL, text == "true", text)
    number = read_int(text)
    if number is not None:
        return integer(name, number)
    real = read_double(text)
    if real is not None:
        return Parameter(name, OptionType.DOUBLE, real, _six_decimals(real))
    return string(name, text)


def integer(name: str, value: int) -> Parameter:
    """A parameter that the engine itself sets to a number."""
    return Parameter(name, OptionType.INT, value, str(value))


def string(name: str, text: str) -> Parameter:
    """A parameter that is text."""
    return Parameter(name, OptionType.STRING, text, text)


def typed_parameters(element: EngineElement) -> tuple[Parameter, ...]:
    """All parameters of a runner, typed, in the order of its attributes."""
    return tuple(
        typed(attribute.name, attribute.value)
        for attribute in element.attributes
        if attribute.name not in NOT_TYPED
    )


def raw_parameters(element: EngineElement, instance: int) -> tuple[Parameter, ...]:
    """All parameters of a runner as the first version keeps them: as they are written.

    It writes the instance into the attribute ``id``, over what the plan says there.
    """
    texts = {
        attribute.name: attribute.value
        for attribute in element.attributes
        if attribute.name not in NOT_TYPED
    }
    texts["id"] = str(instance)
    return tuple(
        Parameter(name, OptionType.UNCONVERTED, text, text) for name, text in texts.items()
    )


def _six_decimals(value: float) -> str:
    """What C++'s ``std::to_string`` makes of a number; C, unlike Python, writes the sign of nan."""
    if math.isnan(value):
        return "-nan" if math.copysign(1.0, value) < 0 else "nan"
    return f"{value:f}"
