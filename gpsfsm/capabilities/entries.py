"""The content of one capability file: its shape, in pydantic, and what it describes.

The models check shapes only. Values stay as they are written (``Scalar``) where their type depends
on another key. From a model an interface, a provider or a semantic interface is made, which checks
what the values mean; ``parameters`` does the same for parameters.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from gpsfsm.capabilities.defects import Notes, Place, quoted
from gpsfsm.capabilities.parameters import NUMBERS, described, inputs, outputs, parameters, typed
from gpsfsm.capabilities.reading import (
    FileModel,
    Flag,
    ListOf,
    MappingOf,
    Number,
    Scalar,
    Text,
    Texts,
    number,
    wrong,
)
from gpsfsm.capabilities.ros_entries import CallFile, ros_call
from gpsfsm.model.capability import (
    MAX_AMOUNT,
    Effects,
    Interface,
    Outcomes,
    Permission,
    PromptBuffer,
    Provider,
    SemanticInterface,
    Span,
)
from gpsfsm.model.plan import NOT_PARAMETERS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.model.capability import Parameter
    from gpsfsm.model.plan import Value


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
    answers: Text = ""
    question: Text = ""
    checks: Text = ""


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
    """The keys that all three kinds of files have."""

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
    reaches: MappingOf[Text] = Field(default_factory=dict)
    achieves: Flag = False
    ros: CallFile | None = None


_ATTRIBUTES = re.compile(r"([^\W\d][\w.\-]*)\s*=(?!=)")
_PARAMETER = "configuration parameter"


@dataclass(frozen=True, slots=True)
class Entry:
    """The content of one file, with the places that checks across files need.

    ``places`` has the places of the keys that name something else: key, or key and name.
    """

    value: Interface | Provider | SemanticInterface
    file: str
    version: tuple[int, ...]
    places: dict[tuple[str, ...], Place] = field(default_factory=dict)


def interface(model: InterfaceFile, name: str, *, file: str, version: tuple[int, ...]) -> Entry:
    """An interface."""
    value = Interface(
        name=name,
        description=described(model),
        version=model.spec_version,
        default_provider=model.default_provider,
        deprecated=model.deprecated,
        formerly=tuple(dict.fromkeys(former for former in model.formerly if former != name)),
        origin=file,
    )
    return Entry(value, file, version, _places(model, "name", "default_provider"))


def semantic(model: SemanticFile, name: str, *, file: str, version: tuple[int, ...]) -> Entry:
    """A semantic interface."""
    value = SemanticInterface(
        name=name,
        redefines=model.redefines,
        namespace=model.global_namespace,
        remappings=_remappings(model.remappings),
        description=described(model),
        origin=file,
    )
    return Entry(value, file, version, _places(model, "name", "redefines"))


def provider(
    model: ProviderFile, name: str, *, file: str, version: tuple[int, ...], notes: Notes
) -> Entry:
    """A provider; what contradicts itself is noted and left out."""
    definition = model.definition
    configuration: tuple[Parameter, ...] = ()
    if definition is not None:
        configuration = parameters(definition.configuration_parameters, notes)
    runtime = definition.runtime_parameters if definition is not None else None
    value = Provider(
        name=name,
        implements=model.implements,
        runner=model.runner,
        description=described(model),
        version=model.spec_version,
        command=definition.command if definition is not None else "",
        described=definition is not None,
        configuration=configuration,
        inputs=inputs(runtime.input, configuration, notes=notes) if runtime else (),
        outputs=outputs(runtime.output, notes) if runtime else (),
        depends_on=tuple(
            (key, dependency.provider) for key, dependency in model.depends_on.items()
        ),
        remappings=_remappings(model.remappings),
        outcomes=_outcomes(model.outcomes, configuration, notes),
        duration=_span(model.duration, configuration, notes),
        energy=_span(model.energy, configuration, notes),
        resources=tuple(dict.fromkeys(model.resources)),
        achieves=model.achieves,
        deprecated=model.deprecated,
        origin=file,
    )
    value = _with_effects(value, model.effects, notes)
    value = replace(
        value,
        reaches=_reached(model, configuration, notes),
        ros=ros_call(model.ros, value, notes),
    )
    _check_command(value, model, notes)
    places = _places(model, "name", "implements")
    places |= {("depends_on", key): model.below("depends_on", key) for key in model.depends_on}
    return Entry(value, file, version, places)


def _places(model: FileModel, *keys: str) -> dict[tuple[str, ...], Place]:
    return {(key,): model.at(key) for key in keys}


def _remappings(model: RemappingsFile | None) -> tuple[tuple[str, str, str], ...]:
    if model is None:
        return ()
    kinds = ("parameters", "topics", "services", "actions")
    return tuple((kind, old, new) for kind in kinds for old, new in getattr(model, kind).items())


def _names(configuration: Iterable[Parameter]) -> dict[str, Parameter]:
    return {parameter.name: parameter for parameter in configuration}


def _note_missing(
    word: str, what: str, *, names: Iterable[str], place: Place, notes: Notes
) -> None:
    listed = list(names)
    hint = notes.near(word, listed)
    if not hint:
        hint = f"there are {', '.join(map(quoted, listed[:10]))}" if listed else "describe it"
    notes.error(place, f"there is no {what} {quoted(word)}", hint)


def _outcomes(
    model: OutcomesFile | None, configuration: tuple[Parameter, ...], notes: Notes
) -> Outcomes:
    if model is None:
        return Outcomes()
    never_fails = model.never_fails
    if never_fails and model.never_succeeds:
        message = "'never_fails' and 'never_succeeds' cannot both be true"
        notes.error(model.at("never_fails"), message, "remove one of them; never_fails is not used")
        never_fails = False
    if model.unless and not model.never_fails:
        message = "'unless' says when 'never_fails' does not hold, which is not declared"
        notes.warning(model.at("unless"), message, "add 'never_fails: true', or remove it")
    parameters = _names(configuration)
    unless: list[tuple[str, Value]] = []
    for name, node in model.unless.items():
        place = model.below("unless", name)
        value = typed(node, parameters[name].type) if name in parameters else None
        if name not in parameters:
            _note_missing(name, _PARAMETER, names=parameters, place=place, notes=notes)
        elif value is None:
            message = (
                f"{quoted(name)} never has this value: it is not a {parameters[name].type.value}"
            )
            notes.error(place, message, "write a value of the type of the parameter")
        else:
            unless.append((name, value))
    if len(unless) < len(model.unless):  # less than the author meant: claim nothing
        return Outcomes(False, model.never_succeeds, model.may_hang)
    return Outcomes(never_fails, model.never_succeeds, model.may_hang, tuple(unless))


def _span(
    model: SpanFile | None, configuration: tuple[Parameter, ...], notes: Notes
) -> Span | None:
    if model is None:
        return None
    sound = True
    parameters = _names(configuration)
    for key in ("min", "max"):
        bound: float | str | None = getattr(model, key)
        if isinstance(bound, str):
            if bound not in parameters:
                _note_missing(bound, _PARAMETER, names=parameters, place=model.at(key), notes=notes)
                sound = False
            elif parameters[bound].type not in NUMBERS:
                message = f"{quoted(bound)} is a {parameters[bound].type.value} and not a number"
                notes.error(model.at(key), message, "name a parameter of type double or int")
                sound = False
        elif bound is not None and bound < 0:
            notes.error(model.at(key), f"{key} is negative: {bound:g}", "write 0 or more")
            sound = False
        elif bound is not None and bound > MAX_AMOUNT:
            message = f"{key} is greater than {MAX_AMOUNT:g}: {bound:g}"
            hint = "write a smaller number" + (", or leave max out" if key == "max" else "")
            notes.error(model.at(key), message, hint)
            sound = False
    low, high = model.min, model.max
    if isinstance(low, float) and isinstance(high, float) and low > high:
        message = f"min is greater than max: {low:g} and {high:g}"
        notes.error(model.at("min"), message, "change one of them")
        sound = False
    return Span(low, high) if sound else None


def _with_effects(value: Provider, model: EffectsFile | None, notes: Notes) -> Provider:
    if model is None:
        return value
    parameters = _names(value.configuration)
    buffer = None
    if model.prompt_buffer is not None:
        written = model.prompt_buffer
        sound = True
        for key in ("uuid", "flush"):
            name: str = getattr(written, key)
            if name not in parameters:
                _note_missing(
                    name, _PARAMETER, names=parameters, place=written.at(key), notes=notes
                )
                sound = False
        answer = written.answer
        outputs = [each.name for each in value.outputs]
        if answer and answer not in outputs:
            _note_missing(
                answer,
                "output",
                names=dict.fromkeys(outputs),
                place=written.at("answer"),
                notes=notes,
            )
            answer = ""
        buffer = PromptBuffer(written.uuid, written.flush, answer) if sound else None
    sets_plan = model.sets_plan
    if sets_plan and value.input(sets_plan) is None:
        taken = [each.name for each in value.inputs]
        _note_missing(sets_plan, "input", names=taken, place=model.at("sets_plan"), notes=notes)
        sets_plan = ""
    return replace(value, effects=Effects(buffer, sets_plan, **_answering(value, model, notes)))


def _answering(value: Provider, model: EffectsFile, notes: Notes) -> dict[str, str]:
    """The effects of runners that answer questions, without the names of what is not there."""
    outputs = [each.name for each in value.outputs]
    parameters = [each.name for each in value.configuration]
    named: dict[str, str] = {}
    for key in ("answers", "question", "checks"):
        name: str = getattr(model, key)
        names = outputs if key == "answers" else parameters
        if name and name not in names:
            kind = "output" if key == "answers" else _PARAMETER
            _note_missing(name, kind, names=names, place=model.at(key), notes=notes)
            name = ""
        named[key] = name
    return named


def _reached(
    model: ProviderFile, configuration: tuple[Parameter, ...], notes: Notes
) -> tuple[tuple[Permission, str], ...]:
    """The permissions that are needed, and the parameters that say for what.

    It is kept where the parameter is wrong: that something is reached is true all the same.
    """
    kinds = {each.value: each for each in Permission}
    reached = []
    for key, name in model.reaches.items():
        place = model.below("reaches", key)
        if key not in kinds:
            hint = notes.near(key, kinds) or f"the permissions are {', '.join(kinds)}"
            notes.error(place, f"there is no permission {quoted(key)}", hint)
            continue
        if name not in _names(configuration):
            _note_missing(name, _PARAMETER, names=_names(configuration), place=place, notes=notes)
        reached.append((kinds[key], name))
    return tuple(reached)


def _check_command(value: Provider, model: ProviderFile, notes: Notes) -> None:
    """Read the example leniently: ``name=`` stands for an attribute, whatever is around it."""
    definition = model.definition
    if definition is None or not definition.command:
        return
    names = {*NOT_PARAMETERS, *(each.name for each in value.inputs)}
    for each in value.configuration:
        names |= {each.name, *each.aliases}
    for name in dict.fromkeys(_ATTRIBUTES.findall(definition.command)):
        if name not in names:
            message = f"the command gives a parameter {quoted(name)} that is not described"
            hint = notes.near(name, sorted(names)) or "describe it, or remove it here"
            notes.warning(definition.at("command"), message, hint)
