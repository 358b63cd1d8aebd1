"""What capability files look like: the border, in pydantic.

The models check shapes only. Values stay as they are written (``Scalar``) where their type depends
on another key; what they mean is checked in ``entries``.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from gpsfsm.capabilities.reading import Scalar
from gpsfsm.capabilities.shapes import (
    FileModel,
    Flag,
    ListOf,
    MappingOf,
    Number,
    Text,
    Texts,
    number,
    wrong,
)

__all__ = [
    "BufferFile",
    "DefinitionFile",
    "InputFile",
    "InterfaceFile",
    "OutcomesFile",
    "OutputFile",
    "ParameterFile",
    "ProviderFile",
    "SemanticFile",
    "SpanFile",
]


def _bound(node: object) -> float | str:
    try:
        return number(node)
    except PydanticCustomError:
        if isinstance(node, Scalar) and isinstance(node.value, str):
            return node.text
        raise wrong("a number or the name of a parameter", node) from None


Bound = Annotated[float | str, BeforeValidator(_bound)]
Written = MappingOf[Any]
Renamed = MappingOf[Text]


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

    input: ListOf[InputFile] = Field(default_factory=list)
    output: ListOf[OutputFile] = Field(default_factory=list)


class DefinitionFile(FileModel):
    """``definition``."""

    command: Text = ""
    configuration_parameters: ListOf[ParameterFile] = Field(default_factory=list)
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
    depends_on: MappingOf[DependencyFile] = Field(default_factory=dict)
    remappings: RemappingsFile | None = None
    definition: DefinitionFile | None = None
    deprecated: Text = ""
    outcomes: OutcomesFile | None = None
    duration: SpanFile | None = None
    energy: SpanFile | None = None
    resources: Texts = Field(default_factory=list)
    effects: EffectsFile | None = None
