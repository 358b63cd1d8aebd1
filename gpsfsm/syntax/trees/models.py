"""TreeNodesModel: which nodes there are, and which ports they have."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.tree import NodeModel, PortKind, TreeNode
from gpsfsm.model.tree_nodes import RESERVED
from gpsfsm.syntax.chars import clip
from gpsfsm.syntax.trees.telling import tell

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.syntax.collector import Collector

__all__ = ["models_of"]

_CATEGORIES = ("Action", "Condition", "Decorator", "Control", "SubTree")
_PORTS = {kind.value: kind for kind in PortKind}


def models_of(nodes: Sequence[TreeNode], collector: Collector) -> Mapping[str, NodeModel] | None:
    """The models of all TreeNodesModel elements by ID; None if there is no such element."""
    found: dict[str, NodeModel] = {}
    described = False
    for child in nodes[0].children:
        if nodes[child].tag == "TreeNodesModel":
            described = True
            for index in nodes[child].children:
                _model(nodes, nodes[index], found, collector)
    return found if described else None


def _model(
    nodes: Sequence[TreeNode],
    node: TreeNode,
    found: dict[str, NodeModel],
    collector: Collector,
) -> None:
    name = node.text("ID")
    if node.tag not in _CATEGORIES:
        message = f"<{clip(node.tag)}> describes no kind of node"
        hint = f"a TreeNodesModel holds {', '.join(_CATEGORIES[:-1])} and {_CATEGORIES[-1]}"
        tell(collector, "GP814", node, message=message, hint=hint)
        return
    if not name:
        message = f"this <{node.tag}> of the TreeNodesModel has no ID"
        tell(collector, "GP807", node, message=message, hint='add the name of the node: ID="…"')
        return
    if name in RESERVED:
        message = f"'{clip(name)}' is the name of a built-in node; no node of your own can have it"
        tell(collector, "GP804", node, message=message, hint="choose another ID")
        return
    if name in found:
        message = f"'{clip(name)}' is described twice, first on line {found[name].line}"
        tell(collector, "GP806", node, message=message, hint="keep one of the descriptions")
        return
    ports: dict[str, PortKind] = {}
    for index in node.children:
        port = nodes[index]
        kind = _PORTS.get(port.tag)
        if kind is None:
            message = f"<{clip(port.tag)}> is no port: BehaviorTree.CPP does not read it"
            hint = "write <input_port>, <output_port> or <inout_port>, in small letters"
            tell(collector, "GP814", port, message=message, hint=hint)
        elif not port.text("name"):
            message = "this port has no name"
            tell(collector, "GP807", port, message=message, hint='add its name: name="…"')
        else:
            ports[port.text("name")] = kind
    found[name] = NodeModel(node.tag, ports, node.line)
