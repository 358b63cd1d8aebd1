"""``gpsfsm lsp``: the language server, for editors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._streams import complain
from gpsfsm.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.checking import CheckOptions

__all__ = ["COMMAND"]


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
        from gpsfsm.lsp.server import serve  # noqa: PLC0415  (loads what the extra brings)
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
    from gpsfsm.cli._check_options import check_options_of  # noqa: PLC0415  (loads the analyses)
    from gpsfsm.cli.check import COMMAND as CHECK  # noqa: PLC0415

    context = CHECK.make_context("check", ["-"])
    return check_options_of({**context.params, **values})
