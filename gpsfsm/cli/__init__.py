"""The command line: one module per command, which defines ``command``; ``_`` marks helpers.

A command is found by the name of its module, so a new command is one new file. Commands import
what they need when they run: ``gpsfsm --help`` loads no solver and no parser.

Exit codes of every command: 0 nothing found, 1 findings, 2 could not do it, or could not report
what it did, 130 interrupted.
"""

from __future__ import annotations

import difflib
import gc
import importlib
import os
import pkgutil
import shlex
import sys
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gpsfsm import __version__
from gpsfsm.cli._help import DOCUMENTATION, Section
from gpsfsm.errors import DEBUG_VARIABLE, GpsfsmError, InternalError, is_out_of_memory
from gpsfsm.streams import complain, give_up_stdout, losses, to_stderr

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

__all__ = ["main"]

_PACKAGE = "gpsfsm.cli"
_FAILED = 2
_INTERRUPTED = 130
_MEANT = {
    **dict.fromkeys(("analyse", "analyze", "lint", "validate", "verify"), "check"),
    **dict.fromkeys(("draw", "render", "visualise", "visualize"), "show"),
    **dict.fromkeys(("execute", "simulate"), "run"),
    **{"compare": "diff", "repair": "fix", "rules": "explain"},
}
_LOOKS = (50_000, 10, 20)  # for circles: new objects or looks between two of the three kinds


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line (default: that of this process) and return its exit code.

    The one place where errors become messages and exit codes. With ``GPSFSM_DEBUG=1`` in the
    environment, an unexpected error is raised on.
    """
    losses()  # of an earlier command in this process
    if arguments is None:  # the process is this command's: what it loads stays to its end
        gc.set_threshold(*_LOOKS)
    try:
        code = _main(arguments)
    finally:
        if arguments is None:
            gc.freeze()  # the interpreter need not look for circles before it ends
    if losses() and code != _INTERRUPTED:  # what it has done, nobody can know
        return _FAILED
    return code


def ros_sections(arguments: Sequence[str]) -> list[str]:
    """A command line in which each word of a ``--ros-args`` section is an option of its own.

    As in ROS 2, a section ends at ``--`` or where the line does.

    >>> ros_sections(["run", "--ros-args", "-r", "a:=b", "--", "a.xml"])
    ['run', '--ros-args=-r', '--ros-args=a:=b', 'a.xml']
    """
    words: list[str] = []
    within = False
    for each in arguments:
        if each == "--ros-args":
            within = True
        elif within and each == "--":
            within = False
        else:
            words.append(f"--ros-args={each}" if within else each)
    return words


def _main(arguments: Sequence[str] | None) -> int:
    try:
        words = ros_sections(sys.argv[1:] if arguments is None else arguments)
        code = group.main(words, prog_name="gpsfsm", standalone_mode=False)
    except click.ClickException as error:
        message = error.format_message()
        if isinstance(error, click.MissingParameter):  # click lists choices on lines of their own
            message = " ".join(message.split())
        complain(message, hint=_usage_hint(error))
    except (click.Abort, KeyboardInterrupt):
        ledger = sys.modules.get("gpsfsm.ros.ledger")  # of a process that drives a robot
        return ledger.IN_DOUBT if ledger and ledger.doubts(complain) else _INTERRUPTED
    except InternalError as error:
        complain(str(error), hint=_please_report())
    except GpsfsmError as error:
        complain(str(error))
    except OSError as error:
        give_up_stdout()
        complain(str(error))
    except Exception as error:
        if is_out_of_memory(error):
            complain("the memory has run out", hint="allow more memory, or take a smaller plan")
            return _FAILED
        if os.environ.get(DEBUG_VARIABLE):
            raise
        complain(f"unexpected {type(error).__name__}: {error}", hint=_please_report())
    else:
        return code if isinstance(code, int) else 0
    return _FAILED


def _please_report() -> str:
    return (
        f"This is a defect of gpsfsm {__version__}, please report it. "
        f"{DEBUG_VARIABLE}=1 in the environment shows where it comes from."
    )


def _usage_hint(error: click.ClickException) -> str:
    context = error.ctx if isinstance(error, click.UsageError) else None
    if context is None:
        return ""
    what = "lists the commands" if isinstance(context.command, click.Group) else "shows its options"
    return f"'{context.command_path} --help' {what}."


class Commands(click.Group):
    """Finds commands by the names of the modules beside this one."""

    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:
        """As click does, which shows --help and --version here."""
        with _until_the_reader_leaves():
            return super().make_context(*args, **kwargs)

    def invoke(self, ctx: click.Context) -> Any:
        """As click does, which shows the help of a command here."""
        with _until_the_reader_leaves():
            return super().invoke(ctx)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The names of all commands."""
        return [name for name in _module_names() if self.get_command(ctx, name) is not None]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of this name or alias, or None."""
        if cmd_name not in _module_names():
            commands = (self.get_command(ctx, name) for name in _module_names())
            return next(
                (each for each in commands if cmd_name in getattr(each, "aliases", ())), None
            )
        module = importlib.import_module(f"{_PACKAGE}.{cmd_name.replace('-', '_')}")
        command = getattr(module, "command", None)
        return command if isinstance(command, click.Command) else None

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The commands by section, without the two options and blank lines: it fits a screen."""
        formatter.write_paragraph()
        commands = [self.get_command(ctx, name) for name in self.list_commands(ctx)]
        for section in Section:
            records = [
                (str(each.name), each.get_short_help_str(limit=100))
                for each in commands
                if each is not None and getattr(each, "section", None) is section
            ]
            formatter.write(f"{section.value}:\n")
            with formatter.indentation():
                formatter.write_dl([(f"{name:12}", text) for name, text in records])

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click does, but with a word on what may be meant."""
        name = args[0]
        command = None if name.startswith("-") else self.get_command(ctx, name)
        if command is not None:
            return command.name, command, args[1:]
        if name.startswith("-"):
            return super().resolve_command(ctx, args)
        raise click.UsageError(
            f"there is no command '{name}'; {self._meant(ctx, name, args[1:])}", ctx
        )

    def _meant(self, ctx: click.Context, name: str, others: Sequence[str]) -> str:
        """A hint about what a word that is no command was meant to be."""
        names = self.list_commands(ctx)
        near = [_MEANT[name]] if name in _MEANT else []
        near = near or difflib.get_close_matches(name, [*names, "help", "version"], n=1)
        if name == "man" or near == ["help"]:
            topic = next((each for each in others if each in names), "COMMAND")
            return f"for help: gpsfsm {topic} --help"
        if near == ["version"]:
            return "for the version: gpsfsm --version"
        if name.endswith((".xml", ".json")) or Path(name).exists():
            return f"to check a plan: gpsfsm check {shlex.join([name, *others])}"
        if near:
            return f"did you mean: gpsfsm {shlex.join([*near, *others])}"
        if name.upper().startswith("GP") and name[2:].isdigit():
            return f"to explain a rule: gpsfsm explain {name.upper()}"
        return f"the commands are {', '.join(names)}"


@contextmanager
def _until_the_reader_leaves() -> Iterator[None]:
    """``gpsfsm --help | head`` is no failure, whatever click thinks of it."""
    try:
        yield
    except BrokenPipeError:
        give_up_stdout()
        raise click.exceptions.Exit(0) from None


@cache
def _module_names() -> tuple[str, ...]:
    modules = pkgutil.iter_modules([str(Path(__file__).parent)])
    return tuple(
        sorted(
            module.name.replace("_", "-") for module in modules if not module.name.startswith("_")
        )
    )


@click.group(
    cls=Commands,
    invoke_without_command=True,
    context_settings={
        "help_option_names": ["-h", "--help", "--help-all"],
        "max_content_width": 100,
    },
    epilog="\b\nOptions: gpsfsm --version; gpsfsm COMMAND --help (the common ones), --help-all\n"
    f"Documentation: {DOCUMENTATION}",
)
@click.version_option(__version__, "-v", "-V", "--version", message="gpsfsm %(version)s")
@click.pass_context
def group(context: click.Context) -> None:
    """Check robot plans formally before they run, as in 'gpsfsm check plan.xml'."""
    if context.invoked_subcommand is None:
        to_stderr(f"{context.get_help()}\n")
        context.exit(_FAILED)
