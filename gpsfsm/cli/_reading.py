"""Plans that a command reads but does not judge: the errors of their texts are told."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.errors import GpsfsmError
from gpsfsm.streams import write_message

if TYPE_CHECKING:
    from gpsfsm.syntax import Limits, Parsed


def read_plan(path: str, limits: Limits, *, from_response: bool = False) -> Parsed:
    """Read the plan or behaviour tree in a file, in standard input for ``-``.

    Raises GpsfsmError.
    """
    from gpsfsm.compile.plan_text import read_plan as parse

    name, text = read_text(path, limits)
    return parse(text, file=name, limits=limits, from_response=from_response)


def read_text(path: str, limits: Limits) -> tuple[str, bytes]:
    """The name of a file, or of standard input for ``-``, and what is in it. Raises GpsfsmError."""
    from gpsfsm.checking.inputs import STDIN, Input, read_bytes

    stdin = path == "-"
    name = STDIN if stdin else path
    try:
        return name, read_bytes(Input(name, stdin=stdin), limits.max_bytes)
    except GpsfsmError as error:
        raise GpsfsmError(f"{name}: {error}") from error


def tell_errors(parsed: Parsed) -> int:
    """Write the errors of the text to standard error; the exit code that they stand for."""
    from gpsfsm.analysis.rules import rule
    from gpsfsm.model.finding import Severity
    from gpsfsm.model.report import PlanReport, Report, Verdict
    from gpsfsm.report import RenderOptions, render

    findings = [rule(problem.rule).finding_of(problem) for problem in parsed.problems]
    errors = tuple(found for found in findings if found.severity is Severity.ERROR)
    if not errors:
        return 0
    undecided = parsed.over_limit or parsed.lost
    verdict = Verdict.ERROR if undecided else Verdict.REJECT
    report = Report((PlanReport(parsed.file, verdict, None, errors),))
    write_message(render(report, options=RenderOptions(quiet=True)))
    return report.exit_code()
