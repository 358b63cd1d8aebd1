"""The key ``nodes`` of task files: what behaviour trees may use besides the built-in nodes."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.capabilities.defects import quoted
from gpsfsm.capabilities.reading import Items, Scalar, Table, kind_of
from gpsfsm.model.tree_nodes import RESERVED
from gpsfsm.tasks.task import NodeForm

if TYPE_CHECKING:
    from gpsfsm.capabilities.defects import Notes, Place
    from gpsfsm.tasks.schema import TaskFile

__all__ = ["nodes_of"]

_NAME = re.compile(r"[^\W\d]\w{0,99}")
_FORMS = ("compact", "any")
_MAX_NODES = 1_000
_MAX_PORTS = 100
_PORTS = "the ports must be a name or a list of names"


def nodes_of(model: TaskFile, notes: Notes) -> tuple[NodeForm, ...]:
    """The nodes by their order; what makes no sense is noted and left out."""
    found = []
    if len(model.nodes) > _MAX_NODES:
        notes.error(model.at("nodes"), f"there are more than {_MAX_NODES} nodes here")
    for name, node in list(model.nodes.items())[:_MAX_NODES]:
        place = model.below("nodes", name)
        if not _NAME.fullmatch(name):
            notes.error(place, f"{quoted(name)} is no name of a node")
        elif name in RESERVED:
            notes.error(place, f"{quoted(name)} is a built-in node", "leave it out here")
        else:
            found.append(_form(name, node, place, notes))
    return tuple(found)


def _form(name: str, node: object, place: Place, notes: Notes) -> NodeForm:
    """A node: its ports, or a mapping with ``ports`` and ``form``."""
    if not isinstance(node, Table):
        return NodeForm(name, _ports(node, place, notes))
    for key in node:
        if key not in ("ports", "form"):
            hint = "known are ports and form"
            notes.error(node.places[key], f"{quoted(key)} says nothing about a node", hint)
    form = node.get("form")
    text = form.text if isinstance(form, Scalar) else ""
    if form is not None and text not in _FORMS:
        notes.error(node.places["form"], "'form' must be compact or any")
    ports = node.get("ports", Items(place))
    where = node.places.get("ports", place)
    return NodeForm(name, _ports(ports, where, notes), text == "compact")


def _ports(node: object, place: Place, notes: Notes) -> tuple[str, ...]:
    items = node if isinstance(node, Items) else [node]
    texts = [item.text for item in items if isinstance(item, Scalar) and item.value is not None]
    if len(texts) != len(items):
        notes.error(place, _PORTS, "" if isinstance(node, Items) else f"it is {kind_of(node)}")
    elif len(texts) > _MAX_PORTS:
        notes.error(place, f"there are more than {_MAX_PORTS} ports here")
    for text in texts[:_MAX_PORTS]:
        if not _NAME.fullmatch(text):
            notes.error(place, f"{quoted(text)} is no name of a port")
    return tuple(texts[:_MAX_PORTS])
