"""Libraries under other names: those that a robot has for its runners, and those of an engine.

The published stack has renamed its packages, and some parameters, with its versions. The built-in
library has one of the names of each. ``in_dialect`` gives what it describes the names that are
published with an engine; what files of the user describe keeps its own.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from gpsfsm.capabilities.library import Library, builtin_capabilities
from gpsfsm.model.story import FABRIC_V3

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.model.capability import Input, Interface, Output, Parameter, Provider

_Entry = TypeVar("_Entry", "Parameter", "Input", "Output")

_PACKAGES = {FABRIC_V3: {"perception_capabilities": "fp_perception_capabilities"}}
"""By engine: the packages that it has under another name than the built-in library."""

_KEYS = {
    FABRIC_V3: {
        "prompt_capabilities/PromptSpeechRunner": {"task": "speech_text", "text": "speech"},
    }
}
"""By engine and provider: parameters, inputs and outputs with another name there."""


def in_dialect(capabilities: Capabilities, engine: str) -> Capabilities:
    """The capabilities under the names of an engine; ``capabilities`` if it has none of its own."""
    library = library_in_dialect(capabilities.library, engine)
    if library is capabilities.library:
        return capabilities
    return replace(capabilities, library=library, named_by=engine)


def library_in_dialect(library: Library, engine: str) -> Library:
    """The built-in part of a library under the names of an engine.

    A library that is all there is stays: it is that of a robot, which has the names of its profile,
    or holds nothing that is built in.
    """
    if engine not in _PACKAGES or library.complete:
        return library
    if engine not in library.dialects:
        names = engine_names(library, engine)
        changed = {old: new for old, new in names.items() if old != new}
        named = with_keys(renamed(library, changed), engine)
        named.dialects[engine] = library.dialects[engine] = named
    return library.dialects[engine]


def engine_names(library: Library, engine: str) -> dict[str, str]:
    """The names of all runners on an engine, by those in the library."""
    packages = _PACKAGES.get(engine, {})
    builtin = builtin_capabilities().library
    names = {name: name for name in library.interface_names}
    for described in library.interfaces:
        package, _, bare = described.name.partition("/")
        there = f"{packages.get(package, package)}/{bare}"
        ours = builtin.interface(described.name)
        if ours is not None and ours.origin == described.origin and there in described.formerly:
            names[described.name] = described.name if there in names else there
    return names


def with_keys(library: Library, engine: str) -> Library:
    """The library with the parameters and outputs of the built-in one as an engine calls them."""
    builtin = builtin_capabilities().library
    providers = []
    for provider in library.providers:
        keys = _KEYS.get(engine, {}).get(provider.name, {})
        ours = builtin.provider(provider.name)
        own = ours is None or ours.origin != provider.origin
        providers.append(provider if own else _with_keys(provider, keys))
    return replace(library, providers=tuple(providers))


def _with_keys(provider: Provider, keys: Mapping[str, str]) -> Provider:
    """The old names stay as aliases: that is how runners and plans of other dialects have them."""
    if not keys:
        return provider
    buffer = provider.effects.prompt_buffer
    if buffer is not None:
        buffer = replace(buffer, answer=keys.get(buffer.answer, buffer.answer))
    return replace(
        provider,
        command=_command(provider.command, keys),
        configuration=tuple(_keyed(each, keys) for each in provider.configuration),
        inputs=tuple(
            replace(_keyed(each, keys), fallback=keys.get(each.fallback, each.fallback))
            for each in provider.inputs
        ),
        outputs=tuple(_keyed(each, keys) for each in provider.outputs),
        effects=replace(provider.effects, prompt_buffer=buffer),
    )


def _keyed(entry: _Entry, keys: Mapping[str, str]) -> _Entry:
    if entry.name not in keys:
        return entry
    there: str = keys[entry.name]
    aliases: tuple[str, ...] = (entry.name, *(each for each in entry.aliases if each != there))
    return replace(entry, name=there, aliases=aliases)


def _command(command: str, keys: Mapping[str, str]) -> str:
    for old, new in keys.items():
        command = command.replace(f"{old}='${old}'", f"{new}='${new}'")
    return command


# --- renaming -------------------------------------------------------------------------------------


def renamed(library: Library, names: Mapping[str, str]) -> Library:
    """The whole library, with some of its interfaces under other names."""
    if not names:
        return library
    everything = {name: names.get(name, name) for name in library.interface_names}
    part = selected(library, everything, same_rules=True)
    others = [
        each for each in library.providers if library.implemented(each.name) not in everything
    ]
    providers = sorted((*part.providers, *others), key=lambda each: each.name)
    return replace(part, providers=tuple(providers), complete=library.complete)


def selected(library: Library, names: Mapping[str, str], *, same_rules: bool = False) -> Library:
    """The runners with these names, under the names that they lead to; others are left out.

    ``same_rules``: whoever has these names keeps prompts as the library says (``elsewhere``).
    """
    kept = [each for each in library.semantic if each.name in names]
    targets = {each.redefines: each.redefines for each in kept} | dict(names)
    interfaces = [
        _interface(each, targets[each.name]) for each in library.interfaces if each.name in targets
    ]
    providers = []
    for each in library.providers:
        here = library.translation(each.implements) or each.implements
        if here in targets:
            others = targets[here] != here and not same_rules
            described = library.elsewhere(each) if others else each
            providers.append(_provider(described, here, targets))
    return Library(
        interfaces=tuple(sorted(interfaces, key=lambda each: each.name)),
        providers=tuple(sorted(providers, key=lambda each: each.name)),
        semantic=tuple(
            replace(each, name=names[each.name], redefines=targets[each.redefines]) for each in kept
        ),
    )


def _interface(described: Interface, name: str) -> Interface:
    if name == described.name:
        return described
    others = dict.fromkeys((described.name, *described.formerly))
    default = name if described.default_provider == described.name else described.default_provider
    return replace(
        described,
        name=name,
        formerly=tuple(each for each in others if each != name),
        default_provider=default,
    )


def _provider(described: Provider, here: str, targets: Mapping[str, str]) -> Provider:
    """A provider that has the name of its interface keeps doing so."""
    name = targets[here]
    return replace(
        described,
        name=name if described.name == here else described.name,
        implements=name,
        command=described.command.replace(here, name),
        depends_on=tuple(
            (targets.get(interface, interface), targets.get(provider, provider))
            for interface, provider in described.depends_on
        ),
    )
