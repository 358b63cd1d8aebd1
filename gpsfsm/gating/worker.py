"""The worker of the gate: a process that decides and that can be killed.

It is told the options once, and then gets plans; what is printed goes nowhere.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import UsageError
from gpsfsm.gating.deciding import gate_text
from gpsfsm.gating.told import options_of
from gpsfsm.gating.wire import encode
from gpsfsm.workers.line import Line
from gpsfsm.workers.memory import limit_memory

if TYPE_CHECKING:
    from gpsfsm.gating.verdicts import GateOptions

__all__ = ["MISUSE", "READY", "VERDICT", "main"]

READY, VERDICT, MISUSE = "ready", "verdict", "misuse"
"""What a message is; VERDICT has the verdict as its bytes, MISUSE says what is ``wrong``."""

_WARM = b"""<Plan><Control type="parallel_all"><Runner interface="a/A" provider="a/A"/>
<Runner interface="a/B" provider="a/B"/></Control></Plan>"""


def main() -> None:
    """Decide until the gate ends; then end as well, whatever is being decided."""
    line = Line()
    head, written = line.messages.get()
    with suppress(OSError, ValueError):
        limit_memory(head["memory_mb"])
    options = options_of(written)
    _decided(_WARM, "", options)  # loads what it takes
    line.say({"is": READY})
    while True:
        head, text = line.messages.get()
        line.say(*_decided(text, head["name"], options))


def _decided(text: bytes, name: str, options: GateOptions) -> tuple[dict[str, Any], bytes]:
    try:
        return {"is": VERDICT}, encode(gate_text(text, name, options))
    except UsageError as error:
        return {"is": MISUSE, "wrong": str(error)}, b""
