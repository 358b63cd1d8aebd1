"""The gate: may this plan run? It fails closed: whatever is not sure to be right is refused.

``gate_text`` decides in this process; ``Gate`` lets a process decide that is killed when the time
is up; ``gpsfsm.gate`` is the one call for one plan. ``gpsfsm gate`` and the service use these.
Names are looked up when they are needed, so that a process can be started before the rest loads.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gpsfsm.gating.deciding import (
        Basis,
        Digests,
        GateOptions,
        Reason,
        Verdict,
        gate_text,
        refusal,
    )
    from gpsfsm.gating.gate_call import gate
    from gpsfsm.gating.gate_process import Gate

__all__ = [
    "Basis",
    "Digests",
    "Gate",
    "GateOptions",
    "Reason",
    "Verdict",
    "gate",
    "gate_text",
    "refusal",
]

_HOMES = {
    "gate_process": ("Gate",),
    "gate_call": ("gate",),
    "deciding": (
        *("gate_text", "refusal"),
        *("Basis", "Digests", "GateOptions", "Reason", "Verdict"),
    ),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
