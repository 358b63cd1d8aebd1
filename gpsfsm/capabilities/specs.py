"""What a robot can do, as texts: what a GetCapabilitySpecsRunner hands over."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gpsfsm.capabilities.library import Library

__all__ = ["specs"]


def specs(library: Library) -> tuple[str, ...]:
    """A text for each capability: what it does and how a plan writes it."""
    found = []
    for name in library.interface_names:
        interface = library.interface(name)
        for provider in library.providers_of(name):
            about = "" if interface is None else interface.description
            found.append(f"{name}: {about} {provider.command}".strip())
    return tuple(found)
