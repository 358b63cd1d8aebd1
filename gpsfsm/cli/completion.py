"""``gpsfsm completion``: the script with which a shell completes command lines of gpsfsm."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from gpsfsm.cli._help import Command, Section, declare
from gpsfsm.errors import GpsfsmError
from gpsfsm.late import dataclass
from gpsfsm.streams import Form, to_stderr, write_bytes, write_text

if TYPE_CHECKING:
    from collections.abc import Mapping

_VARIABLE = "_GPSFSM_COMPLETE"


@dataclass(frozen=True)
class _Place:
    """The file in which a shell looks for the script, and what else it needs to see it."""

    variable: str  # of the environment: the folder of the user's data or configuration
    path: str
    next_step: str


_PLACES: Mapping[str, _Place] = {
    "bash": _Place(
        *("XDG_DATA_HOME", "bash-completion/completions/gpsfsm"),
        "It works in new shells if the package bash-completion is installed.",
    ),
    "zsh": _Place(
        *("XDG_DATA_HOME", "zsh/site-functions/_gpsfsm"),
        "zsh searches only its fpath. Unless it has the folder, add to ~/.zshrc, above compinit: "
        "fpath=({folder} $fpath)",
    ),
    "fish": _Place(*("XDG_CONFIG_HOME", "fish/completions/gpsfsm.fish"), "It works in new shells."),
}


@click.command(
    "completion", cls=Command, section=Section.MAINTAIN, short_help="Set up shell completion."
)
@click.argument("shell", type=click.Choice(tuple(_PLACES)))
@declare("--install", is_flag=True, help="Write the script to your own folder of completions.")
def command(shell: str, *, install: bool) -> int:
    r"""Print the completion script for a shell, or install it.

    It completes commands, options, their values, rule codes and file names. --install writes one
    file and edits no other: under $XDG_DATA_HOME (default: ~/.local/share) for bash and zsh, under
    $XDG_CONFIG_HOME (default: ~/.config) for fish.

    \b
    Examples:
      gpsfsm completion bash --install
      eval "$(gpsfsm completion zsh)"
    """
    script = _script(shell)
    if install:
        to_stderr(_install(script, _PLACES[shell]))
    else:
        write_text(script, form=Form.EXACT)
    return 0


def _script(shell: str) -> str:
    from click.shell_completion import ShellComplete, get_completion_class

    from gpsfsm.cli import group

    kind = get_completion_class(shell)
    assert kind is not None, shell
    # that of the base class: the one for bash starts a bash to see how old it is
    script = ShellComplete.source(kind(group, {}, "gpsfsm", _VARIABLE))
    # and that for fish cuts a word off at its first comma, of which lists of rules have many
    return script.replace('string split "," ', 'string split -m 1 "," ').rstrip("\n") + "\n"


def _install(script: str, place: _Place) -> str:
    """Write the script unless it is there, and say what was done."""
    from gpsfsm.checking.config import user_folder

    if (folder := user_folder(place.variable)) is None:
        raise GpsfsmError(f"there is no home folder; set {place.variable}")
    file = folder / place.path
    data = script.encode("utf-8")
    if file.is_file() and file.read_bytes() == data:
        done = "is up to date"
    else:
        done = "is replaced" if file.exists() else "is written"
        write_bytes(data, str(file), parents=True)
    return f"{file} {done}. {place.next_step.format(folder=file.parent)}\n"
