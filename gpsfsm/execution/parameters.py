"""The values that an instance works with (semantics, section 8.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.capability import ValueType

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.execution.records import RunValue
    from gpsfsm.model.capability import Binding
    from gpsfsm.model.plan import Element

__all__ = ["converted", "handed_over", "parameters"]


def parameters(
    runner: Element, binding: Binding | None, arriving: Mapping[str, RunValue]
) -> dict[str, RunValue]:
    """What arrives, else what the plan writes, also for the fallback, else a default (8.2).

    An undescribed runner gets what the plan writes and all that arrives.
    """
    if binding is None:
        return {
            name: converted(value, ValueType.ANY)
            for name, value in {**runner.parameters, **arriving}.items()
        }
    found = _written(binding)
    provider = binding.provider
    types = {parameter.name: parameter.type for parameter in provider.configuration}
    types.update((expected.name, expected.type) for expected in provider.inputs)
    for name, arrived in arriving.items():
        if name in types:
            found[name] = converted(arrived, types[name])
    return found


def _written(binding: Binding) -> dict[str, RunValue]:
    """What the plan writes, else the defaults."""
    provider, given = binding.provider, binding.given
    found: dict[str, RunValue] = {}
    for parameter in provider.configuration:
        value = binding.value(parameter.name)
        if value is not None:
            attribute = given.get(parameter.name)
            is_text = parameter.type in (ValueType.STRING, ValueType.ANY)
            written = attribute.text if attribute is not None and is_text else value
            found[parameter.name] = converted(written, parameter.type)
    for expected in provider.inputs:
        name, stand_in = expected.name, expected.fallback
        attribute = given.get(name)
        if attribute is not None:
            is_text = expected.type is ValueType.STRING
            found[name] = attribute.text if is_text else attribute.value
        elif stand_in in given and stand_in in found:
            found[name] = found[stand_in]
        elif expected.default is not None:
            found[name] = expected.default
        elif name not in found and stand_in in found:
            found[name] = found[stand_in]  # its default
        if name in found:
            found[name] = converted(found[name], expected.type)
    return found


def converted(value: RunValue, wanted: ValueType) -> RunValue:
    """A whole number where a double is wanted is one; everything else stays as it is.

    Lists are copied: what a runner does to what it gets must not reach anybody else.
    """
    if isinstance(value, list):
        inner = ValueType.DOUBLE if wanted is ValueType.DOUBLES else ValueType.ANY
        return [converted(item, inner) for item in value]
    if wanted is ValueType.DOUBLE and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    return value


def handed_over(
    binding: Binding | None, succeeded: bool, outputs: Mapping[str, RunValue]
) -> Mapping[str, RunValue]:
    """The outputs that travel with an outcome: those that the provider declares for it."""
    if binding is None:
        return outputs
    from gpsfsm.model.event import Event  # noqa: PLC0415

    event = Event.SUCCEEDED if succeeded else Event.FAILED
    names: Sequence[str] = [
        found.name for found in binding.provider.outputs if found.event is event
    ]
    return {name: outputs[name] for name in names if name in outputs}
