"""The values that an instance works with (semantics, section 8.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.capability import ValueType, fitting

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
    provider = binding.provider
    types = {parameter.name: parameter.type for parameter in provider.configuration}
    types.update((expected.name, expected.type) for expected in provider.inputs)
    worked_with = ((name, binding.worked_with(name)) for name in types)
    found: dict[str, RunValue] = {name: value for name, value in worked_with if value is not None}
    for name, arrived in arriving.items():
        if name in types:
            found[name] = converted(arrived, types[name])
    return found


def converted(value: RunValue, wanted: ValueType) -> RunValue:
    """A whole number where a double is wanted is one; everything else stays as it is.

    Lists are copied: what a runner does to what it gets must not reach anybody else.
    """
    if isinstance(value, list):
        inner = ValueType.DOUBLE if wanted is ValueType.DOUBLES else ValueType.ANY
        return [converted(item, inner) for item in value]
    return fitting(value, wanted)


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
