"""Output formats: one module each, which defines ``FORMAT``; modules with ``_`` are helpers.

A format is found by the name of its module, so a new format is one new file. Other packages add
formats through the entry point group ``gpsfsm.formats``; they cannot replace a built-in one.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError, misused
from gpsfsm.late import dataclass
from gpsfsm.plugins import find_plugin
from gpsfsm.streams import Form, write_message

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.model.finding import Finding
    from gpsfsm.model.report import PlanReport, Report
    from gpsfsm.syntax import Parsed

__all__ = ["Format", "RenderOptions", "find_format", "format_names", "render", "tell_errors"]

_GROUP = "gpsfsm.formats"


@dataclass(frozen=True, slots=True)
class RenderOptions:
    """The options of writing a report; formats ignore what does not concern them.

    ``color``: with terminal colours. ``quiet``: findings only, one line each. ``verbose``: all that
    is known of each finding. ``statistics``: with a table of counts per rule. ``width``: columns of
    the terminal, None where there is none. ``version``: the version of gpsfsm that the report
    names, "" for none. ``correct``: the lines with which a finding of a plan would be mended, none
    if that is not known. ``good_enough``: a plan without errors is accepted. ``mended``: the
    repairs that were made before the check.
    """

    color: bool = False
    quiet: bool = False
    verbose: bool = False
    statistics: bool = False
    width: int | None = None
    version: str = ""
    correct: Callable[[PlanReport, Finding], Sequence[str]] | None = None
    good_enough: bool = True
    mended: tuple[str, ...] = ()


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


@cache
def format_names() -> tuple[str, ...]:
    """Return the names of the built-in formats, ``text`` first; imports none of them."""
    modules = (module.name for module in pkgutil.iter_modules(__path__))
    names = (name for name in modules if not name.startswith("_"))
    return tuple(sorted(names, key=lambda name: (name != "text", name)))


def find_format(name: str) -> Format:
    """Return the format of this name; raises UsageError if there is none."""
    if name in format_names():
        built_in: Format = importlib.import_module(f"{__name__}.{name}").FORMAT
        return built_in
    return _find_foreign(name)


def render(report: Report, name: str = "text", *, options: RenderOptions | None = None) -> str:
    """Write the report in the format of this name. Raises UsageError for what is no report."""
    from gpsfsm.model.report import PlanReport, Report

    value: object = report
    if isinstance(value, PlanReport):
        raise misused("render", "a report", value, "gpsfsm.Report((it,)) is a report of one plan")
    if not isinstance(value, Report):
        raise misused("render", "a report", value, "gpsfsm.check makes one")
    if not isinstance(options, RenderOptions | None):
        raise misused("render", "a gpsfsm.report.RenderOptions as options", options)
    return find_format(name).render(report, options or RenderOptions())


def tell_errors(parsed: Parsed) -> int:
    """Write the errors of a text to standard error; the exit code that they stand for."""
    from gpsfsm.analysis.rules import rule
    from gpsfsm.model.finding import Severity
    from gpsfsm.model.report import PlanReport, Report, Verdict

    findings = (rule(problem.rule).finding_of(problem) for problem in parsed.problems)
    errors = tuple(each for each in findings if each.severity is Severity.ERROR)
    if not errors:
        return 0
    undecided = parsed.over_limit or parsed.lost
    verdict = Verdict.ERROR if undecided else Verdict.REJECT
    report = Report((PlanReport(parsed.file, verdict, None, errors),))
    write_message(render(report, options=RenderOptions(quiet=True)))
    return report.exit_code()


def _find_foreign(name: str) -> Format:
    """Look up a format of another package; only here, because that is slow."""
    foreign, offered = find_plugin(
        _GROUP, name, Format, noun="format", expected="gpsfsm.report.Format"
    )
    if foreign is not None:
        return foreign
    names = ", ".join((*format_names(), *offered))
    raise UsageError(f"there is no format '{name}'; the formats are: {names}")
