"""FlexBE: behaviours as Python that FlexBE generates → a machine. The source is never executed.

https://github.com/FlexBE/flexbe_behavior_engine. A behaviour that uses another one has it as one
state. Levels of autonomy and data are left out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.compile.formats import Format
from gpsfsm.compile.formats.python_source import Source

if TYPE_CHECKING:
    from gpsfsm.compile.machines import ReadMachine
    from gpsfsm.syntax.source import Limits


def recognises(begin: str, file: str) -> bool:
    """True for Python that imports FlexBE."""
    return file.endswith(".py") and "flexbe_core" in begin


def read(text: str, file: str, limits: Limits) -> ReadMachine:
    """The machine of a behaviour, or why it cannot be read."""
    del limits
    return Source(text).machine(file, "behaviour")


FORMAT = Format("flexbe", "FlexBE behaviours in Python", recognises, read)
