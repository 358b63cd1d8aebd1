"""YAML text to plain data in which every value knows its place.

Events and not ``yaml.load``: nothing is constructed, nothing is recursive, and depth, size and
number of values are bounded. Of YAML only the plain part is allowed: one document, no anchors, no
tags but the standard ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import yaml

from gpsfsm.capabilities.defects import Notes, Place, quoted
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from gpsfsm.model.plan import Value

__all__ = ["MAX_BYTES", "MAX_DEPTH", "Items", "Node", "Scalar", "Table", "read_table"]

MAX_BYTES = 1 << 20
MAX_DEPTH = 50
_MAX_NODES = 20_000
_MAX_NUMBER = 100  # characters; longer ones are text, so that no number is costly
_CORE = "tag:yaml.org,2002:"
_TAGS = frozenset(_CORE + name for name in ("str", "int", "float", "bool", "null", "map", "seq"))
_CLOSE_QUOTE = "a quotation mark above it may not be closed"
_QUOTE = "put quotation marks around the whole text"
_HINTS = {  # by what the parser says
    "expected <block end>": _CLOSE_QUOTE,
    "unexpected end of stream": _CLOSE_QUOTE,
    "character '\\t'": "indent with blanks, not with tabs",
    "that cannot start any token": _QUOTE,
    "mapping values are not allowed": f"{_QUOTE} if it holds a colon and a blank",
    "expected the node content": "a bracket or a value may be missing",
    "could not find expected ':'": "write 'key: value'",
    "incompatible YAML document": "write '%YAML 1.1', or leave the line out",
}


@dataclass(frozen=True, slots=True)
class Scalar:
    """A single value: as YAML types it (None: null) and as it is written."""

    value: Value | None
    text: str
    place: Place


class Table(dict[str, "Node"]):
    """A mapping. ``places`` has the place of each key; ``place`` is its own or that of its key."""

    def __init__(self, place: Place) -> None:
        super().__init__()
        self.place = place
        self.places: dict[str, Place] = {}


class Items(list["Node"]):
    """A list and its place."""

    def __init__(self, place: Place) -> None:
        super().__init__()
        self.place = place


Node = Scalar | Table | Items


def read_table(content: bytes, notes: Notes) -> Table | None:
    """The mapping that a file holds; None, with errors in ``notes``, if it holds anything else."""
    text = _decode(content, notes)
    if text is None:
        return None
    before = len(notes.defects)
    root: Node | None = None
    try:
        root = _Builder(notes).build(yaml.parse(text, Loader=yaml.SafeLoader))
    except yaml.MarkedYAMLError as error:
        _note_syntax(error, notes)
    except yaml.reader.ReaderError as error:
        character = text[error.position : error.position + 1]
        notes.error(
            _place_at(text, error.position),
            f"the character U+{ord(character or chr(0)):04X} is not allowed in YAML",
            "remove it",
        )
    if len(notes.defects) > before:
        return None
    if isinstance(root, Table):
        return root
    if root is None or (isinstance(root, Scalar) and root.value is None):
        notes.error((1, 1), "the file is empty", f"describe a {notes.kind} in it, or remove it")
    else:
        # A path may have led to anything, so nobody is shown what is in such a file.
        held = "text" if isinstance(root, Scalar) else kind_of(root)
        notes.error(root.place, f"the file holds {held}, not lines of the form 'key: …'")
    return None


def kind_of(node: object) -> str:
    """What a value is, in words."""
    if isinstance(node, Items | list):
        return "a list"
    if isinstance(node, Table | dict):
        return "a mapping"
    if isinstance(node, Scalar):
        return "nothing" if node.value is None else quoted(node.text)
    return "a value"


def _smaller(notes: Notes) -> str:
    return "split it up" if notes.kind == "capability" else f"describe a smaller {notes.kind}"


def _decode(content: bytes, notes: Notes) -> str | None:
    if len(content) > MAX_BYTES:
        notes.error((1, 1), f"the file is larger than {MAX_BYTES} bytes", _smaller(notes))
        return None
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        notes.error((line, 1), f"this is not UTF-8 text (byte {error.start + 1} of the file)")
        return None


def _place_at(text: str, position: int) -> Place:
    start = text.rfind("\n", 0, position) + 1
    return text.count("\n", 0, position) + 1, position - start + 1


def _place(mark: Any) -> Place:  # of either of PyYAML's parsers, or of none
    return (mark.line + 1, mark.column + 1) if mark else (1, 1)


def _note_syntax(error: yaml.MarkedYAMLError, notes: Notes) -> None:
    mark = error.problem_mark or error.context_mark
    said = clip(error.problem or error.context or "", 100)
    if error.problem and error.context and error.context_mark:
        said += f" ({clip(error.context, 100)} that begins at line {error.context_mark.line + 1})"
    hint = next((hint for words, hint in _HINTS.items() if words in said), "")
    notes.error(_place(mark), f"this is not YAML: {said}", hint)


class _Builder:
    """Builds the value from events; a loop with a stack of its own."""

    def __init__(self, notes: Notes) -> None:
        self._notes = notes
        self._stack: list[Table | Items] = []
        self._keys: list[str | None] = []  # of each open Table: the key that awaits its value
        self._root: Node | None = None
        self._resolve: Callable[..., str] = yaml.resolver.Resolver().resolve
        self._nodes = 0

    def build(self, events: Iterator[yaml.Event]) -> Node | None:
        """The value of the only document, or what there is of it when something is refused."""
        documents = 0
        for event in events:
            place = _place(event.start_mark)
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    hint = f"put each {self._notes.kind} into a file of its own"
                    self._notes.error(place, "the file holds several documents", hint)
                    break
            elif isinstance(event, yaml.CollectionEndEvent):
                self._stack.pop()
                self._keys.pop()
            elif isinstance(event, yaml.NodeEvent) and not self._node(event, place):
                break
        return self._root

    def _node(self, event: yaml.NodeEvent, place: Place) -> bool:
        """Take a value or a key in; False if it makes no sense to go on."""
        self._nodes += 1
        if self._nodes > _MAX_NODES:
            message = f"the file holds more than {_MAX_NODES} values"
            self._notes.error(place, message, _smaller(self._notes))
            return False
        if len(self._stack) >= MAX_DEPTH and isinstance(event, yaml.CollectionStartEvent):
            self._notes.error(place, f"this is nested more than {MAX_DEPTH} levels deep")
            return False
        self._refuse(event, place)
        awaits_key = bool(self._stack) and isinstance(self._stack[-1], Table)
        if awaits_key and self._keys[-1] is None:
            return self._key(event, place)
        node = self._value(event, self._place_of_key() or place)
        self._put(node)
        if isinstance(node, Table | Items):
            self._stack.append(node)
            self._keys.append(None)
        return not self._notes.full

    def _refuse(self, event: yaml.NodeEvent, place: Place) -> None:
        if isinstance(event, yaml.AliasEvent):
            message = f"the alias {quoted(f'*{event.anchor}')} is not allowed"
            self._notes.error(place, message, "write the value out")
        elif event.anchor is not None:
            message = f"the anchor {quoted(f'&{event.anchor}')} is not allowed"
            self._notes.error(place, message, "remove it, and write the value out where it is used")
        tag = getattr(event, "tag", None)
        if tag is not None and tag != "!" and tag not in _TAGS:
            shown = "!!" + tag.removeprefix(_CORE) if tag.startswith(_CORE) else tag
            self._notes.error(place, f"the tag {quoted(shown)} is not allowed", "remove it")

    def _key(self, event: yaml.NodeEvent, place: Place) -> bool:
        if not isinstance(event, yaml.ScalarEvent):
            self._notes.error(place, "a key must be a text, not a list, mapping or alias")
            return False
        table = cast("Table", self._stack[-1])
        if event.value in table.places:
            first = table.places[event.value][0]
            message = f"the key {quoted(event.value)} is here twice, first in line {first}"
            self._notes.error(place, message, "remove one of them")
        else:
            table.places[event.value] = place
        self._keys[-1] = event.value
        return True

    def _place_of_key(self) -> Place | None:
        key = self._keys[-1] if self._keys else None
        top = self._stack[-1] if self._stack else None
        return top.places[key] if isinstance(top, Table) and key is not None else None

    def _put(self, node: Node) -> None:
        if not self._stack:
            self._root = node
            return
        top = self._stack[-1]
        if isinstance(top, Items):
            top.append(node)
            return
        key = self._keys[-1]
        assert key is not None
        top.setdefault(key, node)
        self._keys[-1] = None

    def _value(self, event: yaml.NodeEvent, place: Place) -> Node:
        if isinstance(event, yaml.MappingStartEvent):
            return Table(place)
        if isinstance(event, yaml.SequenceStartEvent):
            return Items(place)
        if isinstance(event, yaml.ScalarEvent):
            tag = event.tag
            if tag is None or tag == "!":
                tag = self._resolve(yaml.ScalarNode, event.value, event.implicit)
            return Scalar(_typed(tag.removeprefix(_CORE), event.value), event.value, place)
        return Scalar(None, "", place)  # an alias, which was refused


def _typed(tag: str, text: str) -> Value | None:
    if tag == "null":
        return None
    if tag == "bool":
        return yaml.SafeLoader.bool_values.get(text.lower(), text)
    if tag in ("int", "float") and len(text) <= _MAX_NUMBER and ":" not in text:
        make = yaml.constructor.SafeConstructor()
        node = yaml.ScalarNode(_CORE + tag, text)
        try:
            read = make.construct_yaml_int if tag == "int" else make.construct_yaml_float
            return cast("Value", read(node))
        except (ValueError, IndexError):  # such as 0x_, which the pattern of YAML 1.1 allows
            return text
    return text
