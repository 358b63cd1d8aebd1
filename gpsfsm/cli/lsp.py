"""``gpsfsm lsp``: the language server, for editors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._help import Command, Section
from gpsfsm.errors import UsageError, installing
from gpsfsm.streams import complain

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.checking import CheckOptions


@click.command(
    "lsp", cls=Command, section=Section.SERVE, short_help="Run the language server for editors."
)
def command() -> int:
    r"""Run the language server on standard input and output.

    Editors start it themselves; docs/editors.md explains how to set them up.
    It checks open documents like 'gpsfsm check', with the configuration of
    their folder.

    Exit code: 0 ended, 1 ended by an editor that has not announced it, 2 could not start.

    \b
    Example:
      gpsfsm lsp
    """
    try:
        from gpsfsm.lsp.server import serve
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] not in ("pygls", "lsprotocol"):
            raise
        raise UsageError(f"gpsfsm lsp needs pygls: {installing('lsp')}") from None
    return serve(_options_of, _unheard)


def _unheard() -> None:
    complain(
        "the language server started and has ended, because no editor sent anything on "
        "standard input"
    )


def _options_of(values: Mapping[str, Any]) -> CheckOptions:
    """The options of ``gpsfsm check`` where a configuration file has these values."""
    from gpsfsm.cli._options import CheckValues, build  # (loads the analyses)

    return build(CheckValues, values).options()
