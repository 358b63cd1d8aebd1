"""What capability files look like: the border, in pydantic.

The models check shapes only. Values stay as they are written (``Scalar``) where their type depends
on another key; what they mean is checked in ``entries``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    PrivateAttr,
    model_validator,
)
from pydantic_core import PydanticCustomError

from gpsfsm.capabilities.reading import Items, Scalar, Table, kind_of

if TYPE_CHECKING:
    from gpsfsm.capabilities.defects import Place

__all__ = [
    "BufferFile",
    "DefinitionFile",
    "FileModel",
    "InputFile",
    "InterfaceFile",
    "OutcomesFile",
    "OutputFile",
    "ParameterFile",
    "ProviderFile",
    "SemanticFile",
    "SpanFile",
]


def _wrong(expected: str, node: object) -> PydanticCustomError:
    text = "must be {expected}, not {found}"
    return PydanticCustomError("shape", text, {"expected": expected, "found": kind_of(node)})


def _text(node: object) -> str:
    if isinstance(node, Scalar) and node.value is not None:
        return node.text
    raise _wrong("a text", node)


def _flag(node: object) -> bool:
    if isinstance(node, Scalar):
        if isinstance(node.value, bool):
            return node.value
        if node.text in ("true", "false"):  # in quotation marks
            return node.text == "true"
    raise _wrong("true or false", node)


def _number(node: object) -> float:
    value = node.value if isinstance(node, Scalar) else None
    if isinstance(value, str):  # such as 1e3, which is text in YAML 1.1
        try:
            value = float(value)
        except ValueError:
            value = None
    if isinstance(value, bool) or not isinstance(value, int | float) or not _finite(value):
        raise _wrong("a finite number", node)
    return float(value)


def _finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer too large for a float
        return False


def _bound(node: object) -> float | str:
    try:
        return _number(node)
    except PydanticCustomError:
        if isinstance(node, Scalar) and isinstance(node.value, str):
            return node.text
        raise _wrong("a number or the name of a parameter", node) from None


def _list(node: object) -> object:
    if isinstance(node, Items):
        return node
    raise _wrong("a list", node)


def _mapping(node: object) -> object:
    if isinstance(node, Table):
        return node
    raise _wrong("a mapping ('key: value' lines)", node)


Text = Annotated[str, BeforeValidator(_text)]
Flag = Annotated[bool, BeforeValidator(_flag)]
Number = Annotated[float, BeforeValidator(_number)]
Bound = Annotated[float | str, BeforeValidator(_bound)]
Texts = Annotated[list[Text], BeforeValidator(_list)]
Written = Annotated[dict[str, Any], BeforeValidator(_mapping)]
Renamed = Annotated[dict[str, Text], BeforeValidator(_mapping)]


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


class ParameterFile(FileModel):
    """An entry of ``configuration_parameters``."""

    name: Text
    type: Text = ""
    optional: Flag | None = None
    required: Flag | None = None
    default: Any = None
    semantic_key: Text = ""
    aliases: Texts = Field(default_factory=list)
    minimum: Number | None = None
    maximum: Number | None = None
    choices: Texts = Field(default_factory=list)
    description: Text = ""


class InputFile(FileModel):
    """An entry of ``runtime_parameters: input``."""

    name: Text
    type: Text = ""
    optional: Flag | None = None
    required: Flag | None = None
    default: Any = None
    semantic_key: Text = ""
    aliases: Texts = Field(default_factory=list)
    satisfiable_from: Texts = Field(default_factory=list)
    fallback_parameter: Text = ""
    description: Text = ""


class OutputFile(FileModel):
    """An entry of ``runtime_parameters: output``."""

    name: Text
    type: Text = ""
    on: Text = "success"
    optional: Flag = False
    status: Flag = False
    semantic_key: Text = ""
    aliases: Texts = Field(default_factory=list)
    description: Text = ""


class RuntimeFile(FileModel):
    """``runtime_parameters``."""

    input: Annotated[list[InputFile], BeforeValidator(_list)] = Field(default_factory=list)
    output: Annotated[list[OutputFile], BeforeValidator(_list)] = Field(default_factory=list)


class DefinitionFile(FileModel):
    """``definition``."""

    command: Text = ""
    configuration_parameters: Annotated[list[ParameterFile], BeforeValidator(_list)] = Field(
        default_factory=list
    )
    runtime_parameters: RuntimeFile | None = None


class SpanFile(FileModel):
    """``duration`` or ``energy``."""

    min: Bound = 0.0
    max: Bound | None = None


class OutcomesFile(FileModel):
    """``outcomes``."""

    never_fails: Flag = False
    never_succeeds: Flag = False
    may_hang: Flag = False
    unless: Written = Field(default_factory=dict)


class BufferFile(FileModel):
    """``effects: prompt_buffer``."""

    uuid: Text
    flush: Text
    answer: Text = ""


class EffectsFile(FileModel):
    """``effects``."""

    prompt_buffer: BufferFile | None = None
    sets_plan: Text = ""


class RemappingsFile(FileModel):
    """``remappings``: new names of ROS parameters, topics, services and actions."""

    parameters: Renamed = Field(default_factory=dict)
    topics: Renamed = Field(default_factory=dict)
    services: Renamed = Field(default_factory=dict)
    actions: Renamed = Field(default_factory=dict)


class RosFile(FileModel):
    """``interface``: the ROS names that an interface consists of; nothing is done with them."""

    parameters: Written | None = None
    topics: Written | None = None
    services: Written | None = None
    actions: Written | None = None


class DependencyFile(FileModel):
    """An entry of ``depends_on``."""

    provider: Text = ""


class CapabilityFile(FileModel):
    """What all three kinds of files have."""

    name: Text
    spec_type: Text = ""
    spec_version: Text = ""
    description: Text = ""
    relations: Any = None


class InterfaceFile(CapabilityFile):
    """An interface."""

    interface: RosFile | None = None
    default_provider: Text = ""
    deprecated: Text = ""
    formerly: Texts = Field(default_factory=list)


class SemanticFile(CapabilityFile):
    """A semantic interface."""

    redefines: Text
    global_namespace: Text = ""
    remappings: RemappingsFile | None = None


class ProviderFile(CapabilityFile):
    """A provider."""

    implements: Text
    runner: Text = ""
    depends_on: Annotated[dict[str, DependencyFile], BeforeValidator(_mapping)] = Field(
        default_factory=dict
    )
    remappings: RemappingsFile | None = None
    definition: DefinitionFile | None = None
    deprecated: Text = ""
    outcomes: OutcomesFile | None = None
    duration: SpanFile | None = None
    energy: SpanFile | None = None
    resources: Texts = Field(default_factory=list)
    effects: EffectsFile | None = None
