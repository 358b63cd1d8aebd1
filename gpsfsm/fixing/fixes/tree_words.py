"""GP105: words of behaviour trees that say the same as an element of a plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import escaped, rename, without_attribute, wrapped

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft, Node

_SEQUENCES = frozenset({"sequence", "sequencestar", "reactivesequence"})
_FALLBACKS = frozenset({"fallback", "selector", "reactivefallback"})
_MOVES = frozenset({"movebase", "moveto", "navigatetopose", "gotowaypoint", "goto", "navigate"})
_KEPT = frozenset({"name", "x", "y", "goal", "target", "position", "waypoint", "location"})
_WAYPOINT = "WaypointRunner"


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix for all elements of a text, since the front end names each word once only."""
    edits: list[Edit] = []
    at = -1
    for node in draft.outline.nodes.values():
        word = node.name.lower()
        rewritten: tuple[Edit, ...] = ()
        if word in _SEQUENCES:
            rewritten = _control(draft, node)
        elif word in _FALLBACKS:
            rewritten = _fallback(draft, node)
        elif word in _MOVES or word == "action":
            rewritten = _move(draft, node, word)
        if rewritten:
            at = node.start if at < 0 else at
            edits += rewritten
    if edits:
        yield Fix("GP105", "words of behaviour trees translated", at, tuple(edits), Safety.UNSAFE)


def _control(draft: Draft, node: Node) -> tuple[Edit, ...]:
    """The element as a sequential control; of its attributes only the name stays."""
    start = node.start + 1
    written = Edit(start, start + len(node.name), 'Control type="sequential"')
    others = (raw for raw in node.tag.attributes if raw.name != "name")
    dropped = tuple(without_attribute(draft, raw) for raw in others)
    return (written, *rename(node, "Control")[1:], *dropped)


def _fallback(draft: Draft, node: Node) -> tuple[Edit, ...]:
    """The edits of a fallback: its first child is the goal, the others are its recovery."""
    # Elements that are rewritten themselves cannot be moved by the same fix: later, then.
    if not node.children or any(each.name not in ("Runner", "Control") for each in node.children):
        return ()
    others = node.children[1:]
    recovery = wrapped(draft, others, '<Control type="recovery">') if others else ()
    return (*_control(draft, node), *recovery)


def _move(draft: Draft, node: Node, word: str) -> tuple[Edit, ...]:
    if node.children:
        return ()
    identity = node.attribute("ID") or node.attribute("id")
    if word == "action":
        named = draft.text[identity.value_start : identity.value_end] if identity else ""
        if named.lower().replace("_", "") not in _MOVES:
            return ()
    waypoints = [name for name in draft.library.interface_names if name.endswith("/" + _WAYPOINT)]
    providers = draft.library.providers_of(waypoints[0]) if len(waypoints) == 1 else ()
    others = [raw for raw in node.tag.attributes if raw is not identity]
    if not providers or any(raw.name not in _KEPT for raw in others):
        return ()
    interface, provider = escaped(waypoints[0]), escaped(providers[0].name)
    edits = list(rename(node, "Runner"))
    start = node.start + 1 + len(node.name)
    edits.append(Edit(start, start, f' interface="{interface}" provider="{provider}"'))
    if identity is not None:
        edits.append(without_attribute(draft, identity))
    return tuple(edits)


FIXER = Fixer(
    name="tree-words",
    rules=("GP105",),
    propose=propose,
    unsafe=(
        "writes a behaviour tree's `Sequence` as a sequential control, `Fallback` as a step with a "
        "recovery, and `MoveBase` as a waypoint: the words mean almost the same there"
    ),
)
