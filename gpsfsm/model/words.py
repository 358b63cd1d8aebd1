"""How a runner of a plan is named in messages."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gpsfsm.model.plan import Attribute, Element

__all__ = ["action", "brief"]

_MAX_PARAMETERS = 3
_MAX_TEXT = 28
_TELLING = ("x", "y", "text", "prompt", "task", "target")


def action(runner: Element) -> str:
    """What a runner does: ``WaypointRunner (x=1.0, y=3.0)``."""
    name = runner.interface.rsplit("/", 1)[-1] or "a runner without interface"
    known = sorted(runner.attributes, key=_interest)  # stable: else in document order
    parameters = runner.parameters
    given = [
        f"{attribute.name}={brief(attribute.text)}"
        for attribute in known
        if attribute.name in parameters
    ]
    more = ["…"] if len(given) > _MAX_PARAMETERS else []
    return f"{name} ({', '.join([*given[:_MAX_PARAMETERS], *more])})" if given else name


def _interest(attribute: Attribute) -> int:
    """What tells runners apart comes first, switches come last."""
    if attribute.name in _TELLING:
        return 0
    return 2 if isinstance(attribute.value, bool) else 1


def brief(text: str) -> str:
    """The beginning of a text, in one line."""
    text = " ".join(text.split())
    return text if len(text) <= _MAX_TEXT else text[: _MAX_TEXT - 1] + "…"
