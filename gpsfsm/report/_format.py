"""What an output format is, and what it is told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.streams import Form

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.model.finding import Finding
    from gpsfsm.model.report import PlanReport, Report

__all__ = ["Format", "RenderOptions"]


@dataclass(frozen=True, slots=True)
class RenderOptions:
    """How to write a report; formats ignore what does not concern them.

    ``color``: with terminal colours. ``quiet``: findings only, one line each. ``statistics``: with
    a table of counts per rule. ``width``: columns of the terminal, None where there is none.
    ``version``: the version of gpsfsm that the report names, "" for none. ``correct``: the lines
    with which a finding of a plan would be mended, none if that is not known.
    """

    color: bool = False
    quiet: bool = False
    statistics: bool = False
    width: int | None = None
    version: str = ""
    correct: Callable[[PlanReport, Finding], Sequence[str]] | None = None


@dataclass(frozen=True, slots=True)
class Format:
    """An output format: its name on the command line, its one function, and how it is escaped.

    ``render`` returns the whole output, which ends with a line break unless it is empty, and which
    can be encoded as UTF-8 whatever the plan holds. ``form`` says how what terminals and servers
    would obey is escaped in it.
    """

    name: str
    render: Callable[[Report, RenderOptions], str]
    form: Form = Form.TEXT
