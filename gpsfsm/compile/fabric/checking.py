"""The second version's check of a plan's elements, with its messages and its crash.

The original is a recursion over first children and next siblings. It stops a chain of siblings at
the first bad one, but goes on behind a control whose children were bad; what it says at last is
what it found last.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.compile.fabric.printing import printed
from gpsfsm.model.engine import Crashed, EngineElement, Rejected
from gpsfsm.model.plan import ControlType

if TYPE_CHECKING:
    from gpsfsm.model.engine import EngineDocument

__all__ = ["SEGMENTATION_FAULT", "check"]

SEGMENTATION_FAULT = "signal 11"
_PREFIX = "XML plan parsing failed: "
_TYPES = frozenset(kind.value for kind in ControlType)


def check(document: EngineDocument, root: EngineElement) -> Rejected | Crashed | None:
    """Check what is in ``<Plan>``; None if it passes."""
    rejected: list[EngineElement] = []
    # Chains of siblings, the innermost last.
    chains = [iter(document.elements(root.children))]
    while chains:
        element = next(chains[-1], None)
        if element is None:
            chains.pop()
            continue
        if _fault(element):
            rejected.append(element)
            chains.pop()
        elif element.tag == "Control" and element.children:
            inside = document.elements(element.children)
            if not inside:
                # It asks whether there are children, and then reads the first element of them.
                reason = "a control that holds no element but text, a comment or the like"
                return Crashed(SEGMENTATION_FAULT, element.start, reason)
            chains.append(iter(inside))
    return _rejection(document, rejected) if rejected else None


def _fault(element: EngineElement) -> str:
    """What is wrong with an element, for people; "" if nothing is."""
    if element.tag == "Control":
        written = element.text("type")
        if written is None:
            return "the control has no type"
        return "" if written in _TYPES else f"'{written}' is not a type of control"
    if element.tag == "Runner":
        for name in ("interface", "provider"):
            if element.text(name) is None:
                return f"the runner has no {name}"
        return ""
    return f"<{element.tag}> is neither a control nor a runner"


def _rejection(document: EngineDocument, rejected: list[EngineElement]) -> Rejected:
    last = rejected[-1]
    return Rejected(
        _PREFIX + _message(document, last),
        last.start,
        _fault(last),
        tuple(element.index for element in rejected),
    )


def _message(document: EngineDocument, element: EngineElement) -> str:
    """The engine's words for a bad element."""
    if element.tag == "Control":
        written = element.text("type")
        if written is not None:
            return f"Control tag '{written}' not available in the valid list"
        return f"Control tag missing 'type' attribute: {printed(document, element.index)}"
    if element.tag == "Runner":
        missing = "interface" if element.text("interface") is None else "provider"
        return f"Runner tag missing '{missing}' attribute: {printed(document, element.index)}"
    return f"XML element is not valid :{printed(document, element.index)}"
