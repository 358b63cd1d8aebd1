"""The section ``ros`` of a provider file: its shape, and the exchange that it describes.

A runner of such a provider needs no code (docs/ros.md). Whether the definitions have the fields
that the section names shows only where they are installed, so ``gpsfsm.ros`` says that.
"""

from __future__ import annotations

import re
from math import isfinite, nan
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from pydantic import BeforeValidator, Field

from gpsfsm.capabilities.defects import Notes, quoted
from gpsfsm.capabilities.reading import (
    FileModel,
    Flag,
    Items,
    MappingOf,
    Number,
    Scalar,
    Table,
    Text,
    Texts,
    wrong,
)
from gpsfsm.model.ros import (
    WHOLE,
    Comparison,
    Condition,
    Durability,
    OnResume,
    Quality,
    Reliability,
    RosCall,
    RosKind,
    parameter_in,
    steps,
)

if TYPE_CHECKING:
    from collections.abc import Collection

    from gpsfsm.capabilities.defects import Place
    from gpsfsm.model.capability import Provider

_NAME = re.compile(r"[~/]?[A-Za-z_]\w*(?:/[A-Za-z_]\w*)*", re.ASCII)
_TYPE = re.compile(r"[a-z][a-z0-9_]*/(msg|srv|action)/[A-Z][A-Za-z0-9]*")
_FIELD = re.compile(r"[a-z]\w*(?:\[\])?(?:\.[a-z]\w*(?:\[\])?)*", re.ASCII)
_COMPARED = re.compile(r"([<>]=?|!=|==)\s*(.*)")
_PICKS = "first, last, all, or best by FIELD"
_FOLDERS = {RosKind.ACTION: "action", RosKind.SERVICE: "srv", RosKind.TOPIC: "msg"}
_DEADLINES = {RosKind.SERVICE: 30.0, RosKind.TOPIC: 30.0, RosKind.TRANSFORM: 5.0}
_TRANSFORMS = ("tf2_msgs/msg/TFMessage",)
_OF_A_TOPIC = ("until", "qos", "max_age")
_OF_A_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
_LONGEST = 1e6  # seconds
_DEEPEST = 1_000  # messages that a subscription keeps until they are taken
_Word = TypeVar("_Word", Reliability, Durability)


def _types(node: object) -> object:
    if isinstance(node, Items):
        return [each.text if isinstance(each, Scalar) else "" for each in node]
    if isinstance(node, Scalar) and node.value is not None:
        return [node.text]
    raise wrong("the name of a definition, or a list of names", node)


def _frames(node: object) -> object:
    pairs = node if isinstance(node, Items) and node and isinstance(node[0], Items) else [node]
    frames = []
    for pair in pairs:
        if not isinstance(pair, Items) or len(pair) != 2:
            raise wrong("two frames in brackets, such as [$map, $robot], or a list of these", node)
        frames.append(tuple(each.text if isinstance(each, Scalar) else "" for each in pair))
    return frames


def _alternatives(node: object) -> object:
    tables = node if isinstance(node, Items) else [node]
    if not tables or not all(isinstance(each, Table) and each for each in tables):
        raise wrong("what fields must be ('field: value' lines), or a list of such mappings", node)
    return list(tables)


class QosFile(FileModel):
    """``qos``: what is requested of a topic in place of what its publishers offer."""

    reliability: Text = ""
    durability: Text = ""
    depth: Number = 10.0


class CallFile(FileModel):
    """``ros``: what the runner does on a robot."""

    action: Text = ""
    service: Text = ""
    topic: Text = ""
    transform: Annotated[list[tuple[str, str]], BeforeValidator(_frames)] = Field(
        default_factory=list
    )
    type: Annotated[list[str], BeforeValidator(_types)] = Field(default_factory=list)
    request: MappingOf[Any] = Field(default_factory=dict)
    optional: Texts = Field(default_factory=list)
    outputs: MappingOf[Text] = Field(default_factory=dict)
    feedback: MappingOf[Text] = Field(default_factory=dict)
    pose: Text = ""
    success: Annotated[list[Table], BeforeValidator(_alternatives)] = Field(default_factory=list)
    message: Text = ""
    until: Annotated[list[Table], BeforeValidator(_alternatives)] = Field(default_factory=list)
    qos: QosFile | None = None
    max_age: Number | None = None
    late: Flag = False
    deadline: Number | None = None
    silence: Number = 0.0
    wait: Number = 5.0
    probe: Number = 2.0
    on_resume: Text = OnResume.ASK.value


def ros_call(model: CallFile | None, provider: Provider, notes: Notes) -> RosCall | None:
    """The exchange that a section describes; None, with errors noted, if it cannot be one."""
    if model is None:
        return None
    kinds = [each for each in RosKind if getattr(model, each.value)]
    if len(kinds) != 1:
        message = "'ros' must have one of the keys action, service, topic and transform"
        notes.error(model.place, message, "say in one of them what the runner calls")
        return None
    before = len(notes.defects)
    kind = kinds[0]
    name = "" if kind is RosKind.TRANSFORM else getattr(model, kind.value)
    _check(model, kind, name, provider, notes)
    parameters = {each.name for each in provider.configuration}
    parameters |= {each.name for each in provider.inputs}
    request = _request(model, parameters, notes)
    qos = _quality(model.qos, notes)
    success, until = (_sets(each, parameters, notes) for each in (model.success, model.until))
    for frame in (each for pair in model.transform for each in pair):
        if frame.startswith("$"):
            _check_parameter(frame, parameters, model.at("transform"), notes)
    if len(notes.defects) > before:
        return None
    usual = 0.0 if model.until else _DEADLINES.get(kind, 0.0)
    return RosCall(
        kind=kind,
        name=name,
        types=_TRANSFORMS if kind is RosKind.TRANSFORM else tuple(model.type),
        request=request,
        optional=tuple(dict.fromkeys(model.optional)),
        outputs=tuple(model.outputs.items()),
        feedback=tuple(model.feedback.items()),
        pose=model.pose,
        success=success,
        message=model.message,
        frames=tuple(model.transform),
        until=until,
        qos=qos,
        max_age_s=model.max_age or 0.0,
        deadline_s=usual if model.deadline is None else model.deadline,
        late=model.late,
        silence_s=model.silence,
        wait_s=model.wait,
        probe_s=model.probe,
        on_resume=OnResume(model.on_resume),
    )


def _sets(
    sets: list[Table], parameters: set[str], notes: Notes
) -> tuple[tuple[Condition, ...], ...]:
    rows = [[_condition(field, each, parameters, notes) for field in each] for each in sets]
    return tuple(tuple(filter(None, each)) for each in rows)


def _check(model: CallFile, kind: RosKind, name: str, provider: Provider, notes: Notes) -> None:
    _check_names(model, kind, name, notes)
    _check_use(model, kind, notes)
    _check_fields(model, provider, notes)
    _check_seconds(model, notes)
    _check_resume(model, kind, notes)


def _check_names(model: CallFile, kind: RosKind, name: str, notes: Notes) -> None:
    if kind is RosKind.TRANSFORM:
        if any(not frame or not frame.isprintable() for pair in model.transform for frame in pair):
            notes.error(model.at("transform"), "the name of a frame is missing", "write two names")
        return
    if not _NAME.fullmatch(name):
        message = f"{quoted(name)} is not a valid ROS name"
        hint = "write letters, digits and underscores, with a slash between parts"
        notes.error(model.at(kind.value), message, hint)
    folder = _FOLDERS[kind]
    if not model.type:
        hint = f"write its definition, as in type: package/{folder}/Name"
        notes.error(model.place, f"the {kind.value} has no 'type'", hint)
    for each in model.type:
        match = _TYPE.fullmatch(each)
        if match is None or match[1] != folder:
            message = f"{quoted(each)} is not a definition of {_article(kind)}"
            notes.error(model.at("type"), message, f"write package/{folder}/Name")


def _article(kind: RosKind) -> str:
    return "an action" if kind is RosKind.ACTION else f"a {kind.value}"


def _check_use(model: CallFile, kind: RosKind, notes: Notes) -> None:
    of_a_watch = () if model.until else ("feedback", "pose")
    unused = {
        RosKind.ACTION: _OF_A_TOPIC,
        RosKind.SERVICE: (*_OF_A_TOPIC, "feedback", "pose", "silence"),
        RosKind.TOPIC: ("request", "optional", *of_a_watch),
        RosKind.TRANSFORM: (
            *_OF_A_TOPIC,
            *("request", "optional", "feedback", "pose", "silence", "success"),
        ),
    }[kind]
    for key in unused:
        if getattr(model, key):
            without = " without 'until'" if kind is RosKind.TOPIC and key in of_a_watch else ""
            message = f"{quoted(key)} has no effect for {_article(kind)}{without}"
            notes.error(model.at(key), message, "remove it")


def _check_fields(model: CallFile, provider: Provider, notes: Notes) -> None:
    for key in ("request", "optional"):
        for field in getattr(model, key):
            if not _FIELD.fullmatch(field):
                hint = "write a.b, or a[].b for each item of a list"
                notes.error(model.at(key), f"{quoted(field)} is not a field", hint)
    read = [("success", field) for table in model.success for field in table]
    read += [("until", field) for table in model.until for field in table]
    read += [
        (key, field) for key in ("outputs", "feedback") for field in getattr(model, key).values()
    ]
    read += [(key, getattr(model, key)) for key in ("pose", "message") if getattr(model, key)]
    for key, field in read:
        if not (_is_read(field) or (key == "outputs" and field == WHOLE)):
            hint = f"write a.b, a[] for a length, or a[first].b ({_PICKS})"
            notes.error(model.at(key), f"{quoted(field)} is not a field", hint)
    if model.transform:
        for name, field in model.outputs.items():
            if field not in _OF_A_POSE:
                message = f"a transform has no {quoted(field)}"
                hint = f"it has {', '.join(_OF_A_POSE)}"
                notes.error(model.below("outputs", name), message, hint)
    outputs = {each.name for each in provider.outputs}
    for name in model.outputs:
        if name not in outputs:
            place = model.below("outputs", name)
            notes.error(place, f"there is no output {quoted(name)}", "describe it, or remove it")


def _check_seconds(model: CallFile, notes: Notes) -> None:
    for key in ("deadline", "silence", "wait", "probe", "max_age"):
        seconds = getattr(model, key)
        if seconds is not None and not 0 <= seconds <= _LONGEST:
            message = f"{quoted(key)} must be from 0 to {_LONGEST:g} seconds"
            notes.error(model.at(key), message, "write seconds")
    for key in ("probe", "max_age"):
        seconds = getattr(model, key)
        if seconds is not None and seconds <= 0:
            notes.error(model.at(key), f"{quoted(key)} must be more than 0", "write seconds")


def _check_resume(model: CallFile, kind: RosKind, notes: Notes) -> None:
    words = [each.value for each in OnResume]
    if model.on_resume not in words:
        hint = notes.near(model.on_resume, words) or "write ask, cancel or continue"
        notes.error(model.at("on_resume"), f"{quoted(model.on_resume)} is not a choice", hint)
    elif model.on_resume == OnResume.CONTINUE.value and kind is RosKind.TRANSFORM:
        message = "'on_resume' has no effect for a transform"
        notes.error(model.at("on_resume"), message, "remove it")


def _quality(model: QosFile | None, notes: Notes) -> Quality:
    if model is None:
        return Quality()

    if not (1 <= model.depth <= _DEEPEST and model.depth % 1 == 0):
        message = f"'depth' must be a whole number from 1 to {_DEEPEST}"
        notes.error(model.at("depth"), message, "write how many messages are kept")
        return Quality()
    return Quality(
        _word(model, "reliability", Reliability, notes),
        _word(model, "durability", Durability, notes),
        int(model.depth),
    )


def _word(model: QosFile, key: str, words: type[_Word], notes: Notes) -> _Word | None:
    text, choices = getattr(model, key), [each.value for each in words]
    if not text:
        return None
    if text not in choices:
        hint = notes.near(text, choices) or f"write {' or '.join(choices)}"
        notes.error(model.at(key), f"{quoted(text)} is not a {key}", hint)
        return None
    return words(text)


def _is_read(path: str) -> bool:
    try:
        return bool(steps(path))
    except ValueError:
        return False


def _request(
    model: CallFile, parameters: Collection[str], notes: Notes
) -> tuple[tuple[str, Any], ...]:
    fields = []
    for field, node in model.request.items():
        value = _value(node, parameters, model.below("request", field), notes, lists=True)
        if value is not None:
            fields.append((field, value))
    return tuple(fields)


def _value(
    node: object, parameters: Collection[str], place: Place, notes: Notes, *, lists: bool = False
) -> Any:
    """A value, or a tuple of values for a list, or None with an error noted."""
    if isinstance(node, Items) and lists:
        items = [_value(each, parameters, node.place, notes, lists=True) for each in node]
        if not items:
            notes.error(node.place, "the list is empty", "write values, or remove the field")
        return None if None in items else tuple(items)
    if not isinstance(node, Scalar) or node.value is None:
        notes.error(place, "it is not a value", "write a value, or $parameter")
        return None
    if isinstance(node.value, str) and node.value.startswith("$"):
        _check_parameter(node.value, parameters, place, notes)
    return node.value


def _condition(
    field: str, table: Table, parameters: Collection[str], notes: Notes
) -> Condition | None:
    place = table.places[field]
    value = _value(table[field], parameters, place, notes)
    match = _COMPARED.fullmatch(value) if isinstance(value, str) else None
    if value is None or match is None:
        return None if value is None else Condition(field, Comparison.IS, value)
    word, operand = Comparison(match[1]), match[2]
    if operand.startswith("$"):
        _check_parameter(operand, parameters, place, notes)
        return Condition(field, word, operand)
    try:
        number = float(operand)
    except ValueError:
        number = nan
    if not isfinite(number):
        hint = "write one such as '>= 0.2', or '< $parameter'"
        notes.error(place, f"{quoted(value)} is not a comparison", hint)
        return None
    return Condition(field, word, number)


def _check_parameter(text: str, parameters: Collection[str], place: Place, notes: Notes) -> None:
    name, _ = parameter_in(text)
    if name not in parameters:
        hint = notes.near(name, parameters) or "describe it, or write a value"
        notes.error(place, f"there is no parameter {quoted(name)}", hint)
