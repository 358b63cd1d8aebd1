"""``gpsfsm lsp``: the language server, for editors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from gpsfsm.errors import UsageError
from gpsfsm.streams import complain

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.checking import CheckOptions


@click.command("lsp", short_help="Be a language server, for editors.")
def COMMAND() -> int:  # noqa: N802  (it is an object)
    """Talk to an editor in the Language Server Protocol, on standard input and output.

    \b
    Editors start it themselves; docs/editors.md tells how to set them up.
    It checks what is open as 'gpsfsm check' does, with the configuration of its folder.

    \b
    Example:
      gpsfsm lsp
    """  # noqa: D301  (click wants the \b)
    try:
        from gpsfsm.lsp.server import serve
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] not in ("pygls", "lsprotocol"):
            raise
        raise UsageError("gpsfsm lsp needs pygls: pip install 'gpsfsm[lsp]'") from None
    return serve(_options_of, _unheard)


def _unheard() -> None:
    complain(
        "the language server could be started, and has ended: no editor has said anything on "
        "standard input"
    )


def _options_of(values: Mapping[str, Any]) -> CheckOptions:
    """The options of ``gpsfsm check`` where a configuration file has these values."""
    from gpsfsm.cli._options import CheckValues, build  # (loads the analyses)

    return build(CheckValues, values).options()
