"""Plans rewritten so that an original engine runs them as the paper specifies (docs/port.md)."""

from __future__ import annotations

from gpsfsm.porting.porter import port
from gpsfsm.porting.reading import UnclearError
from gpsfsm.porting.result import Change, Loss, Note, Ported

__all__ = ["Change", "Loss", "Note", "Ported", "UnclearError", "port"]
