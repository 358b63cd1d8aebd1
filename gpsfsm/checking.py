"""Check one plan: text → plan → automaton → verdicts → findings."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.analysis.rules import all_rules, rule
from gpsfsm.analysis.tree_words import NOT_FOR_TREES, tree_findings
from gpsfsm.capabilities.library import Capabilities, bind, builtin_capabilities
from gpsfsm.errors import (
    DEBUG_VARIABLE,
    AssumptionError,
    InputError,
    InternalError,
    UsageError,
    is_out_of_memory,
)
from gpsfsm.model.capability import Outcomes
from gpsfsm.model.engine import PAPER_ENGINE
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.report import Facts, PlanReport, Verdict
from gpsfsm.reading import read_plan
from gpsfsm.selection import Selection, apply_suppressions, told_once
from gpsfsm.syntax import Limits, Parsed, parse

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.decide import Decided
    from gpsfsm.model.capability import Binding
    from gpsfsm.model.plan import Plan
    from gpsfsm.tasks.task import Task

__all__ = [
    "MORE_MEMORY",
    "OUT_OF_MEMORY",
    "CheckOptions",
    "check_text",
    "failed",
    "undecided",
    "unreadable",
]

OUT_OF_MEMORY = "the memory has run out before it was decided"
MORE_MEMORY = "allow more memory, check with --jobs 1, or split the plan"


@dataclass(frozen=True, slots=True)
class CheckOptions:
    """Everything that a check depends on besides the plan.

    ``capabilities`` None stands for the built-in library; ``task`` is what the plan has to do.
    Without ``trees`` a behaviour tree is no plan, as it is for those who run what they check.
    ``engine`` is the profile of the engine that is to run the plan (docs/engines.md). Without
    ``decides`` the text is read, and nothing is decided about the plan.
    """

    analysis: AnalysisOptions = field(default_factory=AnalysisOptions)
    limits: Limits = field(default_factory=Limits)
    selection: Selection = field(default_factory=Selection)
    from_response: bool = False
    capabilities: Capabilities | None = None
    task: Task | None = None
    trees: bool = True
    engine: str = PAPER_ENGINE
    decides: bool = True

    @property
    def described(self) -> Capabilities:
        """The capabilities in force: the built-in library if none are given."""
        return self.capabilities or builtin_capabilities()


@dataclass(slots=True)
class _Progress:
    """What is known of a plan so far; ``undecided`` means that gpsfsm could not decide."""

    findings: list[Finding] = field(default_factory=list)
    facts: Facts | None = None
    undecided: bool = False
    analysed: bool = False
    context: Context | None = None

    def fail(self, code: str, message: str, *, hint: str = "") -> None:
        """Record why there is no verdict."""
        self.findings.append(rule(code).finding(message, Location(1, 1, "/Plan"), hint=hint))
        self.undecided = True

    def tell_undecided(self, names: Sequence[str]) -> None:
        """Record what a limit kept open, if anything."""
        if names:
            told = ", ".join(dict.fromkeys(names))
            self.fail("GP904", f"a limit of steps was reached before it was decided: {told}")


def check_text(text: str | bytes, path: str, options: CheckOptions) -> PlanReport:
    """Check one plan. Never raises for anything that is in the text.

    A defect of gpsfsm that the text brings to light is reported as GP903, unless the environment
    says that it is to be shown. Raises UsageError for options that make no sense.
    """
    try:
        return _check(text, path, options)
    except UsageError:
        raise
    except RecursionError:
        return undecided(path, "it is nested too deeply to be decided", hint="split the plan")
    except InternalError as error:
        return failed(path, str(error))
    except Exception as error:
        if is_out_of_memory(error):
            return undecided(path, OUT_OF_MEMORY, hint=MORE_MEMORY)
        if os.environ.get(DEBUG_VARIABLE):
            raise
        what = f"{type(error).__name__}: {error}"
        return failed(path, f"the check of this plan failed ({what}); this is a defect of gpsfsm")


def _check(text: str | bytes, path: str, options: CheckOptions) -> PlanReport:
    read = read_plan if options.trees else parse
    parsed = read(text, file=path, limits=options.limits, from_response=options.from_response)
    progress = _Progress([rule(problem.rule).finding_of(problem) for problem in parsed.problems])
    progress.undecided = parsed.over_limit or parsed.lost
    if parsed.plan is not None and options.decides:
        _analyse(parsed.plan, options, progress)
    if parsed.trees:
        progress.findings = tree_findings(progress.findings)
    if options.engine != PAPER_ENGINE and not (parsed.over_limit or parsed.foreign):
        # An engine reads the bytes as they are; of an answer it gets the plan.
        source = parsed.body if options.from_response and parsed.body else text
        _check_engine(source, path, options, progress)
    return _report(parsed, path, options, progress)


def unreadable(path: str, message: str) -> PlanReport:
    """The report of an input that could not be read."""
    finding = rule("GP901").finding(message, Location(1, 1))
    return PlanReport(path, Verdict.ERROR, None, (finding,))


def undecided(path: str, message: str, *, hint: str) -> PlanReport:
    """The report of a plan for which the time or the memory was not enough."""
    finding = rule("GP904").finding(message, Location(1, 1), hint=hint)
    return PlanReport(path, Verdict.ERROR, None, (finding,))


def failed(path: str, message: str, *, hint: str = "") -> PlanReport:
    """The report of a plan that could not be checked, through no fault of its own."""
    finding = rule("GP903").finding(message, Location(1, 1), hint=hint)
    return PlanReport(path, Verdict.ERROR, None, (finding,))


def _analyse(plan: Plan, check: CheckOptions, progress: _Progress) -> None:
    """Decide everything; what goes wrong becomes a finding and ``undecided``."""
    from gpsfsm.analysis.constraints import constraints_of  # noqa: PLC0415  (may load a parser)
    from gpsfsm.compile import TreePlan, compile_plan  # noqa: PLC0415

    options, capabilities = check.analysis, check.described
    # What a behaviour tree calls a node says nothing about the runners of this library.
    bindings = (
        (None,) * len(plan.runners)
        if isinstance(plan, TreePlan)
        else bind(plan, capabilities.library)
    )
    try:
        compiled = compile_plan(plan, start_chain="no-start" in options.faults, bindings=bindings)
        constraints = constraints_of(
            plan,
            faults=options.faults,
            consistent=options.consistent,
            assumptions=options.assumptions,
            bindings=compiled.bindings,
        )
    except AssumptionError as error:
        progress.fail("GP907", error.summary, hint=error.hint)
        return
    from gpsfsm.analysis.decide import decide  # noqa: PLC0415

    progress.findings += [
        rule("GP906").finding(
            f"the assumption matches no runner of this plan: {text}", plan.location(0)
        )
        for text in constraints.unmatched
    ]
    try:
        decided = decide(compiled, constraints, options)
        if decided.contradictory:
            progress.fail("GP902", _contradiction(bindings))
            return
        progress.facts = decided.facts()
        progress.findings += _findings(decided, capabilities, progress, check.task)
        progress.analysed = True
    except InternalError as error:
        progress.facts = None
        progress.fail("GP903", str(error))


def _check_engine(text: str | bytes, path: str, options: CheckOptions, progress: _Progress) -> None:
    """What the plan does on the engine: its facts take the place of the paper's."""
    from gpsfsm.analysis.engine_words import without_give_up  # noqa: PLC0415
    from gpsfsm.engine_checking import check_on_engine  # noqa: PLC0415

    try:
        found = check_on_engine(
            text,
            options.engine,
            options.analysis,
            options.described,
            file=path,
            limits=options.limits,
            paper=progress.context,
        )
    except InternalError as error:
        progress.facts = None
        progress.fail("GP903", str(error))
        return
    except InputError as error:
        progress.facts = None
        progress.fail("GP103", f"{options.engine} sees more in this text: {error}")
        return
    except AssumptionError as error:  # the engine may see another plan than the front end
        progress.facts = None
        if not progress.undecided:
            progress.fail("GP907", error.summary, hint=error.hint)
        return
    progress.facts = found.facts
    if found.contradictory and not progress.undecided:
        progress.fail("GP902", f"the assumptions and options admit no scenario on {options.engine}")
    if found.seen is not None:
        seen = found.seen
        progress.findings = [without_give_up(each, seen) for each in progress.findings]
    progress.findings += found.findings
    progress.tell_undecided(found.undecided)


def _contradiction(bindings: Iterable[Binding | None]) -> str:
    declared = any(binding and binding.provider.outcomes != Outcomes() for binding in bindings)
    what = (
        "the assumptions, options and declared outcomes"
        if declared
        else ("the assumptions and options")
    )
    return f"{what} admit no scenario of this plan"


def _findings(
    decided: Decided, capabilities: Capabilities, progress: _Progress, task: Task | None
) -> Iterable[Finding]:
    """What the rules make of the verdicts, and where the plan leaves its task."""
    from gpsfsm.analysis.context import Context  # noqa: PLC0415
    from gpsfsm.analysis.solver import Inconclusive  # noqa: PLC0415
    from gpsfsm.compile import TreePlan  # noqa: PLC0415

    context = Context(decided, capabilities)
    trees = isinstance(context.plan, TreePlan)
    undecided = list(decided.inconclusive)
    found: list[Finding] = []
    for known in all_rules():
        if known.find is None or (trees and known.code in NOT_FOR_TREES):
            continue
        try:
            found += known.find(context)
        except Inconclusive:
            undecided.append(known.name)
    if task is not None:
        from gpsfsm.tasks.findings import task_findings  # noqa: PLC0415

        departures, open_demands, told = task_findings(context, task)
        found += departures
        undecided += open_demands
        for each in told:
            hint = "put a step that gives no such value between the two"
            progress.fail("GP904", each, hint=f"{hint}, or let the task not ask for the value")
    progress.tell_undecided(undecided)
    progress.context = context
    return found


def _report(parsed: Parsed, path: str, options: CheckOptions, progress: _Progress) -> PlanReport:
    verdict = Verdict.ACCEPT
    if any(finding.severity is Severity.ERROR for finding in progress.findings):
        verdict = Verdict.REJECT
    if progress.undecided:
        verdict = Verdict.ERROR
    kept, suppressed, unused = apply_suppressions(
        progress.findings, parsed.suppressions, analysed=progress.analysed
    )
    shown, hidden = options.selection.split(_ordered([*kept, *unused]))
    # what the user does not want to see is hidden by the user, whatever a comment says
    suppressed, also = options.selection.split(suppressed)
    hidden = told_once(hidden, by=[*shown, *hidden])
    shown = told_once(shown, by=shown)
    return PlanReport(
        path=path,
        verdict=verdict,
        facts=progress.facts,
        findings=tuple(shown),
        suppressed=tuple(_ordered([*suppressed, *also, *hidden])),
        source=None if parsed.foreign else parsed.text,
        notes=(*parsed.notes, *_task_notes(options)),
    )


def _task_notes(options: CheckOptions) -> Iterable[str]:
    """What is to be known of a task and an engine: tasks speak of the paper's automaton."""
    if options.task is not None and options.engine != PAPER_ENGINE:
        yield (
            "the task (GP6xx) is decided by the semantics of the paper; "
            f"what {options.engine} does differently is told by GP7xx"
        )


def _ordered(findings: Sequence[Finding]) -> list[Finding]:
    """In document order; at one place by rule."""
    return sorted(
        findings,
        key=lambda finding: (
            finding.location.line,
            finding.location.column,
            finding.rule,
            finding.message,
        ),
    )
