"""Runners as texts, with parameters as their capability files describe them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

from hypothesis import strategies as st

from gpsfsm.capabilities.library import Capabilities, builtin_capabilities
from gpsfsm.model.capability import Source, ValueType

if TYPE_CHECKING:
    from hypothesis.strategies import DrawFn, SearchStrategy

    from gpsfsm.capabilities.library import Library
    from gpsfsm.model.capability import Input, Parameter, Provider

__all__ = ["runners"]

_WORDS = ("hello", "door", "Is anybody there?", "a < b & c", "ü")
_MOST = 100.0


def runners(library: Library | Capabilities | None = None) -> SearchStrategy[str]:
    """Draw a ``<Runner …/>`` of a library, the built-in one if none is given.

    Required parameters are there, others may be; values have the declared type and keep to the
    declared bounds and choices. Deprecated runners are not drawn. Shrinks to the first
    runner by name that needs no parameters.

    >>> from hypothesis import find, settings
    >>> find(runners(), lambda text: True, settings=settings(database=None))
    '<Runner interface="capabilities2_runner/GetCapabilitySpecsRunner" \
provider="capabilities2_runner/GetCapabilitySpecsRunner"/>'
    """
    known = library or builtin_capabilities()
    if isinstance(known, Capabilities):
        known = known.library
    usable = [found for found in known.providers if not found.deprecated]
    if not usable:
        raise ValueError("the library has no runner that could be drawn")
    ordered = sorted(usable, key=lambda found: found.name)
    return st.sampled_from(ordered).flatmap(_runner)


@st.composite
def _runner(draw: DrawFn, provider: Provider) -> str:
    given = {"interface": provider.implements, "provider": provider.name}
    inputs = {each.name for each in provider.inputs}
    for parameter in provider.configuration:
        needed = parameter.required and parameter.name not in inputs
        if needed or draw(st.integers(0, 3)) == 3:
            given[parameter.name] = draw(_values(parameter))
    for wanted in provider.inputs:
        outside = {Source.EXTERNAL, Source.CONFIGURATION} & set(wanted.satisfiable_from)
        if wanted.required and outside and wanted.name not in given:
            given[wanted.name] = draw(_values(provider.parameter(wanted.name) or wanted))
    attributes = "".join(f" {name}={quoteattr(text)}" for name, text in given.items())
    return f"<Runner{attributes}/>"


def _values(described: Parameter | Input) -> SearchStrategy[str]:
    choices: tuple[str, ...] = getattr(described, "choices", ())
    if choices:
        return st.sampled_from(choices)
    least, greatest = _bounds(described)
    kind = described.type
    if kind in (ValueType.BOOL, ValueType.BOOLS):
        return st.sampled_from(["false", "true"])
    if kind in (ValueType.INT, ValueType.INTS):
        return st.integers(math.ceil(least), math.floor(greatest)).map(str)
    if kind in (ValueType.DOUBLE, ValueType.DOUBLES):
        steps = st.integers(math.ceil(least * 2), math.floor(greatest * 2))
        return steps.map(lambda step: str(step / 2))
    return st.sampled_from(_WORDS)


def _bounds(described: Parameter | Input) -> tuple[float, float]:
    """Bounds between which there are numbers that shrink to 0, or to the least of them."""
    least: float | None = getattr(described, "minimum", None)
    greatest: float | None = getattr(described, "maximum", None)
    low = (
        (0.0 if greatest is None or greatest >= 0 else greatest - _MOST) if least is None else least
    )
    return low, max(low + 1.0, low + _MOST) if greatest is None else max(low, greatest)
