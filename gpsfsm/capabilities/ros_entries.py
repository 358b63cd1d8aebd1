"""The section ``ros`` of a provider file: its shape, and the exchange that it describes.

A runner of such a provider needs no code (docs/ros.md). Whether the definitions have the fields
that the section names shows only where they are installed, so ``gpsfsm.ros`` says that.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BeforeValidator, Field

from gpsfsm.capabilities.defects import Notes, quoted
from gpsfsm.capabilities.reading import (
    FileModel,
    Flag,
    Items,
    MappingOf,
    Number,
    Scalar,
    Text,
    Texts,
    wrong,
)
from gpsfsm.model.ros import OnResume, RosCall, RosKind

if TYPE_CHECKING:
    from collections.abc import Collection

    from gpsfsm.model.capability import Provider
    from gpsfsm.model.plan import Value

_NAME = re.compile(r"[~/]?[A-Za-z_]\w*(?:/[A-Za-z_]\w*)*", re.ASCII)
_TYPE = re.compile(r"[a-z][a-z0-9_]*/(msg|srv|action)/[A-Z][A-Za-z0-9]*")
_FIELD = re.compile(r"[a-z]\w*(?:\[\])?(?:\.[a-z]\w*(?:\[\])?)*", re.ASCII)
_WHOLE = "."
"""In place of a field: all of the message."""
_FOLDERS = {RosKind.ACTION: "action", RosKind.SERVICE: "srv", RosKind.TOPIC: "msg"}
_DEADLINES = {RosKind.SERVICE: 30.0, RosKind.TOPIC: 30.0, RosKind.TRANSFORM: 5.0}
_TRANSFORMS = ("tf2_msgs/msg/TFMessage",)
_OF_A_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
_LONGEST = 1e6  # seconds


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
    success: MappingOf[Any] = Field(default_factory=dict)
    message: Text = ""
    latched: Flag = False
    deadline: Number | None = None
    silence: Number = 0.0
    wait: Number = 5.0
    probe: Number = 2.0
    on_resume: Text = OnResume.CANCEL.value


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
    _check_names(model, kind, name, notes)
    _check_fields(model, kind, provider, notes)
    _check_seconds(model, notes)
    _check_resume(model, kind, notes)
    parameters = {each.name for each in provider.configuration}
    parameters |= {each.name for each in provider.inputs}
    request = _values(model, "request", parameters, notes)
    success = _values(model, "success", parameters, notes)
    for frame in (each for pair in model.transform for each in pair):
        if frame.startswith("$"):
            _check_parameter(frame, parameters, model, "transform", notes)
    if len(notes.defects) > before:
        return None
    deadline = model.deadline
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
        latched=model.latched,
        deadline_s=_DEADLINES.get(kind, 0.0) if deadline is None else deadline,
        silence_s=model.silence,
        wait_s=model.wait,
        probe_s=model.probe,
        on_resume=OnResume(model.on_resume),
    )


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


def _check_fields(model: CallFile, kind: RosKind, provider: Provider, notes: Notes) -> None:
    unused = {
        RosKind.ACTION: ("latched",),
        RosKind.SERVICE: ("latched", "feedback", "pose", "silence"),
        RosKind.TOPIC: ("request", "optional", "feedback", "pose", "silence"),
        RosKind.TRANSFORM: ("request", "optional", "feedback", "pose", "silence", "success"),
    }[kind]
    for key in unused:
        if getattr(model, key):
            message = f"{quoted(key)} has no effect for {_article(kind)}"
            notes.error(model.at(key), message, "remove it")
    fields = [(key, each) for key in ("request", "success") for each in getattr(model, key)]
    for key in ("outputs", "feedback"):
        fields += [(key, each) for each in getattr(model, key).values()]
    fields += [("optional", each) for each in model.optional]
    fields += [(key, getattr(model, key)) for key in ("pose", "message") if getattr(model, key)]
    for key, field in fields:
        if not (_FIELD.fullmatch(field) or (key == "outputs" and field == _WHOLE)):
            notes.error(model.at(key), f"{quoted(field)} is not a field", "write a.b, or a[].b")
    if kind is RosKind.TRANSFORM:
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
    for key in ("deadline", "silence", "wait", "probe"):
        seconds = getattr(model, key)
        if seconds is not None and not 0 <= seconds <= _LONGEST:
            message = f"{quoted(key)} must be from 0 to {_LONGEST:g} seconds"
            notes.error(model.at(key), message, "write seconds")
    if model.probe <= 0:
        notes.error(model.at("probe"), "'probe' must be more than 0", "write seconds")


def _check_resume(model: CallFile, kind: RosKind, notes: Notes) -> None:
    words = [each.value for each in OnResume]
    if model.on_resume not in words:
        hint = notes.near(model.on_resume, words) or f"write {' or '.join(words)}"
        notes.error(model.at("on_resume"), f"{quoted(model.on_resume)} is not a choice", hint)
    elif model.on_resume != OnResume.CANCEL.value and kind is RosKind.TRANSFORM:
        message = "'on_resume' has no effect for a transform"
        notes.error(model.at("on_resume"), message, "remove it")


def _values(
    model: CallFile, key: str, parameters: Collection[str], notes: Notes
) -> tuple[tuple[str, Value], ...]:
    values: list[tuple[str, Value]] = []
    for field, node in getattr(model, key).items():
        if not isinstance(node, Scalar) or node.value is None:
            notes.error(
                model.below(key, field), "it is not a value", "write a value, or $parameter"
            )
            continue
        if isinstance(node.value, str) and node.value.startswith("$"):
            _check_parameter(node.value, parameters, model, key, notes)
        values.append((field, node.value))
    return tuple(values)


def _check_parameter(
    text: str, parameters: Collection[str], model: CallFile, key: str, notes: Notes
) -> None:
    name = text.removeprefix("$")
    if name not in parameters:
        hint = notes.near(name, parameters) or "describe it, or write a value"
        notes.error(model.at(key), f"there is no parameter {quoted(name)}", hint)
