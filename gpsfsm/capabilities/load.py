"""Reading capability files: each for itself, and then what they say of each other."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.capabilities.defects import Defect, Notes, quoted
from gpsfsm.capabilities.entries import (
    Entry,
    InterfaceFile,
    ProviderFile,
    SemanticFile,
    interface,
    provider,
    semantic,
)
from gpsfsm.capabilities.exports import owner, packages_in, unexported
from gpsfsm.capabilities.files import (
    KINDS,
    MANIFEST,
    MAX_NAME,
    Naming,
    find_files,
    may_be_capability,
    naming,
    read_bytes,
)
from gpsfsm.capabilities.library import Library, Match, namespace
from gpsfsm.capabilities.reading import Scalar, Table, kind_of, read_table, validate
from gpsfsm.errors import UsageError
from gpsfsm.model.capability import Interface, Provider, SemanticInterface
from gpsfsm.model.printable import printable

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from gpsfsm.capabilities.entries import CapabilityFile, Entry
    from gpsfsm.capabilities.exports import Export, Package

_NEWEST = (1, 2)
_VERSION = re.compile(r"\d{1,4}(\.\d{1,4}){0,3}")
_NAMED = re.compile(r"(?:name|implements|redefines)\W{1,9}([\w./-]{1,200})")
_MOST_SHOWN = 20
_NONE_EXPORTED = "no capability file in it can be used, by what package.xml says:"
_NO_FILE = """there is no capability file in it; such files are
  package/interfaces/Name.yaml, package/providers/Name.yaml and
  package/semantic_interfaces/Name.yaml"""


@dataclass(frozen=True, slots=True)
class Loaded:
    """The content of capability files. ``files`` is the number of files that were read.

    ``described``: by file, the name of what it describes; bare names where it could not be read.
    """

    library: Library
    defects: tuple[Defect, ...]
    files: int
    described: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def load_directories(paths: Sequence[str | Path], *, base: Library | None = None) -> Loaded:
    """Read all capability files below these folders; a path may also name one file.

    Entries of a later path replace those of earlier ones. ``base`` is the library that they are
    to extend: what is described there may be named. A file that does not fit stops no other one;
    what is wrong with it is among the defects. Raises UsageError for a path that cannot be read or
    holds no capability file.
    """
    defects: list[Defect] = []
    entries: dict[tuple[type, str], Entry] = {}
    seen: dict[str, tuple[str, ...]] = {}
    for path in map(str, paths):
        loaded, described = _load(path, defects)
        entries |= loaded
        seen |= described
    library = _library(entry.value for entry in entries.values())
    defects += cross_defects(list(entries.values()), (base or Library()).extended(library))
    ordered = tuple(sorted(set(defects), key=lambda each: each.order))
    return Loaded(library, ordered, len(seen), seen)


def _load(
    path: str, defects: list[Defect]
) -> tuple[dict[tuple[type, str], Entry], dict[str, tuple[str, ...]]]:
    """The entries of one path, and the names in the files that were read."""
    entries: dict[tuple[type, str], Entry] = {}
    twice: list[_Twice] = []
    read: dict[str, tuple[str, ...]] = {}
    folder = _Folder(path)
    for file in folder.files:
        notes = Notes(file)
        content = read_bytes(file, notes)
        if not folder.seen(file, content):
            continue
        table = None if content is None else read_table(content, notes)
        entry = None if table is None else _entry(table, file, folder.naming(file), notes)
        read[file] = _seeming(file, content) if entry is None else (entry.value.name,)
        if entry is not None:
            key = (type(entry.value), entry.value.name)
            if key in entries:
                twice.append(_better(entries[key], entry))
                entry = twice[-1].used
            entries[key] = entry
        defects += notes.defects
    of_packages = folder.defects()
    if not read:
        why = "\n".join(map(str, of_packages[:_MOST_SHOWN]))
        raise UsageError(f"{path}: {_NONE_EXPORTED}\n{why}" if why else f"{path}: {_NO_FILE}")
    defects += of_packages
    defects += _doubles(twice)
    return entries, read


def _seeming(file: str, content: bytes | None) -> tuple[str, ...]:
    """The bare names that a file without an entry seems to describe; none if that is anything."""
    if content is None:
        return ()
    words = [Path(file).stem, *_NAMED.findall(content.decode("utf-8", "replace"))]
    return tuple(sorted({word.rpartition("/")[2] for word in words} - {""}))


class _Folder:
    """The files of one path, and which of them a robot sees: in a ROS package, what it exports."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._notes: dict[str, Notes] = {}  # by package.xml
        self._unexported: dict[str, list[str]] = {}  # by the folder of the package
        self._packages = packages_in(path, self._notes)
        self._exports: dict[str, tuple[Package, Export]] = {}
        for package in self._packages.values():
            notes = self._notes[str(Path(package.folder, MANIFEST))]
            for file, export in package.exported(notes).items():
                self._exports[file] = package, export
        self.files = sorted({*find_files(path), *self._exports})

    def seen(self, file: str, content: bytes | None) -> bool:
        """True if a file is to be read as one of capabilities; ``content`` None: it cannot be."""
        if file == self._path or file in self._exports:
            return True
        if content is not None and not may_be_capability(file, content):
            return False
        package = owner(file, self._packages)
        if package is None:
            return True
        if package.exports is not None:
            self._unexported.setdefault(package.folder, []).append(file)
        return False

    def naming(self, file: str) -> Naming:
        """The kind, package and name of a file by package.xml, else by its path."""
        place = naming(file)
        if file not in self._exports:
            return place
        package, export = self._exports[file]
        return Naming(export.kind, package.name, place.name, exported=True)

    def defects(self) -> list[Defect]:
        """The defects of the packages."""
        of_all = [defect for notes in self._notes.values() for defect in notes.defects]
        for folder, files in self._unexported.items():
            notes = Notes(files[0])
            unexported(self._packages[folder], files, notes)
            of_all += notes.defects
        return of_all


class _Twice(NamedTuple):
    """Two descriptions of one thing, and why the first of these is used."""

    used: Entry
    other: Entry
    why: str


def _better(first: Entry, second: Entry) -> _Twice:
    """Of two descriptions of one thing in one folder: the newer form, else the first."""
    used, other = (second, first) if second.version > first.version else (first, second)
    newer = second.version != first.version
    return _Twice(used, other, "it has the higher spec_version" if newer else "it comes first")


def _doubles(twice: Sequence[_Twice]) -> Iterator[Defect]:
    """One warning for all files of one folder that are described again in one other folder."""
    groups: dict[tuple[str, ...], list[_Twice]] = {}
    for each in twice:
        key = str(Path(each.other.file).parent), str(Path(each.used.file).parent), each.why
        same = key[0] == key[1]
        groups.setdefault((*key, each.other.file if same else ""), []).append(each)
    for pairs in groups.values():
        used, other, why = pairs[0]
        notes = Notes(other.file)
        name, file = quoted(other.value.name), printable(used.file)
        more = len(pairs) - 1
        likewise = f" ({more} more of this folder likewise)" if more else ""
        message = f"{name} is also described in {file}, which is used: {why}{likewise}"
        hint = "remove one of the two files" + (", or one of the two folders" if more else "")
        notes.warning(other.places["name",], message, hint)
        yield from notes.defects


def _entry(table: Table, file: str, place: Naming, notes: Notes) -> Entry | None:
    kind = _kind(table, place, notes)
    model: CapabilityFile | None
    if kind == "interface":
        model = validate(InterfaceFile, table, notes)
    elif kind == "provider":
        model = validate(ProviderFile, table, notes)
    elif kind == "semantic_interface":
        model = validate(SemanticFile, table, notes)
    else:
        return None
    if model is None:
        return None
    name = _name(model, place, notes)
    if not name:
        return None
    version = _version(model, notes)
    if isinstance(model, ProviderFile):
        return provider(model, name, file=file, version=version, notes=notes)
    if isinstance(model, SemanticFile):
        return semantic(model, name, file=file, version=version)
    assert isinstance(model, InterfaceFile)
    return interface(model, name, file=file, version=version)


def _kind(table: Table, naming_: Naming, notes: Notes) -> str:
    kinds = list(KINDS.values())
    node = table.get("spec_type")
    if node is None or (isinstance(node, Scalar) and node.value is None):
        if not naming_.kind:
            message = "the file has no 'spec_type', so it is not known what it describes"
            notes.error((1, 1), message, f"add it; one of {', '.join(kinds)}")
        return naming_.kind
    place = table.places["spec_type"]
    if not isinstance(node, Scalar) or node.text not in kinds:
        hint = notes.near(node.text, kinds) if isinstance(node, Scalar) else ""
        message = f"{kind_of(node)} is not a spec_type"
        notes.error(place, message, hint or f"the types are {', '.join(kinds)}")
        return ""
    if naming_.kind and node.text != naming_.kind:
        says = "its package.xml" if naming_.exported else "the place of the file"
        message = f"spec_type is {node.text}, but {says} says {naming_.kind}"
        notes.warning(place, message, "move the file, or change spec_type")
    return node.text


def _name(model: CapabilityFile, place: Naming, notes: Notes) -> str:
    """``package/Name``: as the file writes it, else with the package that the path tells."""
    written = model.name.strip()
    package, _, bare = written.rpartition("/")
    bad = any(each.isspace() or not each.isprintable() for each in written)
    if bad or not bare or "/" in package or written.startswith("/"):
        message = f"{quoted(model.name)} cannot be the name of a capability"
        notes.error(model.at("name"), message, "write Name or package/Name, without blanks")
        return ""
    if place.name != bare:
        message = f"the name is {quoted(bare)}, but the file is called {quoted(place.name)}"
        notes.warning(model.at("name"), message, f"the name {quoted(bare)} is used; rename one")
    if package and place.package and package != place.package:
        message = f"the package is {quoted(package)}, but the file is in {quoted(place.package)}"
        notes.warning(model.at("name"), message, f"{quoted(package)} is used; change one")
    implements = model.implements if isinstance(model, ProviderFile) else ""
    package = package or place.package or namespace(implements)
    if not package:
        message = f"it is not known which package {quoted(bare)} belongs to"
        hint = "write 'name: package/Name', or put the file into package/interfaces or the like"
        notes.error(model.at("name"), message, hint)
        return ""
    name = f"{package}/{bare}"
    if len(name) > MAX_NAME:
        message = f"the name has {len(name)} characters; at most {MAX_NAME} are allowed"
        notes.error(model.at("name"), message, "write a shorter one")
        return ""
    return name


def _version(model: CapabilityFile, notes: Notes) -> tuple[int, ...]:
    text = model.spec_version
    if not text:
        return ()
    place = model.at("spec_version")
    if not _VERSION.fullmatch(text):
        notes.warning(
            place, f"{quoted(text)} is not a spec_version", "the versions are 1, 1.1 and 1.2"
        )
        return ()
    version = tuple(map(int, text.split(".")))
    if version > _NEWEST:
        message = f"spec_version {text} is newer than 1.2, the newest that is known here"
        notes.warning(place, message, "what is new in it is not understood")
    return version


def _library(values: Iterable[Interface | Provider | SemanticInterface]) -> Library:
    entries = sorted(values, key=lambda value: value.name)
    return Library(
        interfaces=tuple(value for value in entries if isinstance(value, Interface)),
        providers=tuple(value for value in entries if isinstance(value, Provider)),
        semantic=tuple(value for value in entries if isinstance(value, SemanticInterface)),
    )


def cross_defects(entries: Iterable[Entry], library: Library) -> Iterator[Defect]:
    """Warnings about names that mean nothing in ``library``, which holds the entries as well."""
    for entry in entries:
        notes = Notes(entry.file)
        value = entry.value
        if isinstance(value, Provider):
            _check_provider(value, entry, library, notes=notes)
        elif isinstance(value, Interface):
            _check_interface(value, entry, library, notes=notes)
        elif not any(value.redefines == interface.name for interface in library.interfaces):
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
    described = library.provider(wanted)
    if described is None:
        message = f"the default provider {quoted(wanted)} is described by no file"
        notes.warning(place, message, _provider_hint(wanted, library, notes))
    elif described.implements != value.name:
        message = f"the default provider {quoted(wanted)} implements {quoted(described.implements)}"
        notes.warning(place, message, f"name a provider that implements {quoted(value.name)}")


def _interface_hint(name: str, library: Library, notes: Notes) -> str:
    translated = library.translation(name)
    if translated is not None:
        return f"it is called {quoted(translated)} here"
    return _hint(name, library.interface_names, notes)


def _provider_hint(name: str, library: Library, notes: Notes) -> str:
    return _hint(name, [each.name for each in library.providers], notes)


def _hint(name: str, names: Iterable[str], notes: Notes) -> str:
    """The same name in another package is nearer than what is spelt alike."""
    if notes.full:
        return ""
    listed = list(names)
    same = [each for each in listed if each.rpartition("/")[2] == name.rpartition("/")[2]]
    if same:
        return f"did you mean {quoted(same[0])}?"
    return notes.near(name, listed) or "describe it, or load its files as well"
