"""A text as an engine's parser has read it → connections, a rejection or a crash."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.compile.fabric.checking import SEGMENTATION_FAULT, check
from gpsfsm.compile.fabric.walk import walk
from gpsfsm.model.engine import Crashed, EngineDocument, EnginePlan, Rejected, Unreadable

if TYPE_CHECKING:
    from gpsfsm.compile.fabric.profiles import Profile
    from gpsfsm.model.engine import EngineElement, EngineResult

__all__ = ["PLAN_ID", "compile_document"]

PLAN_ID = "PLAN-ID"
"""Stands for the identifier that a server makes up for each plan."""

_NO_PLAN = "No <Plan> element found."


def compile_document(
    document: EngineDocument | Unreadable, profile: Profile, *, plan_id: str = PLAN_ID
) -> EngineResult:
    """What the engine makes of a text.

    Before anything is checked, the engine moves all that is in the first outermost ``<Plan>`` into
    a sequential control, and appends a runner to it that completes the plan.
    """
    if isinstance(document, Unreadable):
        reason = f"{document.name}: {document.message}"
        return Rejected(profile.unreadable, document.offset, reason)
    outermost = document.elements(document.roots)
    root = next((element for element in outermost if element.tag == "Plan"), None)
    if root is None:
        offset = outermost[0].start if outermost else 0
        reason = "no <Plan> at the outermost level, and the engine reads it without asking"
        return Crashed(SEGMENTATION_FAULT, offset, reason)
    if outermost[0] is not root:
        return _not_first(outermost[0], profile)
    found = check(document, root) if profile.checked else None
    if found is not None:
        return found
    return EnginePlan(profile.name, walk(document, root, profile, plan_id), root.index)


def _not_first(first: EngineElement, profile: Profile) -> Rejected | Crashed:
    """Another element stands before ``<Plan>``."""
    reason = f"<{first.tag}> stands before <Plan>"
    if profile.checked:
        return Rejected(_NO_PLAN, first.start, reason, ())
    # The first version says so and then goes on with no element at all.
    return Crashed(SEGMENTATION_FAULT, first.start, reason)
