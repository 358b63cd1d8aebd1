"""ROS packages: what the ``package.xml`` of a package says of the capability files in it.

A robot sees the files that ``<export>`` names, and no others:

    <export>
      <capability_interface>interfaces/Grasp.yaml</capability_interface>
      <semantic_capability_interface>semantic_interfaces/Grasp.yaml</semantic_capability_interface>
      <capability_provider>providers/Grasp.yaml</capability_provider>
    </export>

Its server takes the first ``<export>``, removes all blanks from a path, and a slash before it. Such
a file may come from anywhere: a document type, and with it every entity, is refused.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING
from xml.parsers import expat

from gpsfsm.capabilities.defects import Notes, quoted
from gpsfsm.capabilities.files import MAX_BYTES, absolute, find_manifests, read_bytes
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.capabilities.defects import Place

_KINDS = {
    "capability_interface": "interface",
    "semantic_capability_interface": "semantic_interface",
    "capability_provider": "provider",
}
"""The tags of exports, and the ``spec_type`` of the files that they name."""


@dataclass(frozen=True, slots=True)
class Export:
    """A capability file that a package exports; ``kind`` is its ``spec_type``."""

    path: str
    kind: str
    place: Place


@dataclass(frozen=True, slots=True)
class Package:
    """A package; ``name`` is that of its package.xml. ``exports`` None: it could not be read."""

    folder: str
    name: str
    exports: tuple[Export, ...] | None

    def exported(self, notes: Notes) -> dict[str, Export]:
        """The exported files that there are, by their path; ``notes`` are those of package.xml."""
        files: dict[str, Export] = {}
        for export in self.exports or ():
            file = str(Path(self.folder, export.path))
            if ".." in Path(export.path).parts:
                message = f"{quoted(export.path)} is outside the package"
                notes.error(export.place, message, "name a file of this package, without '..'")
            elif not _is_file(file):
                message = f"it exports {quoted(export.path)}, but there is no such file"
                notes.error(export.place, message, self._hint(export, notes))
            elif file in files:
                message = f"it exports {quoted(export.path)} twice"
                notes.warning(export.place, message, "remove one of the two lines")
            else:
                files[file] = export
        return files

    def _hint(self, export: Export, notes: Notes) -> str:
        """The file of this folder that is meant, if any looks like it."""
        folder = Path(self.folder, export.path).parent
        try:
            names = [] if notes.full else sorted(each.name for each in folder.iterdir())
        except OSError:
            names = []
        near = notes.near(Path(export.path).name, names)
        return near or "add the file, or remove the line: the robot lacks this capability"


def _is_file(path: str) -> bool:
    try:
        return Path(path).is_file()
    except OSError:  # a name that is too long, for one
        return False


def packages_in(path: str, notes_of: dict[str, Notes]) -> dict[str, Package]:
    """The packages in a folder and below it, by their folders.

    ``notes_of`` has the notes of each package.xml; those that are missing are made.
    """
    packages = {}
    for manifest in find_manifests(path):
        notes = notes_of.setdefault(manifest, Notes(manifest, kind="package"))
        folder = str(Path(manifest).parent)
        packages[folder] = read_package(manifest, folder, notes)
    return packages


def owner(file: str, packages: dict[str, Package]) -> Package | None:
    """The package that a file belongs to: the innermost around it."""
    around = (packages.get(str(folder)) for folder in Path(file).parents)
    return next((package for package in around if package is not None), None)


def read_package(manifest: str, folder: str, notes: Notes) -> Package:
    """The package of a package.xml; what is wrong with that file is noted."""
    bare = absolute(folder).name
    content = read_bytes(manifest, notes)
    if content is not None and len(content) > MAX_BYTES:
        notes.error((1, 1), f"the file is larger than {MAX_BYTES} bytes", _UNUSED)
        content = None
    reader = _Reader(notes)
    if content is None or not reader.read(content):
        return Package(folder, bare, None)
    name = reader.name.strip()
    good = name and "/" not in name and name.isprintable() and not any(map(str.isspace, name))
    return Package(folder, name if good else bare, tuple(reader.exports))


_UNUSED = "fix it: until then the robot sees no capability file of this package"


@dataclass(slots=True)
class _Reader:
    """Collects name and exports from what expat tells, which is one event after the other."""

    notes: Notes
    name: str = ""
    exports: list[Export] = field(default_factory=list)
    _open: list[str] = field(default_factory=list)
    _exports: int = 0  # how many <export> there were
    _text: list[str] = field(default_factory=list)
    _place: Place | None = None
    _parser: expat.XMLParserType = field(default_factory=expat.ParserCreate)

    def read(self, content: bytes) -> bool:
        """False, with an error in the notes, if this is no package.xml."""
        parser = self._parser
        parser.StartDoctypeDeclHandler = self._refuse
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._characters
        try:
            parser.Parse(content, True)
        except expat.ExpatError as error:
            place = error.lineno, error.offset + 1
            words = clip(expat.errors.messages.get(error.code, "it breaks the rules"), 100)
            self.notes.error(place, f"this is not well-formed XML: {words}", _UNUSED)
            return False
        except (LookupError, ValueError) as error:  # an encoding that nobody knows, our own refusal
            message = clip(str(error), 100)
            self.notes.error(self._place or self._here, f"this cannot be read: {message}", _UNUSED)
            return False
        return True

    @property
    def _here(self) -> Place:
        return self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1

    def _refuse(self, *_: object) -> None:
        self._place = self._here
        raise ValueError("a document type is not allowed here")

    def _start(self, tag: str, _: object) -> None:
        if not self._open and tag != "package":
            self._place = self._here
            raise ValueError(f"its outermost element is <{tag}>, and not <package>")
        self._open.append(tag)
        self._text.clear()
        self._place = None
        if self._open == ["package", "export"]:
            self._exports += 1
        elif len(self._open) == 3 and self._open[1] == "export" and tag in _KINDS:
            self._place = self._here

    def _characters(self, text: str) -> None:
        if self._place is not None and text.strip() and not "".join(self._text).strip():
            line, column = self._here
            self._place = line, column + len(text) - len(text.lstrip())
        self._text.append(text)

    def _end(self, tag: str) -> None:
        text = "".join(self._text)
        if self._open == ["package", "name"]:
            self.name = self.name or text
        elif len(self._open) == 3 and self._open[1] == "export" and tag in _KINDS:
            self._export(tag, "".join(text.split()).removeprefix("/"))
        self._open.pop()
        self._text.clear()
        self._place = None

    def _export(self, tag: str, path: str) -> None:
        place = self._place or self._here
        if not path:
            message = f"<{tag}> names no file, which crashes the server of the robot"
            self.notes.error(place, message, "write the path of the file, or remove the line")
        elif self._exports > 1:
            message = f"{quoted(path)} is in a second <export>, which the robot does not read"
            self.notes.error(place, message, "put it into the first one")
        elif "\0" in path or path.startswith("/"):
            self.notes.error(place, f"{quoted(path)} is not a file of this package", "remove it")
        else:
            self.exports.append(Export(str(Path(path)), _KINDS[tag], place))


def unexported(package: Package, files: Iterable[str], notes: Notes) -> None:
    """Note in the first of some files that the robot does not see them."""
    more = len(list(files)) - 1
    likewise = f" ({more} more of this package likewise)" if more else ""
    manifest = Path(package.folder, "package.xml")
    notes.warning(
        (1, 1),
        f"{quoted(str(manifest))} does not export this file{likewise}, so the robot does not see "
        "it, and it is left out",
        "name it in <export>, as <capability_interface> or <capability_provider>",
    )
