"""``gpsfsm gate``: decide whether plans may run, and refuse in case of doubt."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._gating import GateValues, reach_options, settled, strictness_options, task_option
from gpsfsm.cli._help import ANY_PATH, Command, Section, declare
from gpsfsm.cli._options import (
    apply,
    capability_options,
    effort_options,
    engine_option,
    field_option,
    limit_options,
    option,
    output_option,
    scenario_options,
)
from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.late import dataclass
from gpsfsm.streams import append_text, check_writable, complain, write_private, write_text

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.checking.inputs import Input
    from gpsfsm.gating import Gate, Verdict
    from gpsfsm.workers.child_process import ChildProcess

_NO_PATH = """no plan is given, so none can be accepted; name a file, a folder, or -. Example:
  gpsfsm gate plan.xml"""


def _writing_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about what is written."""
    options = (
        declare(
            "--format",
            default="text",
            show_default=True,
            metavar="NAME",
            common=True,
            help="text, json (with digests), or a format of check.",
        ),
        output_option(),
        field_option(),
        declare(
            "--report",
            multiple=True,
            metavar="NAME=FILE",
            common=True,
            help="Write another format to a file too; repeatable.",
        ),
        declare("--summary", metavar="FILE", help="Append a Markdown summary to this file."),
        declare(
            "--verify",
            metavar="FILE",
            common=True,
            help="Only compare the plans with this earlier JSON verdict.",
        ),
    )
    return apply(options, command, "Output")


@dataclass(frozen=True, kw_only=True)
class GateCommand(GateValues):
    """The options of ``gpsfsm gate``."""

    paths: Sequence[str]
    format: str
    output_file: str
    field: str | None
    report: Sequence[str]
    summary: str | None
    verify: str | None


@click.command("gate", cls=Command, section=Section.RUN, short_help="Decide whether plans may run.")
@click.argument("paths", nargs=-1, metavar="PATH…", type=ANY_PATH)
@task_option
@strictness_options
@reach_options
@_writing_options
@engine_option
@scenario_options
@capability_options
@option("tolerate")
@effort_options
@limit_options
@declare("--config", metavar="FILE", help="Use this configuration file. [default: none]")
@click.pass_context
def command(context: click.Context, /, **_: object) -> int:
    r"""Decide whether the plans in PATH… may run: files, folders of *.xml, or -.

    The gate rejects every plan that is not certain to be right. It searches for no configuration
    file, and comments in a plan suppress nothing.

    Exit code: 0 all plans accepted, 1 a plan rejected, 2 a plan undecided.

    \b
    Example:
      gpsfsm gate plan.xml && dispatch plan.xml
    """
    values = settled(context, GateCommand)
    if not all(values.paths) or not values.paths:  # "" was a variable without a value
        raise click.UsageError(_NO_PATH, context)
    return _run(values)


def _run(values: GateCommand) -> int:
    """The process that decides starts first: it loads while the options are read here."""
    if values.verify is not None:
        return _verify(values.verify, values)
    from gpsfsm.gating.gate_process import NoAnswerError, start_worker

    try:
        worker = start_worker()
    except NoAnswerError:  # it is tried once more, and then said of each plan
        return _gated(values, None)
    try:
        return _gated(values, worker)
    finally:
        worker.end()


def _gated(values: GateCommand, worker: ChildProcess | None) -> int:
    """Everything that can be wrong with the options is found before the first plan is read."""
    from gpsfsm.checking.inputs import find_inputs
    from gpsfsm.gating import Gate
    from gpsfsm.progress import MANY, counted, progress_bar

    options = values.gate_options()
    values.refuse_idle()
    inputs = list(find_inputs(values.paths, values.field))
    wanted = _wanted(values)
    plans = [each.file for each in inputs if not each.stdin]
    outputs = [*(file for _, file in wanted), *filter(None, (values.summary,))]
    for place, file in enumerate(outputs):
        check_writable(file, plans, outputs[:place])
    with (
        Gate(
            options, budget_ms=values.budget_ms, memory_mb=values.memory_mb, started=worker
        ) as gate,
        progress_bar("deciding", len(inputs), at_least=MANY) as tick,
    ):
        trees: list[str] = []  # that are refused as such
        decided = (_decided(gate, each, trees) for each in inputs)
        verdicts = list(counted(decided, len(inputs), tick))
    from gpsfsm.report import find_format

    for name, file in reversed(wanted):
        write_private(_written(name, verdicts), file, form=find_format(name).form)
    if values.summary is not None:
        append_text(_written("markdown", verdicts), values.summary)
    if trees:
        complain("a gate refuses behaviour trees; with --allow-trees, it decides them like plans")
    return max((each.reason.exit_code for each in verdicts), default=2)


def _wanted(values: GateCommand) -> list[tuple[str, str]]:
    """The formats to write, and where; the main one first. Raises UsageError."""
    from gpsfsm.report import find_format

    wanted = [(values.format, values.output_file)]
    for text in values.report:
        name, equals, file = text.partition("=")
        if not equals or not file:
            raise UsageError(f"--report takes NAME=FILE, such as sarif=gate.sarif, not {text!r}")
        wanted.append((name, file))
    for name, _ in wanted:
        find_format(name)
    return wanted


def _decided(gate: Gate, source: Input, trees: list[str]) -> Verdict:
    from gpsfsm.checking.inputs import read_bytes
    from gpsfsm.errors import InputError
    from gpsfsm.gating.deciding import unread
    from gpsfsm.syntax.source import read_source
    from gpsfsm.syntax.trees import is_trees

    check = gate.options.check
    try:
        text = read_bytes(source, check.limits.max_bytes)
    except InputError as error:
        return unread(gate.options, str(error), source.path)
    if not check.trees and is_trees(read_source(text, check.limits).text or ""):
        trees.append(source.path)
    return gate(text, source.path)


def _written(name: str, verdicts: Sequence[Verdict]) -> str:
    from gpsfsm import __version__
    from gpsfsm.gating.receipts import write_receipt
    from gpsfsm.model.report import Report
    from gpsfsm.report import RenderOptions, render

    if name == "json":
        return write_receipt(verdicts)
    if name == "text":
        return "".join(map(_verdict_lines, verdicts)) + _total(verdicts)
    plans = tuple(each.report for each in verdicts if each.report is not None)
    return render(Report(plans), name, options=RenderOptions(version=__version__))


def _verdict_lines(verdict: Verdict) -> str:
    """The findings that refuse a plan, and those that its comments excuse; then the verdict."""
    from gpsfsm.model.printable import clip, printable
    from gpsfsm.model.report import Report
    from gpsfsm.report import RenderOptions, render
    from gpsfsm.report._words import excused_words

    report = verdict.report
    if report is None:
        return f"{verdict}\n"
    shown = Report((replace(report, findings=verdict.findings),))
    lines, words = render(shown, options=RenderOptions(quiet=True)), excused_words(shown)
    path = printable(report.path)
    why = "" if verdict.accepted else f": {clip(verdict.message, 500)}"
    return f"{lines}{path}: {verdict}{why}{words}\n"


def _total(verdicts: Sequence[Verdict]) -> str:
    if len(verdicts) == 1:
        return ""
    from gpsfsm.report._words import verdict_counts

    return f"{len(verdicts)} plans: {verdict_counts(each.decision for each in verdicts)}\n"


def _verify(file: str, values: GateCommand) -> int:
    """Compare the digests of the plans with those that were accepted."""
    from gpsfsm.checking.inputs import find_inputs, read_bytes
    from gpsfsm.errors import InputError
    from gpsfsm.files import read_whole
    from gpsfsm.gating.deciding import digests_of
    from gpsfsm.gating.receipts import MOST_BYTES, differences, read_receipt
    from gpsfsm.model.printable import printable

    options = values.gate_options()
    try:
        accepted = read_receipt(read_whole(file, MOST_BYTES), file)
    except InputError as error:
        raise GpsfsmError(f"{file}: {error}") from error
    code, lines = 0, []
    for each in find_inputs(values.paths, values.field):
        try:
            text = read_bytes(each, options.check.limits.max_bytes)
        except InputError as error:
            lines.append(f"{printable(each.path)}: undecided: unreadable: {error}\n")
            code = 2
            continue
        differing = differences(digests_of(text, options), accepted)
        what = f"not as accepted: {', '.join(differing)}" if differing else "as accepted"
        lines.append(f"{printable(each.path)}: {what}\n")
        code = max(code, 1 if differing else 0)
    write_text("".join(lines))
    return code
