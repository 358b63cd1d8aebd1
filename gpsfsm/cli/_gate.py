"""The gate of ``gpsfsm run``: what is wrong with a plan is told, and then it is not run."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from gpsfsm.api import check_options
from gpsfsm.checking import check_text
from gpsfsm.cli._engines import engine_of
from gpsfsm.cli._real import refuse_unbound
from gpsfsm.cli._runs import REAL, Prepared, prepare
from gpsfsm.cli._streams import complain, write_message
from gpsfsm.errors import GpsfsmError
from gpsfsm.execution.queue import Refusal
from gpsfsm.gating.deciding import reason_of
from gpsfsm.gating.verdicts import GateOptions, Reason
from gpsfsm.model.finding import Severity
from gpsfsm.model.report import Report
from gpsfsm.report import RenderOptions, render

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.checking import CheckOptions
    from gpsfsm.compile import Compiled
    from gpsfsm.execution.journal import Heading
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.report import PlanReport
    from gpsfsm.syntax import Limits

__all__ = ["Passed", "PlanGate", "as_bytes", "as_text"]

_MOST = 50  # findings that are kept of a plan


@dataclass(frozen=True, slots=True)
class Passed:
    """A plan that may run; ``forced`` says in spite of what, "" for nothing."""

    prepared: Prepared
    forced: str


class PlanGate:
    """Checks the plans of a queue, all with the same options, as ``gpsfsm gate`` does.

    ``base`` is the heading of its runs. ``force`` lets plans with errors through, ``silent`` does
    so without a word. ``code`` is the exit code that belongs to the plan that was checked last,
    ``check`` is what checks; it may be another process that does.
    """

    def __init__(
        self,
        base: Heading,
        capabilities: Capabilities,
        limits: Limits,
        *,
        force: bool = False,
        silent: bool = False,
    ) -> None:
        self.code = 0
        self.check: Callable[[bytes, str, CheckOptions], PlanReport] = check_text
        self.trusting = False  # plans have been checked before
        self._base = base
        self._library = capabilities.library
        self._limits = limits
        self._force = force
        self._silent = silent
        options = check_options(
            from_response=base.options.get("from_response") is True,
            limits=limits,
            capabilities=capabilities,
            engine=engine_of(base),
        )
        self._options = replace(options, trees=False)
        self._passed: dict[int, Passed] = {}
        self._known: deque[tuple[str, str, Compiled | Refusal, int]] = deque()

    def __call__(self, text: str, name: str, /) -> Compiled | Refusal:
        """The plan, or why it is not run, which has also been told."""
        if self._known and self._known[0][:2] == (text, name):
            _, _, found, self.code = self._known.popleft()
            return found
        try:
            return self.examine(text, name)
        except GpsfsmError as error:
            self.code = 2
            complain(str(error))
            return Refusal((str(error),))

    def ahead(self, text: str, name: str, limits: Limits | None = None) -> Compiled | Refusal:
        """Check a plan before there is a queue; it must be queued in the same order then.

        ``limits`` are those of this plan, if they are others.
        """
        usual = self._limits, self._options
        if limits is not None:
            self._limits, self._options = limits, replace(self._options, limits=limits)
        try:
            found = self(text, name)
        finally:
            self._limits, self._options = usual
        self._known.append((text, name, found, self.code))
        return found

    def examine(self, text: str, name: str) -> Compiled | Refusal:
        """Like calling it, but raises GpsfsmError for a plan that passes and cannot be run."""
        self.code = 0
        content, forced = as_bytes(text), ""
        if not self.trusting:
            report = self.check(content, name, self._options)
            reason, why = reason_of(report, GateOptions(self._options))
            if reason is not Reason.PASSED:
                if not self._silent:
                    self.code = _refused(report, reason, why, force=self._force)
                if self.code:
                    return Refusal(_lines(report) or (why,))
                how = "run for a scenario," if self._silent else "forced"
                errors = _written(report)
                forced = f"{how} in spite of {errors}" if errors else f"{how} although {why}"
        heading = replace(self._base, plan=content, file=name)
        prepared = prepare(heading, self._library, self._limits)
        if self._base.mode == REAL and not self.trusting:
            refuse_unbound(prepared)
        self._passed[id(prepared.compiled)] = Passed(prepared, forced)
        return prepared.compiled

    def take(self, compiled: Compiled) -> Passed:
        """What is known of a plan that has passed; once."""
        return self._passed.pop(id(compiled))


def as_text(content: bytes) -> str:
    """A plan as text from which ``as_bytes`` makes the same bytes, whatever they are."""
    return content.decode("utf-8", "surrogateescape")


def as_bytes(text: str) -> bytes:
    """A plan as the file that it came from, or would be."""
    try:
        return text.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError:  # half a character, made up by a runner
        return text.encode("utf-8", "replace")


def _errors(report: PlanReport) -> tuple[Finding, ...]:
    found = (*report.findings, *report.suppressed)
    return tuple(finding for finding in found if finding.severity is Severity.ERROR)


def _refused(report: PlanReport, reason: Reason, why: str, *, force: bool) -> int:
    """Write what is wrong to standard error; the exit code, 0 for a plan that is forced."""
    shown = Report((replace(report, findings=_errors(report), suppressed=()),))
    if shown.plans[0].findings:
        write_message(render(shown, options=RenderOptions(quiet=True)))
    if force:
        return 0
    told = {Reason.FINDINGS: "the plan has errors", Reason.INCONCLUSIVE: "the plan was not decided"}
    nevertheless = " nevertheless" if reason.exit_code == 1 else ""
    complain(
        f"{report.path}: {told.get(reason, why)}, so it is not run; --force runs it{nevertheless}"
    )
    return reason.exit_code


def _lines(report: PlanReport) -> tuple[str, ...]:
    """The errors, for the journal and for the runner that has submitted the plan."""
    return tuple(
        f"{finding.rule} at line {finding.location.line}: {finding.message}"
        for finding in _errors(report)[:_MOST]
    )


def _written(report: PlanReport) -> str:
    """Which errors, for the journal of a plan that runs nevertheless."""
    errors = [f"{finding.rule} at line {finding.location.line}" for finding in _errors(report)]
    return ", ".join(errors[:_MOST])
