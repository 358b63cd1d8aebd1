"""The gate before the plans of a queue: each is admitted, prepared to run, or refused."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

from gpsfsm.analysis.rules import OPEN_IN_GATES
from gpsfsm.analysis.rules.gp2xx_names import UNBOUND_LEAF
from gpsfsm.api import check_options
from gpsfsm.checking import check_text
from gpsfsm.compile import MachinePlan
from gpsfsm.compile.plan_text import holds_trees
from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.execution.queue import Refusal
from gpsfsm.gating.deciding import GateOptions, Reason, reason_of
from gpsfsm.model.capability import Permission
from gpsfsm.model.finding import Severity
from gpsfsm.model.ros import RosSettings
from gpsfsm.model.story import PAPER_ENGINE, Vocabulary
from gpsfsm.running.drivers import FROM_COMMAND, Advice, refuse_unbound
from gpsfsm.running.prepare import (
    REAL,
    SCENARIO,
    Prepared,
    engine_of,
    machine_in,
    prepare,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from contextlib import ExitStack

    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.checking import CheckOptions
    from gpsfsm.execution.journal import Heading
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.report import PlanReport
    from gpsfsm.syntax import Limits

_MOST = 50  # findings that are kept of a plan


@dataclass(frozen=True, slots=True)
class Admitted:
    """A plan that may run. ``forced`` says in spite of what, "" for nothing; ``errors`` has it."""

    prepared: Prepared
    forced: str = ""
    errors: PlanReport | None = None


@dataclass(frozen=True, slots=True)
class Refused(Refusal):
    """A plan that is not run: why, and the exit code that belongs to that.

    ``errors`` is the report of the check with its errors alone; None if there was no check.
    """

    code: int = 2
    message: str = ""
    errors: PlanReport | None = None


Decision = Admitted | Refused

_NEEDED = (
    "networkx",
    "gpsfsm.execution.realtime",
    "gpsfsm.running.session",
    "gpsfsm.running.looking",
)
"""The modules that a real run needs once its plan is accepted, and that take long to load."""


class Admission:
    """Decides about plans, all with the same options, as ``gpsfsm gate`` does.

    ``base`` is the heading of their runs, ``library`` what their names mean. ``force`` admits
    plans with errors, ``silent`` does so without a word. ``analysis`` is how much may be done to
    decide. ``check`` is what checks; another process may do it. ``advice`` is what refused plans
    make people do.
    """

    def __init__(
        self,
        base: Heading,
        capabilities: Capabilities,
        limits: Limits,
        *,
        force: bool = False,
        silent: bool = False,
        trees: bool = False,
        analysis: AnalysisOptions | None = None,
        check: Callable[[bytes, str, CheckOptions], PlanReport] = check_text,
        advice: Advice = FROM_COMMAND,
    ) -> None:
        self.check = check
        self.advice = advice
        self._base = base
        self.library = capabilities.library
        if base.mode == REAL:  # what its runners may reach is a part of the heading
            capabilities = replace(capabilities, allow=_permitted(base))
        self._force = force
        self._silent = silent
        options = check_options(
            analysis,
            from_response=base.options.get("from_response") is True,
            limits=limits,
            capabilities=capabilities,
            engine=engine_of(base),
        )
        # An engine gets plans, and so does whoever asks a model for one.
        self._options = replace(options, trees=trees and engine_of(base) == PAPER_ENGINE)

    def get_ready(self, texts: Iterable[str], stack: ExitStack) -> None:
        """Begin to be seen by the robot before the plans are checked, if one of them needs that.

        Both take a while, so from now on another process checks, while this one loads what a run
        needs. ``stack`` ends it.
        """
        settings = RosSettings.of(self._base.options.get("ros"))
        if self._base.mode != REAL or not (settings.via or self._on_ros(texts)):
            return
        from concurrent.futures import ThreadPoolExecutor
        from importlib import import_module

        from gpsfsm.checking.parallel import CheckApart
        from gpsfsm.ros.node import make_ahead

        apart, pool = CheckApart(), ThreadPoolExecutor(1)
        stack.enter_context(pool)
        stack.enter_context(apart)  # which ends first: then nobody waits for it any more

        def check(content: bytes, name: str, options: CheckOptions) -> PlanReport:
            report = pool.submit(apart.check, content, name, options)
            for module in _NEEDED:
                import_module(module)
            return report.result()

        self.check = check
        make_ahead(settings)

    def _on_ros(self, texts: Iterable[str]) -> bool:
        """True if some plan seems to name a runner that acts on ROS 2."""
        providers = [each for each in self.library.providers if each.ros is not None]
        names = {each.implements.rpartition("/")[2] for each in providers}
        return any(name in text for text in texts for name in names)

    def decide(self, text: str, name: str, limits: Limits | None = None) -> Decision:
        """The decision about a plan; ``limits`` are those of this plan, if they are others."""
        options = self._options if limits is None else replace(self._options, limits=limits)
        try:
            return self._decided(as_bytes(text), name, options)
        except GpsfsmError as error:
            return Refused((str(error),), 2, str(error))

    def trust(self, text: str, name: str) -> Decision:
        """Admit a plan that was checked before, if it can be run at all."""
        try:
            return Admitted(self._prepared(as_bytes(text), name, self._options))
        except GpsfsmError as error:
            return Refused((str(error),), 2, str(error))

    def _decided(self, content: bytes, name: str, options: CheckOptions) -> Decision:
        heading = replace(self._base, plan=content, file=name)
        if machine_in(heading, options.limits) is not None:
            refuse_for_machine(self._base)
        report = self.check(content, name, options)
        simulated = self._base.mode != REAL  # what acts for real follows the gate
        gate = GateOptions(options, allow_approximated=simulated, allow_trees=options.trees)
        reason, why = reason_of(_simulated(report) if simulated else report, gate)
        if reason is not Reason.PASSED and not (self._force or self._silent):
            whole = "tree" if options.trees and holds_trees(as_text(content)) else "plan"
            refused = _refused(report, reason, why, whole)
            if report.facts is None and not self._runnable(content, name, options):
                return refused
            return replace(refused, message=f"{refused.message}; {self._nevertheless(reason)}")
        errors_alone = None
        if reason is not Reason.PASSED and not self._silent:
            errors_alone = _errors_alone(report)
        try:
            prepared = self._prepared(content, name, options)
            machine = isinstance(prepared.compiled.automaton.plan, MachinePlan)
            if machine and self._base.mode == SCENARIO:  # of a tree, as of any other machine
                refuse_for_machine(self._base)
            if self._base.mode == REAL:
                refuse_unbound(prepared, self.advice)
                self._refuse_leaves(prepared, options)
        except GpsfsmError as error:
            return Refused((str(error),), 2, str(error), errors_alone)
        if reason is Reason.PASSED:
            return Admitted(prepared)
        how = "run for a scenario," if self._silent else "forced"
        errors = _written(report)
        forced = f"{how} in spite of {errors}" if errors else f"{how} although {why}"
        return Admitted(prepared, forced, errors_alone)

    def _nevertheless(self, reason: Reason) -> str:
        """The end of a message: the option that runs the plan all the same."""
        return f"{self.advice.force} runs it" + (" anyway" if reason.exit_code == 1 else "")

    def _runnable(self, content: bytes, name: str, options: CheckOptions) -> bool:
        """True if a plan that was not analysed can be run at all, so that force would help."""
        try:
            self._prepared(content, name, options)
        except GpsfsmError:
            return False
        return True

    def _refuse_leaves(self, prepared: Prepared, options: CheckOptions) -> None:
        """Raise UsageError for leaves of a tree whose runners would not be admitted in a plan.

        A check takes leaves for names alone; what acts for real has to keep to its bounds, and to
        what it may reach.
        """
        plan, problems = prepared.compiled.automaton.plan, dict[str, None]()
        if plan.vocabulary is not Vocabulary.TREE:
            return
        alone = replace(options, trees=False, from_response=False)
        seen: dict[str, tuple[Finding, ...]] = {}
        for leaf in plan.runners:
            written = {each.name: each.text for each in leaf.attributes}
            written |= {"interface": leaf.interface, "provider": leaf.provider}
            text = "".join(f" {name}={quoteattr(each)}" for name, each in written.items())
            if text not in seen:
                lines = "\n" * (leaf.line - 1)  # so that what is said of it names its line
                content = as_bytes(f"{lines}<Plan><Runner{text}/></Plan>")
                seen[text] = _errors(self.check(content, prepared.heading.file, alone))
            for each in seen[text]:
                problems[f"{each.rule} at line {leaf.line}: {each.message}"] = None
        if problems:
            shown = [f"{prepared.heading.file}: the tree is not run for real:", *problems]
            raise UsageError("\n  ".join(shown[: _MOST + 1]))

    def _prepared(self, content: bytes, name: str, options: CheckOptions) -> Prepared:
        heading = replace(self._base, plan=content, file=name)
        return prepare(heading, self.library, options.limits)


def _permitted(heading: Heading) -> tuple[tuple[Permission, str], ...]:
    """The targets that real runners may reach: the options ``allow_program`` and so on."""
    options = ((each, heading.options.get(f"allow_{each}") or ()) for each in Permission)
    return tuple(
        (permission, str(target))
        for permission, targets in options
        if isinstance(targets, list | tuple)
        for target in targets
    )


def refuse_for_machine(heading: Heading) -> None:
    """Raise UsageError for what a run can do with plans only."""
    reasons = {
        "a machine cannot be run as an engine would run it": engine_of(heading) != PAPER_ENGINE,
        "a scenario of a machine has outcomes for each visit, which runs do not take": (
            heading.mode == SCENARIO
        ),
        "a language model continues plans, not machines": "model" in heading.options,
    }
    for reason, applies in reasons.items():
        if applies:
            raise UsageError(reason)


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
    every = (*report.findings, *report.suppressed)
    return tuple(finding for finding in every if finding.severity is Severity.ERROR)


def _doubts(report: PlanReport) -> tuple[Finding, ...]:
    """The findings that leave a gate undecided, though none is an error."""
    every = (*report.findings, *report.suppressed)
    return tuple(
        each for each in every if each.rule in OPEN_IN_GATES or each.if_proved is Severity.ERROR
    )


def _errors_alone(report: PlanReport) -> PlanReport:
    return replace(report, findings=_errors(report), suppressed=())


def _simulated(report: PlanReport) -> PlanReport:
    """The report without what is open on the robot alone: a simulation draws how leaves end."""
    rows = (report.findings, report.suppressed)
    bound = [tuple(each for each in row if each.rule != UNBOUND_LEAF.code) for row in rows]
    return replace(report, findings=bound[0], suppressed=bound[1])


def _refused(report: PlanReport, reason: Reason, why: str, whole: str) -> Refused:
    """The errors are for the journal and for the runner that has submitted the plan."""
    errors = _errors(report)
    lines = tuple(
        f"{finding.rule} at {finding.location.words}: {finding.message}"
        for finding in (errors or _doubts(report))[:_MOST]
    )
    because = "" if errors else f" ({'; '.join((why, *lines[:1]))})"
    texts = {
        Reason.FINDINGS: f"the {whole} has errors",
        Reason.INCONCLUSIVE: f"the {whole} is undecided{because}",
    }
    message = f"{report.path}: {texts.get(reason, why)}, so it is not run"
    return Refused(lines or (why,), reason.exit_code, message, _errors_alone(report))


def _written(report: PlanReport) -> str:
    """The errors, for the journal of a plan that runs nevertheless."""
    errors = [f"{finding.rule} at {finding.location.words}" for finding in _errors(report)]
    return ", ".join(errors[:_MOST])
