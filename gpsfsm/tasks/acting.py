"""What a runner instance works with, as the patterns of a task see it (docs/tasks.md)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.plan import NOT_PARAMETERS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.model.capability import Binding, Provider
    from gpsfsm.model.plan import Attribute, Element, Value

__all__ = ["Acting"]


class Acting:
    """The parameters of an instance by the names of its provider.

    Without a binding nothing is said of the runner: its attributes are all that it has.
    """

    def __init__(self, runner: Element, binding: Binding | None = None) -> None:
        self._binding = binding
        self._written: dict[str, Attribute] = {
            self.name_of(each.name): each
            for each in runner.attributes
            if each.name not in NOT_PARAMETERS
        }
        if binding is not None:
            self._written.update(binding.given)
        self.interface = runner.interface
        self.described = "" if binding is None else binding.interface.name

    def name_of(self, name: str) -> str:
        """The name of the parameter that goes by this name, which may be an alias."""
        parameter = None if self._binding is None else self._binding.provider.parameter(name)
        return name if parameter is None else parameter.name

    def values(self, name: str) -> Iterator[Value]:
        """The value that it works with, also as it looks where that is a text (8.2)."""
        attribute = self._written.get(name)
        if attribute is not None:
            yield attribute.value
        if self._binding is not None:
            yield from self._binding.readings(name)

    def names(self) -> Iterator[str]:
        """The names of all that it may have a value for."""
        yield from self._written
        if self._binding is not None:
            yield from _names(self._binding.provider)


def _names(provider: Provider) -> Iterator[str]:
    for parameter in provider.configuration:
        yield parameter.name
    for expected in provider.inputs:
        yield expected.name
