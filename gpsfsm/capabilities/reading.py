"""Files that people write, in YAML: plain data in which every value knows its place, and its shape.

Events and not ``yaml.load``: nothing is constructed, nothing is recursive, and depth, size and
number of values are bounded. Of YAML only the plain part is allowed: one document, no anchors, no
tags but the standard ones.

Capability files, world files and task files consist of the same texts, numbers, lists and mappings,
as pydantic fields and a ``FileModel``. What a shape must be and is not is said in the same words
for all of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeVar, cast, get_args

import yaml
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    ModelWrapValidatorHandler,
    PrivateAttr,
    ValidationError,
    model_validator,
)
from pydantic_core import PydanticCustomError

from gpsfsm.capabilities.defects import Notes, Place, quoted
from gpsfsm.capabilities.files import MAX_BYTES
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from gpsfsm.capabilities.defects import Place
    from gpsfsm.model.plan import Value

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
    """The kind of a value, in words."""
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


def _place_of_mark(mark: Any) -> Place:  # of either of PyYAML's parsers, or of none
    return (mark.line + 1, mark.column + 1) if mark else (1, 1)


def _note_syntax(error: yaml.MarkedYAMLError, notes: Notes) -> None:
    mark = error.problem_mark or error.context_mark
    said = clip(error.problem or error.context or "", 100)
    if error.problem and error.context and error.context_mark:
        said += f" ({clip(error.context, 100)} that begins at line {error.context_mark.line + 1})"
    hint = next((hint for words, hint in _HINTS.items() if words in said), "")
    notes.error(_place_of_mark(mark), f"this is not YAML: {said}", hint)


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
            place = _place_of_mark(event.start_mark)
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


T = TypeVar("T")

_ROUNDS = 5


def wrong(expected: str, node: object) -> PydanticCustomError:
    """The error of a node that is not what is expected there."""
    text = "must be {expected}, not {found}"
    return PydanticCustomError("shape", text, {"expected": expected, "found": kind_of(node)})


def number(node: object) -> float:
    """The finite number that a node is. Raises PydanticCustomError if it is none."""
    value = node.value if isinstance(node, Scalar) else None
    if isinstance(value, str):  # such as 1e3, which is text in YAML 1.1
        try:
            value = float(value)
        except ValueError:
            value = None
    if isinstance(value, bool) or not isinstance(value, int | float) or not _finite(value):
        raise wrong("a finite number", node)
    return float(value)


def _finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer too large for a float
        return False


def _text(node: object) -> str:
    if isinstance(node, Scalar) and node.value is not None:
        return node.text
    raise wrong("a text", node)


def _flag(node: object) -> bool:
    if isinstance(node, Scalar):
        if isinstance(node.value, bool):
            return node.value
        if node.text in ("true", "false"):  # in quotation marks
            return node.text == "true"
    raise wrong("true or false", node)


def _some(node: object) -> object:
    """One text or a list of texts."""
    if isinstance(node, Scalar) and node.value is not None:
        return [node.text]
    if isinstance(node, Items):
        texts = [item.text for item in node if isinstance(item, Scalar) and item.value is not None]
        if len(texts) == len(node):
            return texts
    raise wrong("a text or a list of texts", node)


def _list(node: object) -> object:
    if isinstance(node, Items):
        return node
    raise wrong("a list", node)


def _mapping(node: object) -> object:
    if isinstance(node, Table):
        return node
    raise wrong("a mapping ('key: value' lines)", node)


Text = Annotated[str, BeforeValidator(_text)]
Flag = Annotated[bool, BeforeValidator(_flag)]
Number = Annotated[float, BeforeValidator(number)]
Some = Annotated[list[str], BeforeValidator(_some)]
ListOf = Annotated[list[T], BeforeValidator(_list)]
MappingOf = Annotated[dict[str, T], BeforeValidator(_mapping)]
Texts = ListOf[Text]


class FileModel(BaseModel):
    """A mapping of a file. A key with nothing behind it counts as not there.

    ``default: `` with nothing (null) is the exception: it says that there is no default value, and
    is kept.
    """

    model_config = ConfigDict(extra="allow", arbitrary_types_allowed=True)
    _table: Table = PrivateAttr(default_factory=lambda: Table((1, 1)))

    @model_validator(mode="wrap")
    @classmethod
    def _keep_places(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        table = _mapping(data)
        assert isinstance(table, Table)
        written = {key: node for key, node in table.items() if key == "default" or not _null(node)}
        model = handler(written)
        model._table = table
        return model

    @property
    def place(self) -> Place:
        """The place where the mapping begins, or the key that it belongs to."""
        return self._table.place

    def at(self, key: str) -> Place:
        """The place of a key; that of the mapping if it is not there."""
        return self._table.places.get(key, self._table.place)

    def below(self, key: str, inner: str) -> Place:
        """The place of the key ``inner`` of the mapping behind ``key``."""
        node = self._table.get(key)
        return node.places.get(inner, node.place) if isinstance(node, Table) else self.at(key)


def _null(node: object) -> bool:
    return isinstance(node, Scalar) and node.value is None


_Model = TypeVar("_Model", bound=FileModel)


def validate(model: type[_Model], table: Table, notes: Notes) -> _Model | None:
    """The table as a model. What does not fit is noted as an error, and left out if it can be.

    Only of a capability is a part of any use.
    """
    if notes.kind == "robot":  # a bound or a permission less
        _note_empty(table, notes)
    for _ in range(_ROUNDS if notes.kind == "capability" else 1):
        try:
            fitted = model.model_validate(table)
        except ValidationError as error:
            if not _prune(table, error, notes):
                return None
        else:
            _note_unknown_keys(fitted, _homes(model), notes)
            return fitted
    return None


def _note_empty(table: Table, notes: Notes) -> None:
    for key, node in table.items():
        if _null(node):
            message = f"nothing is behind {quoted(key)}"
            notes.error(table.places[key], message, "fill it in, or remove it")
        elif isinstance(node, Table):
            _note_empty(node, notes)


def _prune(root: Table, error: ValidationError, notes: Notes) -> bool:
    """Note the errors and take the wrong values out; False if the root itself is wrong."""
    wrong: dict[tuple[int | str, ...], None] = {}
    for mistake in error.errors(include_url=False, include_input=False):
        path = _existing(root, mistake["loc"])
        if mistake["type"] == "missing" and len(path) == len(mistake["loc"]):
            notes.error(_place(root, path), f"{_title(path)} is empty", "write a value behind it")
        elif mistake["type"] == "missing":
            notes.error(
                _place(root, path), f"{_title(path)} has no '{mistake['loc'][-1]}'", "add it"
            )
        else:
            notes.error(_place(root, path), f"{_title(path)} {mistake['msg']}")
        # Half of the outcomes could claim more than all of them.
        wrong[path[:1] if path[:1] == ("outcomes",) else path] = None
    if () in wrong:
        return False
    # The last item of a list first, so that the others keep their places.
    for path in sorted(wrong, key=lambda path: [str(part).zfill(9) for part in path], reverse=True):
        parent = _follow(root, path[:-1])
        step = path[-1]
        if isinstance(parent, Table) and isinstance(step, str):
            parent.pop(step, None)
        elif isinstance(parent, Items) and isinstance(step, int):
            del parent[step]
    return True


def _existing(root: Table, path: tuple[int | str, ...]) -> tuple[int | str, ...]:
    """As much of the path as there is."""
    while path and _follow(root, path) is None:
        path = path[:-1]
    return path


def _follow(root: Table, path: tuple[int | str, ...]) -> object:
    node: object = root
    for step in path:
        if isinstance(node, Table) and isinstance(step, str):
            node = node.get(step)
        elif isinstance(node, Items) and isinstance(step, int) and step < len(node):
            node = node[step]
        else:
            return None
    return node


def _place(root: Table, path: tuple[int | str, ...]) -> Place:
    node = _follow(root, path)
    return node.place if path and isinstance(node, Scalar | Table | Items) else (1, 1)


def _title(path: tuple[int | str, ...]) -> str:
    """``'definition.configuration_parameters[2].type'``; the root is the file."""
    if not path:
        return "the file"
    shown = "".join(f"[{step + 1}]" if isinstance(step, int) else f".{step}" for step in path)
    return quoted(shown[1:])


_MISSPELT = 0.8
"""``resource`` and ``resources`` are as near as 0.94, ``idempotent`` and ``implements`` 0.6."""


def _note_unknown_keys(model: FileModel, homes: Mapping[str, str], notes: Notes) -> None:
    """The original stack ignores unknown keys silently.

    One that looks like another key is misspelt, and one that belongs elsewhere is misplaced: what
    it declares would be missing unnoticed. Any other, such as ``idempotent``, may belong to another
    program.
    """
    keys = [field.alias or name for name, field in type(model).model_fields.items()]
    otherwise = "it is ignored" if notes.kind == "capability" else f"the keys are {', '.join(keys)}"
    for key in model.model_extra or {}:
        misspelt = notes.near(key, keys, cutoff=_MISSPELT)
        elsewhere = f"it belongs to {homes[key]}" if key in homes and not misspelt else ""
        note = notes.error if misspelt or elsewhere else notes.warning
        hint = misspelt or elsewhere or notes.near(key, keys) or otherwise
        note(model.at(key), f"the key {quoted(key)} is not known here", hint)
    for inner in _inner(model):
        _note_unknown_keys(inner, homes, notes)


@cache
def _homes(root: type[FileModel]) -> Mapping[str, str]:
    """The parts of such a file, and of its siblings, by the keys that belong to them."""
    family: type[FileModel] = root.__mro__[root.__mro__.index(FileModel) - 1]
    pending = [family, *family.__subclasses__()]
    homes: dict[str, str] = {}
    while pending:
        model = pending.pop(0)
        head, quotes, _ = (model.__doc__ or "").partition("\n")[0].partition("``: ")
        part = f"{head}{quotes}".rstrip(".: ").replace("``", "'")
        for name, field in model.model_fields.items():
            homes.setdefault(field.alias or name, f"{part[:1].lower()}{part[1:]}")
            pending += _models_in(field.annotation)
    return homes


def _models_in(annotation: object) -> Iterator[type[FileModel]]:
    if isinstance(annotation, type) and issubclass(annotation, FileModel):
        yield annotation
    for each in get_args(annotation):
        yield from _models_in(each)


def _inner(model: FileModel) -> Iterator[FileModel]:
    for name in type(model).model_fields:
        value = getattr(model, name)
        if isinstance(value, FileModel):
            yield value
        elif isinstance(value, list | dict):
            each = value.values() if isinstance(value, dict) else value
            yield from (item for item in each if isinstance(item, FileModel))
