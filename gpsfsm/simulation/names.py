"""Whether the runners that a world file speaks of exist in the chosen capabilities."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.capabilities.defects import quoted
from gpsfsm.capabilities.library import namespace
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.capabilities.defects import Notes, Place
    from gpsfsm.capabilities.library import Library
    from gpsfsm.model.capability import Provider
    from gpsfsm.simulation.schema import AnswerFile, WorldFile

__all__ = ["check_names"]


def check_names(model: WorldFile, library: Library, notes: Notes) -> None:
    """Note the names of interfaces and outputs that no run with these capabilities ever looks up.

    Of packages of which the library describes nothing, only the full names are taken on trust.
    """
    known: dict[str, list[str]] = {}
    for interface in library.interfaces:
        known.setdefault(interface.name, []).append(interface.name)
        known.setdefault(_short(interface.name), []).append(interface.name)
    for name in model.runners:
        _check(name, model.below("runners", name), known, library, notes)
    for answer in model.answers:
        if _check(answer.to, answer.at("to"), known, library, notes):
            _check_outputs(answer, known.get(answer.to, []), library, notes)


def _check(
    name: str,
    place: Place,
    known: Mapping[str, list[str]],
    library: Library,
    notes: Notes,
) -> bool:
    if name in known:
        return True
    package, translated = namespace(name), library.translation(name)
    of_others = package and package not in library.namespaces and not library.complete
    if of_others and translated is None:
        return True
    if translated is not None and not any(
        provider.described for provider in library.providers_of(translated)
    ):
        return True  # runs ask by the name that the plan writes then
    notes.error(place, f"no interface is called {quoted(name)}", _hint(name, known, library, notes))
    return False


def _hint(name: str, known: Mapping[str, list[str]], library: Library, notes: Notes) -> str:
    now = library.translation(name)
    if now is not None:
        return f"it is called {quoted(now)} here"
    meant = library.interface(name)
    provider = library.provider(name)
    if meant is not None:  # a semantic interface: runners are asked by what it redefines
        return f"write {quoted(meant.name)}, which it redefines"
    if provider is not None:
        return f"that is a provider; write its interface, {quoted(provider.implements)}"
    near = notes.near(name, known) or notes.near(_short(name), known)
    otherwise = "give the folder of its capability file with --capabilities"
    if not namespace(name) and not library.complete:
        otherwise += ", or write it with its package if there is none"
    return f"{near} Else {otherwise}" if near else otherwise


def _check_outputs(
    model: AnswerFile, interfaces: list[str], library: Library, notes: Notes
) -> None:
    providers = [provider for name in interfaces for provider in library.providers_of(name)]
    if not providers or not all(provider.described for provider in providers):
        return
    event = Event.FAILED if model.fails else Event.SUCCEEDED
    declared = _outputs(providers, event)
    for name in model.outputs:
        if name in declared:
            continue
        when = "when it fails" if model.fails else "when it succeeds"
        message = f"{quoted(model.to)} has no output {quoted(name)} {when}"
        listed = ", ".join(declared)
        hint = notes.near(name, declared) or (f"known are {listed}" if listed else "remove it")
        notes.error(model.below("outputs", name), message, hint)


def _outputs(providers: list[Provider], event: Event) -> list[str]:
    names = {
        output.name: None
        for provider in providers
        for output in provider.outputs
        if output.event is event
    }
    return list(names)


def _short(name: str) -> str:
    return name.rpartition("/")[2]
