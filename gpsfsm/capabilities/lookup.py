"""Which entries of a library a name means, as people write names."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING

from gpsfsm.capabilities.defects import quoted
from gpsfsm.errors import UsageError

if TYPE_CHECKING:
    from gpsfsm.capabilities.library import Library
    from gpsfsm.model.capability import Interface, Provider, SemanticInterface

__all__ = ["Found", "find"]

_MAX_HINTS = 3
_LIKE = 0.8  # so many names end in Runner that less is no likeness


@dataclass(frozen=True, slots=True)
class Found:
    """What a name means. ``name`` is how the library writes it.

    For an interface, ``providers`` are all that implement it, the default one first; for a
    semantic interface, ``interface`` is the one that it redefines; a provider stands alone only if
    no interface has its name.
    """

    name: str
    interface: Interface | None
    semantic: SemanticInterface | None
    providers: tuple[Provider, ...]


def find(library: Library, wanted: str) -> Found:
    """What ``wanted`` means: a name, one of another dialect, or one without package if unique.

    Raises UsageError, with names that are near, if it means nothing or several things.
    """
    names = sorted({*library.interface_names, *(found.name for found in library.providers)})
    name = wanted if wanted in names else library.translation(wanted)
    if name is None and "/" not in wanted:
        name = _short(names, wanted)
    if name is None:
        raise UsageError(f"there is no capability {quoted(wanted)}; {_hint(names, wanted)}")
    semantic = next((found for found in library.semantic if found.name == name), None)
    interface = library.interface(name)
    alone = library.provider(name)
    providers = library.providers_of(name)
    if not providers and interface is None and semantic is None and alone is not None:
        providers = (alone,)
    return Found(name, interface, semantic, providers)


def _short(names: list[str], wanted: str) -> str | None:
    found = [name for name in names if name.rpartition("/")[2] == wanted]
    if len(found) > 1:
        listed = " or ".join(map(quoted, found[:_MAX_HINTS]))
        raise UsageError(f"{quoted(wanted)} is the name of several capabilities; write {listed}")
    return found[0] if found else None


def _hint(names: list[str], wanted: str) -> str:
    bare = wanted.rpartition("/")[2].lower()
    shorts = {name.rpartition("/")[2].lower(): name for name in names}
    near = [shorts[match] for match in get_close_matches(bare, list(shorts), _MAX_HINTS, _LIKE)]
    near += [name for name in names if bare and bare in name.lower()]
    listed = list(dict.fromkeys(near))[:_MAX_HINTS]
    if listed:
        return f"did you mean {' or '.join(map(quoted, listed))}?"
    return "'gpsfsm capabilities list' lists them"
