"""Output formats: one module each, which defines ``FORMAT``; modules with ``_`` are helpers.

A format is found by the name of its module, so a new format is one new file. Other packages add
formats through the entry point group ``gpsfsm.formats``; they cannot replace a built-in one.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError, misused
from gpsfsm.late import dataclass
from gpsfsm.model.printable import printable
from gpsfsm.plugins import find_plugin
from gpsfsm.streams import Form, to_stderr
from gpsfsm.tracing import span

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from gpsfsm.model.finding import Finding
    from gpsfsm.model.report import PlanReport, Report
    from gpsfsm.syntax import Parsed

__all__ = ["Format", "RenderOptions", "find_format", "format_names", "render", "tell_errors"]

_GROUP = "gpsfsm.formats"
_ENDINGS = {"gv": "dot", "md": "markdown", "mmd": "mermaid"}
_FOREIGN = (
    *("csv", "htm", "html", "jpeg", "jpg", "json"),
    *("jsonl", "mcap", "pdf", "png", "svg"),
)
"""Endings of files in which nobody expects another format."""


@dataclass(frozen=True, slots=True)
class RenderOptions:
    """The options for formatting a report; formats ignore those that do not concern them.

    - ``color``: use terminal colours.
    - ``quiet``: only findings, one line each; ``verbose``: everything that is known about each
      finding.
    - ``statistics``: add a table of counts per rule.
    - ``width``: the columns of the terminal; None without a terminal.
    - ``version``: the version of gpsfsm that the report names; "" for none.
    - ``correct``: returns the lines that would fix a finding of a plan; empty if unknown.
    - ``good_enough``: a plan without errors counts as accepted.
    - ``mended``: the fixes that were applied before the check.
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
    """An output format.

    ``name`` is its name on the command line. ``render`` returns the whole output, which ends with a
    line break unless it is empty, and which must be encodable as UTF-8 for any plan. ``form``
    determines how characters that control terminals and servers are escaped in it.
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


def format_of(output_file: str, formats: Iterable[str]) -> str | None:
    """The one of the formats that the ending of a file names, or None.

    Raises UsageError for the ending of a picture, page or other format that none of them is.

    >>> format_of("plan.svg", ["tree", "svg"])
    'svg'
    """
    ending, choices = Path(output_file).suffix.lower().removeprefix("."), list(formats)
    names = [name for name in (ending, _ENDINGS.get(ending)) if name in choices]
    if ending in _FOREIGN and not names:
        page = "; for a page: gpsfsm view" if ending.startswith("htm") else ""
        raise UsageError(
            f"{printable(output_file)}: {ending} is none of the formats {', '.join(choices)}; "
            f"--format says which of them to write{page}"
        )
    return names[0] if names else None


def render(report: Report, name: str = "text", *, options: RenderOptions | None = None) -> str:
    """Format a report; ``name`` is the output format, such as ``text``, ``json`` or ``sarif``.

    Raises UsageError for an unknown format, or if ``report`` is not a ``Report``.
    """
    from gpsfsm.model.report import PlanReport, Report

    value: object = report
    if isinstance(value, PlanReport):
        raise misused("render", "a report", value, "gpsfsm.Report((it,)) is a report of one plan")
    if not isinstance(value, Report):
        raise misused("render", "a report", value, "gpsfsm.check makes one")
    if not isinstance(options, RenderOptions | None):
        raise misused("render", "a gpsfsm.report.RenderOptions as options", options)
    with span("gpsfsm.render"):
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
    verdict = Verdict.UNDECIDED if undecided else Verdict.REJECTED
    report = Report((PlanReport(parsed.file, verdict, None, errors),))
    to_stderr(render(report, options=RenderOptions(quiet=True)))
    return report.exit_code()


def _find_foreign(name: str) -> Format:
    """Look up a format of another package; only here, because that is slow."""
    foreign, offered = find_plugin(
        _GROUP, name, Format, noun="format", expected="gpsfsm.report.Format"
    )
    if foreign is not None:
        return Format(foreign.name, partial(_rendered, foreign), foreign.form)
    names = ", ".join((*format_names(), *offered))
    raise UsageError(f"there is no format '{name}'; the formats are: {names}")


def _rendered(foreign: Format, report: Report, options: RenderOptions) -> str:
    """The output of another package's format. Raises UsageError if that fails."""
    try:
        text: object = foreign.render(report, options)
    except MemoryError:
        raise
    except Exception as error:  # whatever the other package does wrong
        reason = f"{type(error).__name__}: {error}"
        raise UsageError(f"the format '{foreign.name}' failed: {reason}") from error
    if not isinstance(text, str):
        raise UsageError(f"the format '{foreign.name}' returned {type(text).__name__}, not text")
    return text
