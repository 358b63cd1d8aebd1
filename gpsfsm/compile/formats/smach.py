"""SMACH: state machines built in Python → a machine. The source is never executed.

https://github.com/ros/executive_smach. Data (userdata, remapping) is left out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.compile.formats import Format
from gpsfsm.compile.formats.python_source import Source

if TYPE_CHECKING:
    from gpsfsm.compile.machines import ReadMachine
    from gpsfsm.syntax.source import Limits


def recognises(begin: str, file: str) -> bool:
    """True for Python that names SMACH at its beginning."""
    return file.endswith(".py") and "smach" in begin.lower()


def read(text: str, file: str, limits: Limits) -> ReadMachine:
    """The outermost machine of a file, or why it cannot be read."""
    del limits
    return Source(text).machine(file, "state machine")


FORMAT = Format("smach", "SMACH state machines in Python", recognises, read)
