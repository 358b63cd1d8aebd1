"""What the files that people write consist of, for pydantic: texts, numbers, lists, mappings.

Capability files, world files and task files are made of these. What a shape must be and is not is
said in the same words for all of them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    ModelWrapValidatorHandler,
    PrivateAttr,
    model_validator,
)
from pydantic_core import PydanticCustomError

from gpsfsm.capabilities.reading import Items, Scalar, Table, kind_of

if TYPE_CHECKING:
    from gpsfsm.capabilities.defects import Place

__all__ = [
    "FileModel",
    "Flag",
    "ListOf",
    "MappingOf",
    "Number",
    "Some",
    "Text",
    "Texts",
    "number",
    "wrong",
]

T = TypeVar("T")


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
        given = {key: node for key, node in table.items() if key == "default" or not _null(node)}
        found = handler(given)
        found._table = table
        return found

    @property
    def place(self) -> Place:
        """Where the mapping begins, or the key that it belongs to."""
        return self._table.place

    def at(self, key: str) -> Place:
        """Where a key is; where the mapping begins if it is not there."""
        return self._table.places.get(key, self._table.place)

    def below(self, key: str, inner: str) -> Place:
        """Where the key ``inner`` of the mapping behind ``key`` is."""
        node = self._table.get(key)
        return node.places.get(inner, node.place) if isinstance(node, Table) else self.at(key)


def _null(node: object) -> bool:
    return isinstance(node, Scalar) and node.value is None
