"""From one file's model to an interface, a provider or a semantic interface."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from gpsfsm.capabilities.defects import Notes, Place, quoted
from gpsfsm.capabilities.parameters import described, inputs, outputs, parameters
from gpsfsm.capabilities.values import NUMBERS, typed
from gpsfsm.model.capability import (
    MAX_AMOUNT,
    Effects,
    Interface,
    Outcomes,
    PromptBuffer,
    Provider,
    SemanticInterface,
    Span,
)
from gpsfsm.model.plan import NOT_PARAMETERS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.capabilities.schema import (
        EffectsFile,
        InterfaceFile,
        OutcomesFile,
        ProviderFile,
        RemappingsFile,
        SemanticFile,
        SpanFile,
    )
    from gpsfsm.capabilities.shapes import FileModel
    from gpsfsm.model.capability import Parameter
    from gpsfsm.model.plan import Value

__all__ = ["Entry", "interface", "provider", "semantic"]

_ATTRIBUTES = re.compile(r"([^\W\d][\w.\-]*)\s*=(?!=)")
_PARAMETER = "configuration parameter"


@dataclass(frozen=True, slots=True)
class Entry:
    """What one file describes, with the places that checks across files need.

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
        depends_on=tuple((key, found.provider) for key, found in model.depends_on.items()),
        remappings=_remappings(model.remappings),
        outcomes=_outcomes(model.outcomes, configuration, notes),
        duration=_span(model.duration, configuration, notes),
        energy=_span(model.energy, configuration, notes),
        resources=tuple(dict.fromkeys(model.resources)),
        deprecated=model.deprecated,
        origin=file,
    )
    value = _with_effects(value, model.effects, notes)
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
    return {found.name: found for found in configuration}


def _note_missing(
    word: str, what: str, *, known: Iterable[str], place: Place, notes: Notes
) -> None:
    listed = list(known)
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
        message = "'never_fails' and 'never_succeeds' contradict each other"
        notes.error(model.at("never_fails"), message, "remove one of them; never_fails is not used")
        never_fails = False
    if model.unless and not model.never_fails:
        message = "'unless' says when 'never_fails' does not hold, which is not declared"
        notes.warning(model.at("unless"), message, "add 'never_fails: true', or remove it")
    known = _names(configuration)
    unless: list[tuple[str, Value]] = []
    for name, node in model.unless.items():
        place = model.below("unless", name)
        value = typed(node, known[name].type) if name in known else None
        if name not in known:
            _note_missing(name, _PARAMETER, known=known, place=place, notes=notes)
        elif value is None:
            message = f"{quoted(name)} never has this value: it is not a {known[name].type.value}"
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
    known = _names(configuration)
    for key in ("min", "max"):
        bound: float | str | None = getattr(model, key)
        if isinstance(bound, str):
            if bound not in known:
                _note_missing(bound, _PARAMETER, known=known, place=model.at(key), notes=notes)
                sound = False
            elif known[bound].type not in NUMBERS:
                message = f"{quoted(bound)} is a {known[bound].type.value} and not a number"
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
    known = _names(value.configuration)
    buffer = None
    if model.prompt_buffer is not None:
        written = model.prompt_buffer
        sound = True
        for key in ("uuid", "flush"):
            name: str = getattr(written, key)
            if name not in known:
                _note_missing(name, _PARAMETER, known=known, place=written.at(key), notes=notes)
                sound = False
        answer = written.answer
        given = [found.name for found in value.outputs]
        if answer and answer not in given:
            _note_missing(
                answer,
                "output",
                known=dict.fromkeys(given),
                place=written.at("answer"),
                notes=notes,
            )
            answer = ""
        buffer = PromptBuffer(written.uuid, written.flush, answer) if sound else None
    sets_plan = model.sets_plan
    if sets_plan and value.input(sets_plan) is None:
        taken = [found.name for found in value.inputs]
        _note_missing(sets_plan, "input", known=taken, place=model.at("sets_plan"), notes=notes)
        sets_plan = ""
    return replace(value, effects=Effects(buffer, sets_plan))


def _check_command(value: Provider, model: ProviderFile, notes: Notes) -> None:
    """Read the example leniently: ``name=`` stands for an attribute, whatever is around it."""
    definition = model.definition
    if definition is None or not definition.command:
        return
    known = {*NOT_PARAMETERS, *(found.name for found in value.inputs)}
    for found in value.configuration:
        known |= {found.name, *found.aliases}
    for name in dict.fromkeys(_ATTRIBUTES.findall(definition.command)):
        if name not in known:
            message = f"the command gives a parameter {quoted(name)} that is not described"
            hint = notes.near(name, sorted(known)) or "describe it, or remove it here"
            notes.warning(definition.at("command"), message, hint)
