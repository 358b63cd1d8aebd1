"""Options of commands, their values with those of configuration files, and what settings take away.

A command gets a frozen object of its options: a class below ``Values`` with a field for each, built
by ``read_values`` out of what click has understood and what the configuration files say.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias, TypeVar

import click
from click.core import ParameterSource

from gpsfsm.checking.config import narrowing
from gpsfsm.checking.option_table import BY_NAME, NO_EFFECT, OPTIONS, Group, Kind, group
from gpsfsm.cli._help import (
    ANY_PATH,
    OLD_OUTPUT,
    complete_formats,
    complete_rules,
    declare,
    declare_file,
    put_below,
)
from gpsfsm.late import dataclass
from gpsfsm.model.finding import Severity
from gpsfsm.model.story import PAPER_ENGINE
from gpsfsm.streams import STDOUT, complain

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from gpsfsm.api import CheckSettings
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.checking import CheckOptions
    from gpsfsm.checking.config import Config
    from gpsfsm.checking.option_table import Option
    from gpsfsm.model.report import Report, SettingUsed
    from gpsfsm.syntax import Limits

_Command = TypeVar("_Command", bound=Callable[..., Any])
Decorator: TypeAlias = Callable[[Callable[..., Any]], Callable[..., Any]]

_V = TypeVar("_V", bound="Values")

LIMITS = tuple(option.name for option in group(Group.LIMIT))
"""The limits on what is read."""

CONFIGURED = "configured"
"""Where the values of options say which of them a configuration file has set, and which one."""

_ELSEWHERE = frozenset({"config", "isolated"})
"""Options that ``read_values`` itself obeys."""

_FORMATS = ("format", "output_format", "table")

_ADDED = "Folder of capability files; may be repeated."


# --- the values of options ------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Values:
    """The values of a command's options, a field for each; classes below add the fields.

    ``configured`` says which of them a configuration file has set, and which file;
    ``elsewhere`` names options that something else reads out of the context.
    """

    configured: Mapping[str, str] = field(default_factory=dict)
    elsewhere: ClassVar[frozenset[str]] = frozenset()


@dataclass(frozen=True, kw_only=True)
class LimitValues(Values):
    """The limits on what is read; None stands for the default."""

    max_bytes: int | None = None
    max_depth: int | None = None
    max_elements: int | None = None
    max_attributes: int | None = None
    max_attribute_length: int | None = None

    @property
    def limits(self) -> Limits:
        """The limits, with their defaults."""
        from gpsfsm.syntax import Limits  # (loads the front end)

        chosen = {name: getattr(self, name) for name in LIMITS}
        return Limits(**{name: value for name, value in chosen.items() if value is not None})


@dataclass(frozen=True, kw_only=True)
class LibraryValues(Values):
    """The options about capabilities."""

    capabilities: Sequence[str] = ()
    builtin_capabilities: bool = True
    robot: str | None = None

    @property
    def library(self) -> Capabilities:
        """The capabilities that are chosen; reads their files. Raises ConfigError."""
        from gpsfsm.capabilities.library import choose_capabilities

        return choose_capabilities(
            self.capabilities, builtin=self.builtin_capabilities, robot=self.robot
        )


@dataclass(frozen=True, kw_only=True)
class CheckValues(LimitValues, LibraryValues):
    """The options of the table that say how plans are checked."""

    select: Sequence[str] = ()
    ignore: Sequence[str] = ()
    assume: Sequence[str] = ()
    consistent: bool = False
    faults: Sequence[str] = ()
    from_response: bool = False
    deadline: float | None = None
    energy_limit: float | None = None
    tolerate: int | None = None
    solver: str = "auto"
    rlimit: int | None = None
    total_rlimit: int | None = None
    max_scenarios: int | None = None
    require_proof: bool = False
    engine: str = PAPER_ENGINE

    def settings(self) -> CheckSettings:
        """The same as the functions in Python take it."""
        from gpsfsm.api import CheckSettings  # (loads the analyses)

        keywords: dict[str, Any] = {}
        for option in BY_NAME.values():
            value = getattr(self, option.name) if option.keyword else None
            if value is not None:
                keywords[option.keyword] = words(value) if option.kind is Kind.CODES else value
        return CheckSettings(limits=self.limits, **keywords)

    def options(self) -> CheckOptions:
        """The options of a check. Raises UsageError for those that make no sense."""
        options = self.settings().options()
        return replace(options, named=options.named.difference(self.configured))


@dataclass(frozen=True, kw_only=True)
class FailValues(Values):
    """The options that say which findings make the exit code 1."""

    fail_on: str = "error"
    allow_suppressions: bool = False


def build(kind: type[_V], values: Mapping[str, Any]) -> _V:
    """An object of a class of values; what it has no field for is left out."""
    names = {each.name for each in fields(kind)}
    return kind(**{name: value for name, value in values.items() if name in names})


def read_values(
    context: click.Context,
    kind: type[_V],
    only: Iterable[str] | None = None,
    *,
    named: bool = False,
) -> _V:
    """The values of all options of a command: of the command line, else of a file, else defaults.

    ``only`` names the options that a configuration file may set (None: all); with ``named`` only
    one that the command line names is read. Raises ConfigError.
    """
    values = dict(context.params)
    if "config" in values:
        values = settle_named(context, only or ()) if named else settle(context, only)
    if values.get("output_file") not in (None, STDOUT):
        values |= _format_by_name(context, values)
    lacking = values.keys() - {each.name for each in fields(kind)} - _ELSEWHERE - kind.elsewhere
    assert not lacking, f"{kind.__qualname__} has no field for {sorted(lacking)}"
    return build(kind, values)


def _format_by_name(context: click.Context, values: Mapping[str, Any]) -> dict[str, str]:
    """The format that the name of the output file says, if no option and no setting says one."""
    from gpsfsm.report import format_names, format_of

    formats: dict[str, str] = {}
    if values.get("diff") is True or values.get("show"):  # these have a form of their own
        return formats
    for each in context.command.params:
        name = each.name or ""
        if name not in _FORMATS or name in values.get(CONFIGURED, ()):
            continue
        if context.get_parameter_source(name) is ParameterSource.DEFAULT:
            choices = getattr(each.type, "choices", None) or format_names()
            formats[name] = format_of(values["output_file"], choices) or values[name]
    return formats


# --- options of the table -------------------------------------------------------------------------


class NumberRange(click.FloatRange):
    """A range of finite numbers. click's own lets NaN pass, which is beyond no bound."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """The number that a text is. Raises BadParameter."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{number} is not a finite number", param, ctx)
        return number


def option(name: str, short: str = "", **changes: Any) -> Decorator:
    """An option of the table; ``changes`` are for a command that says it in other words."""
    entry = BY_NAME[name]
    flag, more = entry.flag, _click_words(entry)
    if entry.kind is Kind.FLAG:
        flag = f"{flag}/--no-{flag.removeprefix('--')}"
    words = {**more, "help": entry.help, "common": entry.common, **changes}

    def decorate(command: _Command) -> _Command:
        return apply([declare(*filter(None, (short, flag)), **words)], command, entry.group.value)

    return decorate


def _click_words(entry: Option) -> dict[str, Any]:
    """The keywords of ``click.option`` for an option, but for its help."""
    keywords: dict[str, Any] = {}
    if entry.metavar is not None:
        keywords["metavar"] = entry.metavar
    if entry.kind.is_list:
        keywords["multiple"] = True
        if entry.name in ("select", "ignore"):
            keywords["shell_complete"] = complete_rules
    elif entry.default is not None and entry.default is not False:
        keywords["default"] = entry.default
    if entry.name == "format":
        keywords["shell_complete"] = complete_formats
    if entry.kind is Kind.CHOICE:
        keywords |= {"type": click.Choice(entry.choices), "show_default": True}
    elif entry.kind is Kind.COUNT:
        keywords["type"] = click.IntRange(entry.least, entry.most)
    elif entry.kind is Kind.AMOUNT:
        keywords["type"] = float  # what is wrong with one is said by the options of the analysis
    elif entry.kind in (Kind.FILE, Kind.FOLDERS):
        keywords["type"] = ANY_PATH
    return keywords


def _declares(*names: str) -> Callable[[_Command], _Command]:
    """Declare options of the table, in this order."""

    def decorate(command: _Command) -> _Command:
        return apply([option(name) for name in names], command)

    return decorate


library_options = _declares("capabilities", "builtin_capabilities", "robot")
"""What is known of the robot's runners."""

capability_options = _declares(
    "capabilities", "builtin_capabilities", "robot", "deadline", "energy_limit"
)
"""What is known of the robot, and what a run may take."""

selection_options = _declares("select", "ignore", "fail_on", "allow_suppressions")
"""Which findings count."""

scenario_options = _declares("assume", "consistent", "faults", "from_response")
"""What is read and what may happen."""

effort_options = _declares("solver", "rlimit", "total_rlimit", "max_scenarios")
"""How to decide, and how much to do."""

response_option = _declares("from_response")
engine_option = _declares("engine")
limit_options = _declares(*LIMITS)
"""The limits on what is read."""


def idle_options(command_name: str) -> Callable[[_Command], _Command]:
    """The options of a check that a command cannot honour: each says so, and what to do."""

    def decorate(command: _Command) -> _Command:
        return apply([_idle(command_name, name) for name in NO_EFFECT[command_name]], command)

    return decorate


def _idle(command_name: str, name: str) -> Decorator:
    def refuse(context: click.Context, *_: object) -> None:
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            why = NO_EFFECT[command_name][name]
            raise click.UsageError(
                f"{BY_NAME[name].flag} has no effect on {command_name}: {why}", context
            )

    return option(name, hidden=True, expose_value=False, callback=refuse)


# --- other options that several commands share ----------------------------------------------------


def apply(options: Sequence[Decorator], command: _Command, heading: str = "") -> _Command:
    """The command with these options; help lists them in this order, above those it has.

    ``heading`` is for those that have none of their own.
    """
    for option in reversed(options):
        command = option(command)  # type: ignore[assignment]  # click gives the command back
    if heading:
        put_below(heading, getattr(command, "__click_params__", [])[-len(options) :])
    return command


def format_option(*formats: str, text: str) -> Decorator:
    """``--format`` as ``output_format``; the first of the formats is the default."""
    return declare(
        "--format",
        "output_format",
        type=click.Choice(formats),
        default=formats[0],
        show_default=True,
        common=True,
        help=text,
    )


def output_option(
    text: str = "Write to this file; - is standard output.", *, default: str | None = STDOUT
) -> Decorator:
    """``-o``, ``--output`` and its old name, as ``output_file``."""
    return declare(
        *("-o", "--output", OLD_OUTPUT, "output_file"),
        common=True,
        default=default,
        metavar="FILE",
        type=ANY_PATH,
        help=text,
    )


def field_option() -> Decorator:
    """``--field``: where the answer is in a line of JSON."""
    text = "Field of JSON lines that holds the answer; a.b is b inside a. [default: detected]"
    return declare("--field", metavar="NAME", help=text)


def folders_option(name: str, *, text: str = _ADDED) -> Decorator:
    """``--capabilities``: folders of capability files, as ``name``."""
    return declare("--capabilities", name, multiple=True, metavar="DIR", type=ANY_PATH, help=text)


# --- configuration files -------------------------------------------------------------------------


def config_options(command: _Command) -> _Command:
    """``--config`` and ``--isolated``."""
    isolated = declare(
        "--isolated", is_flag=True, help="Read no configuration file, not even your user file."
    )
    config = declare_file(
        "--config",
        help="Use this configuration file instead of searching for one.",
    )
    return apply((config, isolated), command, "Configuration")


def settle(context: click.Context, only: Iterable[str] | None = None) -> dict[str, Any]:
    """The values of all options: the command line's, else a configuration file's, else defaults.

    ``only`` names the options that a file may set. Raises ConfigError.
    """
    values = dict(context.params)
    file, isolated = values.pop("config"), values.pop("isolated")
    if isolated and file is not None:
        raise click.UsageError("--config and --isolated cannot be used together", context)
    _take(context, values, configs(file, isolated=isolated), only)
    return values


def settle_named(context: click.Context, only: Iterable[str]) -> dict[str, Any]:
    """The values of all options for a command that decides what may run.

    A configuration file counts only if the command line names it: the author of a plan may be the
    author of the files around it, and is no judge. Raises ConfigError.
    """
    values = dict(context.params)
    file, isolated = values.pop("config"), values.pop("isolated", False)
    if isolated and file is not None:
        raise click.UsageError("--config and --isolated cannot be used together", context)
    from gpsfsm.checking.config import load_config

    _take(context, values, [] if file is None else [load_config(file)], only)
    return values


def configs(file: str | None, *, isolated: bool = False) -> list[Config]:
    """The configuration files that hold: that of the project, or ``file``, then the user's own."""
    from gpsfsm.checking.config import find_config, load_config, load_user_config

    if isolated:
        return []
    first = find_config() if file is None else load_config(file)
    return [first] if first.own else [first, load_user_config()]


def _take(
    context: click.Context,
    values: dict[str, Any],
    files: Sequence[Config],
    only: Iterable[str] | None,
) -> None:
    """Give options the settings of the first file that has them, if the command line has none.

    ``values[CONFIGURED]`` says of each of these in which file it stands.
    """
    allowed = None if only is None else frozenset(only)
    places: dict[str, str] = {}
    for each in _with_profile(values, files):
        for name, value in each.values.items():
            by_default = context.get_parameter_source(name) is ParameterSource.DEFAULT
            if by_default and name not in places and (allowed is None or name in allowed):
                values[name], places[name] = value, each.file
    values[CONFIGURED] = places


def _with_profile(values: Mapping[str, Any], files: Sequence[Config]) -> Iterator[Config]:
    """The files, and at last the settings of the robot's profile, wherever it is named."""
    yield from files
    if values.get("robot") is not None:
        from gpsfsm.checking.config import profile_settings

        yield profile_settings(values["robot"])


def words(texts: Iterable[str]) -> tuple[str, ...]:
    """``("GP1,GP2", "GP3")`` → ``("GP1", "GP2", "GP3")``.

    A text without any word stays, to be refused as such: it must not read as "no choice".
    """
    result: list[str] = []
    for text in texts:
        result += [word.strip() for word in text.split(",") if word.strip()] or [text]
    return tuple(result)


class _Jobs(click.ParamType):  # type: ignore[type-arg]  # older releases of click take none
    """A number of processes, or ray with or without an address."""

    name = "jobs"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> int | str:
        """A number, or the name of a cluster."""
        text = str(value)
        if text.lstrip("+-").isdigit():
            number: int = click.IntRange(0, BY_NAME["jobs"].most).convert(value, param, ctx)
            return number
        from gpsfsm.errors import UsageError
        from gpsfsm.workers import jobs_of

        try:
            return jobs_of(text)
        except UsageError as error:
            self.fail(str(error), param, ctx)


def jobs_option(verb: str) -> Decorator:
    """``--jobs`` as ``jobs``, a number or a text; ``verb`` is what is done, such as "Check"."""
    return option("jobs", "-j", type=_Jobs(), help=BY_NAME["jobs"].help.format(verb=verb))


SETTINGS = tuple(
    option.name
    for option in OPTIONS
    if option.group is not Group.OUTPUT and option.name != "allow_suppressions"
)
"""The settings of a configuration file that say how plans are checked."""


def exit_code(values: FailValues, report: Report) -> int:
    """The exit code for a report; that comments alone make it 1 is told on standard error."""
    fail_on = severity_of(values.fail_on)
    excused = report.exit_code(fail_on, allow_suppressions=True)
    if values.allow_suppressions:
        return excused
    code = report.exit_code(fail_on)
    if code != excused:
        complain("comments in plans do not suppress findings; --allow-suppressions changes that")
    return code


def tell_narrowing(values: Values) -> None:
    """Tell on standard error under which settings of files less is decided than everything."""
    tell_settings(tuple(narrowing(values)))


def tell_settings(used: Sequence[SettingUsed]) -> None:
    """Tell on standard error what settings take away."""
    from gpsfsm.report._words import setting_line

    for each in used:
        complain(setting_line(each))


def severity_of(fail_on: str) -> Severity | None:
    return None if fail_on == "never" else Severity(fail_on)
