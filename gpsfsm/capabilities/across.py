"""What capability files say of each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.capabilities.defects import Defect, Notes, quoted
from gpsfsm.capabilities.library import Match
from gpsfsm.model.capability import Interface, Provider

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from gpsfsm.capabilities.entries import Entry
    from gpsfsm.capabilities.library import Library

__all__ = ["cross_defects"]


def cross_defects(entries: Iterable[Entry], library: Library) -> Iterator[Defect]:
    """Warnings about names that mean nothing in ``library``, which holds the entries as well."""
    for entry in entries:
        notes = Notes(entry.file)
        value = entry.value
        if isinstance(value, Provider):
            _check_provider(value, entry, library, notes=notes)
        elif isinstance(value, Interface):
            _check_interface(value, entry, library, notes=notes)
        elif not any(value.redefines == found.name for found in library.interfaces):
            message = f"it redefines {quoted(value.redefines)}, which no file describes"
            notes.warning(
                entry.places["redefines",],
                message,
                _interface_hint(value.redefines, library, notes),
            )
        yield from notes.defects


def _check_provider(value: Provider, entry: Entry, library: Library, *, notes: Notes) -> None:
    if value.implements not in library.interface_names:
        message = f"it implements {quoted(value.implements)}, which no file describes"
        hint = _interface_hint(value.implements, library, notes)
        notes.warning(entry.places["implements",], message, hint)
    for name, wanted in value.depends_on:
        place = entry.places["depends_on", name]
        if name not in library.interface_names:
            message = f"it depends on {quoted(name)}, which no file describes"
            notes.warning(place, message, _interface_hint(name, library, notes))
        elif wanted and library.provider(wanted) is None:
            message = f"it depends on the provider {quoted(wanted)}, which no file describes"
            notes.warning(place, message, _provider_hint(wanted, library, notes))
        elif library.resolve(name, wanted).match is Match.MISMATCH:
            implemented = library.implemented(wanted)
            message = (
                f"it depends on the provider {quoted(wanted)} for {quoted(name)}, which implements "
                f"{quoted(implemented)}"
            )
            notes.warning(place, message, f"write {quoted(implemented)}, or another provider")


def _check_interface(value: Interface, entry: Entry, library: Library, *, notes: Notes) -> None:
    wanted = value.default_provider
    if not wanted:
        return
    place = entry.places["default_provider",]
    found = library.provider(wanted)
    if found is None:
        message = f"the default provider {quoted(wanted)} is described by no file"
        notes.warning(place, message, _provider_hint(wanted, library, notes))
    elif found.implements != value.name:
        message = f"the default provider {quoted(wanted)} implements {quoted(found.implements)}"
        notes.warning(place, message, f"name a provider that implements {quoted(value.name)}")


def _interface_hint(name: str, library: Library, notes: Notes) -> str:
    translated = library.translation(name)
    if translated is not None:
        return f"it is called {quoted(translated)} here"
    return _hint(name, library.interface_names, notes)


def _provider_hint(name: str, library: Library, notes: Notes) -> str:
    return _hint(name, [found.name for found in library.providers], notes)


def _hint(name: str, known: Iterable[str], notes: Notes) -> str:
    """The same name in another package is nearer than what is spelt alike."""
    if notes.full:
        return ""
    listed = list(known)
    same = [each for each in listed if each.rpartition("/")[2] == name.rpartition("/")[2]]
    if same:
        return f"did you mean {quoted(same[0])}?"
    return notes.near(name, listed) or "describe it, or load its files as well"
