"""The verdict on a plan, and the decision that leads to it: whatever is not sure is refused.

Pure: the same text, capabilities, options and version give the same verdict, and the digests in it
(``digests_of``) say for which of them it holds. Effort is bounded in z3's steps
(``AnalysisOptions.total_rlimit``) and by the limits on the text; ``gpsfsm.gating.gate_process``
bounds seconds as well.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, field, fields, is_dataclass, replace
from enum import StrEnum
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.analysis.rules import OPEN_IN_GATES, rule
from gpsfsm.capabilities.library import EMPTY
from gpsfsm.capabilities.table import dump
from gpsfsm.checking import CheckOptions, check_text, unreadable
from gpsfsm.checking.selection import Selection
from gpsfsm.errors import InternalError, UsageError, misused
from gpsfsm.late import dataclass
from gpsfsm.model.finding import Confidence, Finding, Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.report import Frequency, PlanReport
from gpsfsm.model.report import Verdict as CheckVerdict
from gpsfsm.syntax import Limits
from gpsfsm.tracing import span
from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.model.report import Facts


class Reason(StrEnum):
    """The reason. ``inconclusive``: it could not be decided, within the limits or at all.

    It settles the verdict: ``passed`` is accepted, ``findings`` and ``empty`` are rejected,
    ``inconclusive`` and ``unreadable`` are undecided. Only what is accepted may run.
    """

    PASSED = "passed"
    FINDINGS = "findings"
    EMPTY = "empty"
    INCONCLUSIVE = "inconclusive"
    UNREADABLE = "unreadable"

    @property
    def exit_code(self) -> int:
        """0: accepted; 1: rejected for what is in the plan; 2: undecided."""
        return _EXIT_CODES[self.decision]

    @property
    def decision(self) -> CheckVerdict:
        """The verdict that has this reason."""
        if self is Reason.PASSED:
            return CheckVerdict.ACCEPTED
        rejects = self in (Reason.FINDINGS, Reason.EMPTY)
        return CheckVerdict.REJECTED if rejects else CheckVerdict.UNDECIDED


_EXIT_CODES: Final = {
    CheckVerdict.ACCEPTED: 0,
    CheckVerdict.REJECTED: 1,
    CheckVerdict.UNDECIDED: 2,
}


@dataclass(frozen=True, slots=True)
class GateOptions:
    """The options of the gate.

    - ``check``: how plans and machines are checked.
    - ``allow_trees``: decide behaviour trees; they are refused otherwise, whatever ``check`` says.
    - ``fail_on``: the lowest severity of a finding that refuses a plan.
    - ``allow_suppressions``: comments in the plan may excuse findings. By default, the author of a
      plan cannot excuse anything.
    - ``allow_empty``: accept a plan that does nothing.
    - ``allow_approximated``: accept a tree or machine that may have an error, if nobody knows
      because constructs of it were over-approximated.
    """

    check: CheckOptions = field(default_factory=CheckOptions)
    fail_on: Severity = Severity.ERROR
    allow_suppressions: bool = False
    allow_empty: bool = False
    allow_approximated: bool = False
    allow_trees: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "check", replace(self.check, trees=self.allow_trees))


@dataclass(frozen=True, slots=True)
class Digests:
    """For what a verdict holds: SHA-256 of the plan, the capabilities and the options, in hex.

    ``plan`` is that of the bytes of the plan, "" where they could not be read. ``all`` is one
    digest over those and the version of gpsfsm. The time budget is in none of them: it can make a
    verdict a refusal, never an acceptance.
    """

    plan: str
    capabilities: str
    options: str
    version: str
    all: str


@dataclass(frozen=True, slots=True)
class Basis:
    """The demands that a verdict is about.

    ``task``: SHA-256 of the task file, in hex; None where no task was given, so that only the
    structure of the plan was decided. ``engine`` and ``hangs``: an engine without give-up, on
    which any failure that nothing handles hangs, and in which runs the plan does; None without one.
    ``approximated``: errors of which nobody knows whether they can happen are allowed.
    """

    task: str | None = None
    engine: str | None = None
    hangs: Frequency | None = None
    approximated: bool = False

    @property
    def scope(self) -> str:
        """``structure``, or ``structure and task``."""
        return "structure" if self.task is None else "structure and task"

    @property
    def remarks(self) -> tuple[str, ...]:
        """The limits of an acceptance, as one says them."""
        remarks = [] if self.task is not None else ["structure only: no task was given"]
        if self.engine is not None:
            remarks.append(f"any unhandled failure hangs on {self.engine}")
        if self.approximated:
            remarks.append("errors that only an approximation has were allowed")
        return tuple(remarks)

    def to_dict(self) -> dict[str, Any]:
        """The entry ``basis`` in receipts and answers of the service (docs/gate.md)."""
        hangs = None if self.hangs is None else self.hangs.value
        engine = None if self.engine is None else {"name": self.engine, "hangs": hangs}
        return {
            "scope": self.scope,
            "task": self.task,
            "engine": engine,
            "allow_approximated": self.approximated,
        }


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict on one plan; it is true if the plan may run.

    ``decision`` is accepted, rejected or undecided, as of a check; the last two are refusals.
    ``findings`` are those for which the plan is refused. ``report`` is what was found in all, as
    the gate sees it: what refuses the plan has the level error. ``basis`` says what was demanded,
    and ``options`` lists all options, as JSON.
    """

    decision: CheckVerdict
    reason: Reason
    message: str
    digests: Digests
    findings: tuple[Finding, ...] = ()
    report: PlanReport | None = None
    basis: Basis = field(default_factory=Basis)
    options: str = field(default="{}", compare=False)

    @property
    def accepted(self) -> bool:
        """True if the plan may run."""
        return self.decision is CheckVerdict.ACCEPTED and self.reason is Reason.PASSED

    def __bool__(self) -> bool:
        return self.accepted

    def __str__(self) -> str:
        if not self.accepted:
            return f"{self.decision.value}: {self.reason.value}"
        remarks = "; ".join(self.basis.remarks)
        return f"accepted ({remarks})" if remarks else "accepted"

    def to_dict(self) -> dict[str, Any]:
        """The entry of the plan in the JSON of ``gpsfsm gate --format json`` (docs/gate.md)."""
        plan: dict[str, Any] = {"path": "", "facts": None}
        plan |= {"findings": [], "suppressed_findings": [], "approximations": []}
        if self.report is not None:
            excused = tuple(self.report.excused)
            plan = replace(self.report, findings=self.findings, suppressed=excused).to_dict()
        return {
            "path": plan["path"],
            "kind": "machine" if self.report is not None and self.report.machine else "plan",
            "verdict": self.decision.value,
            "reason": self.reason.value,
            "message": self.message,
            "basis": self.basis.to_dict(),
            "digests": asdict(self.digests),
            "findings": plan["findings"],
            "suppressed_findings": plan["suppressed_findings"],
            "facts": plan["facts"],
            "approximations": plan["approximations"],
            "options": json.loads(self.options),
        }


_COMMENT: Final = "comment"
_EMPTY_PLAN = "GP109"
_BUDGET = "GP302"
ACTION_ALLOWANCE_S = 0.01
"""Seconds that a deadline allows a real run for each action, and once for its beginning.

Measured with ``run --real``, with and without a journal, and plans of 1 to 200 runners that wait or
log. On two quiet cores an action took 0.3 to 1.3 ms longer than declared, a single one with the
beginning of the run 2 to 5 ms; at a load average of 15 it was up to 22 ms.
"""


def gate_text(text: str | bytes, name: str, options: GateOptions | None = None) -> Verdict:
    """Decide in this process whether a plan may run; ``name`` is the name of the plan in findings.

    No text raises. Raises UsageError for invalid options.

    >>> str(gate_text("<Plan><Runner/></Plan>", "plan.xml"))
    'rejected: findings'
    """
    value: object = text
    if not isinstance(value, str | bytes):
        raise misused("gate_text", "the text of a plan", value)
    chosen: object = options
    if not isinstance(chosen, GateOptions | None):
        raise misused("gate_text", "gpsfsm.GateOptions as options", chosen)
    options = options or GateOptions()
    try:
        with span("gpsfsm.gate") as whole:
            digests = digests_of(text, options)
            report = check_text(text, name, _for_real_runs(options.check))
            verdict = _judged(report, options, digests)
            whole.note(**{"gpsfsm.verdict": verdict.decision.value})
            return verdict
    except UsageError:
        raise
    except (Exception, SystemExit) as error:  # a gate that breaks lets nothing through
        return refusal(text, options, f"the check failed: {type(error).__name__}", name)


def _for_real_runs(check: CheckOptions) -> CheckOptions:
    """The same, with a proof required, and an allowance: no real run keeps a deadline exactly."""
    allowance = 0.0 if check.analysis.deadline_s is None else ACTION_ALLOWANCE_S
    described = check.described
    if described.allow is None:  # nobody has permitted anything
        described = replace(described, allow=())
    return replace(
        check,
        analysis=replace(check.analysis, require_proof=True, allowance_s=allowance),
        capabilities=described,
    )


def refusal(text: str | bytes, options: GateOptions, why: str, name: str = "<text>") -> Verdict:
    """The verdict on a plan that could not be decided; never raises."""
    report = PlanReport(
        name, CheckVerdict.UNDECIDED, None, (rule("GP904").finding(why, Location(1, 1)),)
    )
    digests = _digests(text, options)
    return _refused(Reason.INCONCLUSIVE, why, digests, options, report)


def unread(options: GateOptions, why: str, name: str) -> Verdict:
    """The verdict on a plan that could not be read; never raises."""
    digests = _digests(None, options)
    report = unreadable(name, why)
    return _refused(Reason.UNREADABLE, why, digests, options, report)


def _basis(options: GateOptions, facts: Facts | None = None) -> Basis:
    """The demands of the options; of an engine with what the facts say of it."""
    task = options.check.task
    engine = None if facts is None else facts.engine
    return Basis(
        task=None if task is None else task.sha256,
        engine=None if engine is None else engine.name,
        hangs=None if engine is None else engine.hangs,
        approximated=options.allow_approximated,
    )


def _digests(text: str | bytes | None, options: GateOptions) -> Digests:
    """As far as there are any: those of what could not be read or written down are empty."""
    try:
        return digests_of(text, options)
    except Exception:
        return Digests("", "", "", VERSION, "")


def _judged(report: PlanReport, options: GateOptions, digests: Digests) -> Verdict:
    counted, rest = _counted(report, options)
    against = _against(counted, options)
    reason, message = _reason(report, options, counted)
    if reason is Reason.EMPTY:
        against = tuple(each for each in counted if each.rule == _EMPTY_PLAN)
    if reason is Reason.INCONCLUSIVE:
        against = against or _doubtful(counted, options) or counted
        opening = [each for each in against if _leaves_open(each)] or against
        message = opening[0].message if opening else message
    refusing = {id(each) for each in against}
    shown = tuple(
        replace(each, severity=Severity.ERROR) if id(each) in refusing else each for each in counted
    )
    judged = replace(report, verdict=reason.decision, findings=shown, suppressed=rest)
    basis = _basis(options, report.facts)
    if reason is Reason.PASSED:
        message = "; ".join((message, *basis.remarks))
    return Verdict(
        reason.decision, reason, message, digests, against, judged, basis, listed_options(options)
    )


def reason_of(report: PlanReport, options: GateOptions) -> tuple[Reason, str]:
    """The reason that the gate gives for a report: whoever lets plans run asks for this one."""
    counted, _ = _counted(report, options)
    return _reason(report, options, counted)


def _against(counted: tuple[Finding, ...], options: GateOptions) -> tuple[Finding, ...]:
    """The findings that refuse a plan: as bad as ``fail_on``, a broken budget, or left open.

    Who says how many failures must be tolerated has asked for just that.
    """
    return tuple(
        each
        for each in counted
        if each.confidence is not Confidence.MAY
        and (
            each.severity.rank >= options.fail_on.rank
            or _breaks_budget(each, options)
            or _leaves_open(each)
        )
    )


def _doubtful(counted: tuple[Finding, ...], options: GateOptions) -> tuple[Finding, ...]:
    """The findings that would refuse a plan if they were proved."""
    if options.allow_approximated:
        return ()
    return tuple(
        each
        for each in counted
        if each.confidence is Confidence.MAY
        and (
            (each.if_proved or each.severity).rank >= options.fail_on.rank
            or _breaks_budget(each, options)
        )
    )


def _breaks_budget(finding: Finding, options: GateOptions) -> bool:
    budget = options.check.analysis.tolerate > 0
    return budget and finding.rule == _BUDGET and finding.severity is Severity.WARNING


def _leaves_open(finding: Finding) -> bool:
    """True if what runners do is open, so that nobody can decide: a defect of another's file."""
    defective = finding.rule == "GP211"  # a warning where no runner of the plan is concerned
    return finding.rule in OPEN_IN_GATES and not (
        defective and finding.severity is not Severity.ERROR
    )


def _reason(
    report: PlanReport, options: GateOptions, counted: tuple[Finding, ...]
) -> tuple[Reason, str]:
    """The reason and a message. There is one way to PASSED, and it is the last one."""
    what = "machine" if report.machine else "plan"
    against = _against(counted, options)
    if report.verdict is CheckVerdict.UNDECIDED:
        return Reason.INCONCLUSIVE, f"the {what} is undecided"
    if any(map(_leaves_open, (*report.findings, *report.suppressed))):
        return Reason.INCONCLUSIVE, f"nobody knows what the {what} does on the robot"
    if against and all(each.severity.rank < options.fail_on.rank for each in against):
        tolerated = options.check.analysis.tolerate
        failures = "1 failure ends" if tolerated == 1 else f"{tolerated} failures or fewer end"
        return Reason.FINDINGS, f"{failures} the {what} (--tolerate {tolerated})"
    if against:
        number = "1 finding" if len(against) == 1 else f"{len(against):,} findings"
        return Reason.FINDINGS, f"{number} of level {options.fail_on.value} or worse"
    if _doubtful(counted, options):
        return Reason.INCONCLUSIVE, f"whether the {what} has an error is not known"
    if report.verdict is not CheckVerdict.ACCEPTED and not _excused(report, options):
        return Reason.FINDINGS, f"the {what} has errors that are not shown"
    if report.facts is None or _unknown(report.facts):  # accepted undecided: it must not happen
        return Reason.INCONCLUSIVE, f"the {what} is undecided"
    if report.proof is None or report.proof.unproved:
        limits = ", ".join(report.proof.limits) if report.proof else "the check was not completed"
        return Reason.INCONCLUSIVE, f"not proved: {limits}"
    if report.facts.runners == 0 and not options.allow_empty:
        return Reason.EMPTY, f"the {what} has no step that does anything"
    return Reason.PASSED, f"the {what} may run"


def _unknown(facts: Facts) -> bool:
    frequencies = [facts.completes, facts.gives_up, facts.stuck]
    if facts.engine is not None:
        frequencies += [facts.engine.hangs, facts.engine.aborts]
    if facts.machine is not None:
        frequencies += [facts.machine.endless, facts.machine.completes_if_fair]
    return Frequency.UNKNOWN in frequencies


def _counted(
    report: PlanReport, options: GateOptions
) -> tuple[tuple[Finding, ...], tuple[Finding, ...]]:
    """The findings that count, in document order, and those that do not.

    What comments excuse counts as well, unless that is allowed. Errors count even where an option
    does not show them, and so does a broken budget of failures, which an option has asked for.
    """
    counted, rest = list(report.findings), []
    for each in report.suppressed:
        if _leaves_open(each):
            counted.append(replace(each, suppressed_by="", justification=""))
        elif each.excused and options.allow_suppressions:
            # no option hides an error here, so it is the comment that does
            error = each.severity is Severity.ERROR
            rest.append(replace(each, suppressed_by=_COMMENT) if error else each)
        elif (
            each.suppressed_by == _COMMENT
            or each.severity is Severity.ERROR
            or _breaks_budget(each, options)
        ):
            counted.append(replace(each, suppressed_by="", justification=""))
        else:
            rest.append(each)
    counted.sort(key=lambda each: (each.location.line, each.location.column, each.rule))
    return tuple(counted), tuple(rest)


def _excused(report: PlanReport, options: GateOptions) -> bool:
    """True if comments excuse the errors, and may do so."""
    errors = [each for each in report.suppressed if each.severity is Severity.ERROR]
    by_comments = bool(errors) and all(each.excused for each in errors)
    return options.allow_suppressions and by_comments


def _refused(
    reason: Reason, message: str, digests: Digests, options: GateOptions, report: PlanReport
) -> Verdict:
    """A verdict without findings against the plan; what cannot be listed is not."""
    listed = "{}"
    with suppress(Exception):
        listed = listed_options(options)
    basis = _basis(options)
    return Verdict(reason.decision, reason, message, digests, (), report, basis, listed)


_APART = "capabilities"
"""The option that has a digest of its own."""
_NAMED = "named"
"""What says which of the options were named: it asks for nothing more."""


def digests_of(text: str | bytes | None, options: GateOptions) -> Digests:
    """The digests of a plan and of what it is checked with; None for a plan that was not read.

    >>> from gpsfsm.gating.deciding import GateOptions
    >>> digests_of(b"<Plan/>", GateOptions()).plan[:16]
    '99679fa55cbe78bd'
    """
    content = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    parts = (
        "" if content is None else hashlib.sha256(content).hexdigest(),
        _of_capabilities(options.check.described),
        _of_options(options),
        VERSION,
    )
    return Digests(*parts, all=_digest("\n".join(parts)))


@lru_cache(maxsize=8)
def _of_capabilities(capabilities: Capabilities) -> str:
    """All that capability files and the profile of a robot say."""
    parts = [dump(capabilities.library), *map(str, capabilities.defects)]
    if capabilities.robot is not None or capabilities.allow:
        described = replace(capabilities, library=EMPTY.library, defects=())
        parts.append(json.dumps(_plain(described), sort_keys=True))
    return _digest("\n".join(parts))


@lru_cache(maxsize=8)
def listed_options(options: GateOptions) -> str:
    """All options with their values, as JSON. New options are in it without anybody's doing."""
    listed: dict[str, Any] = {}
    pending: list[tuple[str, object]] = [("", options)]
    while pending:
        name, value = pending.pop()
        if isinstance(value, GateOptions | CheckOptions | AnalysisOptions | Limits | Selection):
            pending += [(each.name, getattr(value, each.name)) for each in fields(value)]
        elif name == "task":
            listed[name] = None if options.check.task is None else options.check.task.sha256
        elif name not in (_APART, _NAMED):
            listed[name] = _plain(value)
    described = options.check.described
    robot = described.robot
    allowed = [[kind.value, text] for kind, text in described.allow or ()]
    listed |= {"robot": None if robot is None else robot.file, "allow": allowed}
    listed[_APART] = _of_capabilities(described)
    return json.dumps(listed, sort_keys=True)


@lru_cache(maxsize=8)
def _of_options(options: GateOptions) -> str:
    """All options as JSON, but the capabilities. New options are in it without anybody's doing."""
    check = {
        each.name: _plain(getattr(options.check, each.name))
        for each in fields(options.check)
        if each.name not in (_APART, _NAMED)
    }
    values = {each.name: _plain(getattr(options, each.name)) for each in fields(options)} | {
        "check": check
    }
    return _digest(json.dumps(values, sort_keys=True, separators=(",", ":")))


def _plain(value: object) -> object:
    """A value for JSON.

    Raises InternalError for one that has no form of its own: its digest would mean nothing.
    """
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, frozenset):
        return sorted(map(str, value))
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    if isinstance(value, Mapping):
        return [[_plain(key), _plain(each)] for key, each in value.items()]
    if is_dataclass(value) and not isinstance(value, type):
        parts = {each.name: _plain(getattr(value, each.name)) for each in fields(value)}
        return {"": type(value).__name__, **parts}
    raise InternalError(f"there is no digest of a {type(value).__name__} among the options")


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
