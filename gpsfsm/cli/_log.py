"""The options of the log, for commands that run until somebody ends them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from gpsfsm.cli._help import declare
from gpsfsm.cli._options import Values, apply
from gpsfsm.late import dataclass
from gpsfsm.logs import FORMATS, LEVELS, Format, Level


@dataclass(frozen=True, kw_only=True)
class LogValues(Values):
    """The values of these options."""

    log_level: Level
    log_format: Format


def log_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about what goes to standard error, and in which form."""
    return apply(
        (
            declare(
                "--log-level",
                type=click.Choice(LEVELS),
                default="info",
                show_default=True,
                help="Least important level to log.",
            ),
            declare(
                "--log-format",
                type=click.Choice(FORMATS),
                default="text",
                show_default=True,
                help="Format of the log on standard error; json: one object per line.",
            ),
        ),
        command,
        "Log",
    )
