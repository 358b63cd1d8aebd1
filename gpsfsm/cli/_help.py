"""The help of commands: sections of the list of commands, common options, all others by heading.

``--help`` shows the options that most people need, those that are ``common``; ``--help-all``
shows every option below the heading that the function declaring it has given it. A command names
its section where it is defined, so there is no list of commands to keep.
"""

from __future__ import annotations

import inspect
import re
from enum import Enum
from typing import TYPE_CHECKING, Any, TypeVar

import click

from gpsfsm.streams import to_stderr, write_text
from gpsfsm.version import REPOSITORY

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from click.shell_completion import CompletionItem

_F = TypeVar("_F", bound="Callable[..., Any] | click.Command")
DOCUMENTATION = f"{REPOSITORY}/blob/main/docs/cli.md"
OLD_OUTPUT = "--output-file"
"""What ``--output`` was called once; it still works, and no help shows it."""

ANY_PATH = click.Path(readable=False, allow_dash=True)  # reading says more than click
_COLUMN = 22
_OPTIONS = "Options"
_HELP_ALL = "--help-all"
_BOUNDS = re.compile(r"\s+\[[^];]*[<>][^];]*\]$|;[^];]*[<>][^];]*(?=\]$)")


class Section(Enum):
    """The section of ``gpsfsm --help`` in which a command stands, with its title."""

    CHECK = "Check and understand"
    MEND = "Mend"
    RUN = "Run"
    GENERATE = "Generate"
    SERVE = "Serve"
    MAINTAIN = "Maintain"


class Option(click.Option):
    """An option; ``--help`` shows those that most people need, ``--help-all`` all by heading."""

    def __init__(self, *args: Any, common: bool = False, **keywords: Any) -> None:
        """``common``: most people need it."""
        super().__init__(*args, **keywords)
        self.common, self.heading = common, _OPTIONS

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """As click does, without old names."""
        record = super().get_help_record(ctx)
        if record is None:
            return None
        names, text = record[0].replace(f", {OLD_OUTPUT}", ""), record[1]
        if not _wants_all(ctx):  # what the option does suffices: neither its opposite nor bounds
            names, text = names.partition(" / --no-")[0], _BOUNDS.sub("", text)
        return names, text


def declare(*names: str, **keywords: Any) -> Callable[[_F], _F]:
    """The decorator for an ``Option``."""
    return click.option(*names, cls=Option, **keywords)


def declare_file(*names: str, **keywords: Any) -> Callable[[_F], _F]:
    """The decorator for an option whose value is the path of a file."""
    return declare(*names, metavar="FILE", type=ANY_PATH, **keywords)


def put_below(heading: str, parameters: Iterable[click.Parameter]) -> None:
    """Put those options below this heading that have none yet."""
    for each in parameters:
        if isinstance(each, Option) and each.heading == _OPTIONS:
            each.heading = heading


class Command(click.Command):
    """A command with ``--help`` and ``--help-all``, in a section of ``gpsfsm --help``."""

    def __init__(
        self,
        *args: Any,
        section: Section = Section.MAINTAIN,
        aliases: Sequence[str] = (),
        **keywords: Any,
    ) -> None:
        r"""``aliases`` are names that no help shows; ``\b`` in a raw docstring is click's mark.

        Most commands state their exit codes; this adds those of the others.
        """
        super().__init__(*args, **keywords)
        self.section, self.aliases = section, aliases
        text = inspect.cleandoc(self.help or "").replace("\\b\n", "\b\n")
        if "Exit code:" not in text and not isinstance(self, click.Group):
            head, example, rest = text.partition("\n\n\b\nExample")
            text = f"{head}\n\nExit code: 0 done, 2 not possible.{example}{rest}"
        self.help = text

    def get_help_option_names(self, _ctx: click.Context) -> list[str]:
        """The names of the option that click makes, in any context; ``--help-all`` is another."""
        return ["-h", "--help"]

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """The parameters, with ``--help-all`` behind ``--help``."""
        return [*super().get_params(ctx), _HELP_ALL_OPTION]

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The options: all below their headings, or those that are common."""
        for title, records in self.option_records(ctx, every=_wants_all(ctx)):
            with formatter.section(title):
                formatter.write_dl(records, col_max=_COLUMN)
        if isinstance(self, click.Group):
            self.format_commands(ctx, formatter)

    def option_records(
        self, ctx: click.Context, *, every: bool
    ) -> Iterator[tuple[str, list[tuple[str, str]]]]:
        """The headings, each with its options and their help."""
        sections: dict[str, list[tuple[str, str]]] = {}
        for each in self._shown(ctx, every=every):
            record = each.get_help_record(ctx)
            if record is not None:
                heading = getattr(each, "heading", _OPTIONS) if every else _OPTIONS
                sections.setdefault(heading, []).append(record)
        yield from sections.items()

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """As click does, without old names."""
        items = super().shell_complete(ctx, incomplete)
        return [each for each in items if each.value != OLD_OUTPUT]

    def _shown(self, ctx: click.Context, *, every: bool) -> list[click.Parameter]:
        """The options to show; a command that declares none as common shows them all."""
        mine = [each for each in self.params if isinstance(each, click.Option)]
        common = [each for each in mine if getattr(each, "common", False)]
        chosen = mine if every or not common else common
        own = {id(each) for each in self.params}
        return [*chosen, *(each for each in self.get_params(ctx) if id(each) not in own)]

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """As click does, and a last line about where there is more."""
        super().format_epilog(ctx, formatter)
        formatter.write_paragraph()
        more = f"All options: {ctx.command_path} {_HELP_ALL}"
        formatter.write_text(f"\b\n{more}\nDocumentation: {DOCUMENTATION}")


class CommandGroup(Command, click.Group):
    """A command with commands of its own."""

    command_class = Command

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As click does, but the help is no message about an error."""
        if not args and not ctx.resilient_parsing:
            to_stderr(f"{ctx.get_help()}\n")
            ctx.exit(2)
        return super().parse_args(ctx, args)


def _wants_all(ctx: click.Context) -> bool:
    return bool(ctx.meta.get(_HELP_ALL))


def _show_all(ctx: click.Context, _: click.Parameter, value: bool) -> None:
    """Print the help with all options, and end."""
    if value and not ctx.resilient_parsing:
        ctx.meta[_HELP_ALL] = True
        write_text(f"{ctx.get_help()}\n")
        ctx.exit()


_HELP_ALL_OPTION = click.Option(
    [_HELP_ALL],
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_show_all,
    help="Show all options and exit.",
)


def complete_formats(_: click.Context, __: click.Parameter, incomplete: str) -> list[str]:
    """The formats of reports."""
    from gpsfsm.report import format_names

    return [name for name in format_names() if name.startswith(incomplete)]


def complete_rules(
    _: click.Context, parameter: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Codes and names of rules that begin like the last of the words between commas."""
    from click.shell_completion import CompletionItem

    from gpsfsm.analysis.rules import all_rules

    head, comma, last = incomplete.rpartition(",")
    names = [(word, rule.summary) for rule in all_rules() for word in (rule.code, rule.name)]
    if isinstance(parameter, click.Option):
        names += [("ALL", "all rules"), *_families(rule.code for rule in all_rules())]
    return [
        CompletionItem(f"{head}{comma}{word}", help=text)
        for word, text in names
        if word.lower().startswith(last.lower())
    ]


def _families(codes: Iterable[str]) -> list[tuple[str, str]]:
    """The prefixes that select all rules of a family."""
    return [(family, "all rules of this family") for family in sorted({code[:3] for code in codes})]
