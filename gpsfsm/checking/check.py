"""The check of one plan: text → plan → automaton → verdicts → findings → report.

``_check_read`` is the way once the front end has read: ``_decide`` answers the analyses' questions
by the paper's semantics, ``engine_check`` does the same for an engine (``--engine``), the rules
find, and ``_report`` suppresses and orders. What goes wrong on the way is a finding too (GP9xx).
"""

from __future__ import annotations

import os
from dataclasses import field, replace
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.analysis.rules import NOT_FOR_TREES, rule, rules_of_plans
from gpsfsm.analysis.words import listed
from gpsfsm.capabilities.dialects import in_dialect
from gpsfsm.capabilities.library import Capabilities, bind, builtin_capabilities
from gpsfsm.checking.approximations import approximation_findings
from gpsfsm.checking.idle_options import GRAPH, Idle, idle_options
from gpsfsm.checking.includes import includes_of
from gpsfsm.checking.inputs import read_bytes
from gpsfsm.checking.option_table import HARMLESS
from gpsfsm.checking.selection import Selection, apply_suppressions, drop_repeated, without_lists
from gpsfsm.compile.plan_text import machine_in, read_plan_or_machine
from gpsfsm.errors import (
    DEBUG_VARIABLE,
    AssumptionError,
    GpsfsmError,
    InputError,
    InternalError,
    UsageError,
    is_out_of_memory,
)
from gpsfsm.late import collecting_rarely, dataclass
from gpsfsm.model.capability import Outcomes
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.report import By, Facts, PlanReport, Proof, Verdict
from gpsfsm.model.story import PAPER_ENGINE, Vocabulary
from gpsfsm.syntax import Limits, Parsed, parse
from gpsfsm.tracing import span
from gpsfsm.workers import LateError, alarm

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    import networkx as nx

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.machines.runners import StandIn
    from gpsfsm.checking.engine_check import EngineFindings
    from gpsfsm.checking.inputs import Input
    from gpsfsm.compile import Compiled
    from gpsfsm.compile.units import TreeMachine
    from gpsfsm.model.capability import Binding
    from gpsfsm.model.plan import Plan
    from gpsfsm.model.precision import Approximation
    from gpsfsm.model.tree import Forest
    from gpsfsm.syntax.trees import Includes
    from gpsfsm.tasks.task import Task

TIME_LIMIT_S = 600.0
"""The usual time limit of a plan on the command line: hardly any machine is too slow for it."""

OUT_OF_MEMORY = "memory ran out before the plan was decided"
MORE_MEMORY = "allow more memory, check with --jobs 1, or split the plan"


@dataclass(frozen=True, slots=True)
class CheckOptions:
    """Everything that a check depends on besides the plan.

    - ``capabilities``: None means the built-in library.
    - ``task``: the task that the plan must fulfil.
    - ``trees``: accept behaviour trees; callers that can only run plans set this to False. Machines
      are accepted in any case.
    - ``engine``: the profile of the engine that is to run the plan (docs/engines.md).
    - ``decides``: if False, the text is parsed and nothing about the plan is decided.
    - ``named``: the options that were set for this check, and not by a configuration file.
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
    named: frozenset[str] = frozenset()

    @property
    def described(self) -> Capabilities:
        """The capabilities in use, under the names of the engine."""
        return in_dialect(self.capabilities or builtin_capabilities(), self.engine)


@dataclass(slots=True)
class _Progress:
    """The state of a check; ``undecided`` means that gpsfsm could not decide."""

    findings: list[Finding] = field(default_factory=list)
    facts: Facts | None = None
    undecided: bool = False
    analysed: bool = False
    context: Context | None = None
    proof: Proof | None = None
    forest: Forest | None = None
    approximations: list[Approximation] = field(default_factory=list)

    def fail(self, code: str, message: str, *, hint: str = "") -> None:
        """Record why there is no verdict."""
        self.findings.append(rule(code).finding(message, Location(1, 1, "/Plan"), hint=hint))
        self.undecided = True

    def record_open(self, names: Sequence[str]) -> None:
        """Record what a limit kept open, if anything."""
        if names:
            open_ = [name.replace("_", " ") for name in dict.fromkeys(names)]
            self.fail(
                "GP904", f"the step limit was reached before these were decided: {listed(open_)}"
            )


def check_text(
    text: str | bytes, path: str, options: CheckOptions, includes: Includes | None = None
) -> PlanReport:
    """Check one plan. Never raises for anything that is in the text.

    ``includes`` are the files that a behaviour tree includes; without them it may include none. A
    defect of gpsfsm that the text brings to light is reported as GP903, unless the environment says
    that it is to be shown. Raises UsageError for options that make no sense.
    """

    def checked() -> PlanReport:
        with span("gpsfsm.read"):
            parsed = _read(text, path, options, includes)
        return _check_read(parsed, text, path, options)

    return _guarded(checked, path)


def check_graph(graph: nx.Graph[Any], options: CheckOptions) -> PlanReport:
    """Check a machine that is a graph of networkx. Never raises for anything that is in it.

    Raises UsageError for options that make no sense.
    """
    from gpsfsm.compile.machines import machine_of

    path = GRAPH

    def checked() -> PlanReport:
        machine, problems = machine_of(graph, file=path)
        return _check_read(Parsed(path, "", machine, problems, machine=True), "", path, options)

    return _guarded(checked, path)


def _guarded(checked: Callable[[], PlanReport], path: str) -> PlanReport:
    """The report of a check, or of what went wrong in it."""
    try:
        with collecting_rarely(), span("gpsfsm.check") as whole:
            report = checked()
            whole.note(**{"gpsfsm.verdict": report.verdict.value})
            return report
    except UsageError:
        raise
    except RecursionError:
        return undecided(path, "the plan is nested too deeply to be decided", hint="split the plan")
    except InternalError as error:
        return failed(path, str(error))
    except Exception as error:
        if is_out_of_memory(error):
            return undecided(path, OUT_OF_MEMORY, hint=MORE_MEMORY)
        if os.environ.get(DEBUG_VARIABLE):
            raise
        what = f"{type(error).__name__}: {error}"
        return failed(path, f"the check of this plan failed ({what}); this is a defect of gpsfsm")


def check_input(item: Input, options: CheckOptions) -> PlanReport:
    """Read and check one plan; what cannot be read or checked is reported, never raised.

    Raises UsageError for options that make no sense.
    """
    try:
        text = read_bytes(item, options.limits.max_bytes)
    except InputError as error:
        return unreadable(item.path, str(error))
    return check_text(text, item.path, options, includes_of(item, text, options.limits))


def check_in_time(item: Input, options: CheckOptions) -> PlanReport:
    """As ``check_input``, for a command: what takes longer than is usual is undecided."""
    try:
        with alarm(TIME_LIMIT_S):
            return check_input(item, options)
    except LateError:
        return too_late(item.path, TIME_LIMIT_S)


def options_for(inputs: Sequence[Input], options: CheckOptions) -> CheckOptions:
    """The options under which inputs are checked: answers are read as with ``--from-response``.

    Raises UsageError for plans beside answers, which are read as they are.
    """
    if options.from_response or not any(each.answers for each in inputs):
        return options
    if not all(each.answers for each in inputs):
        raise UsageError(
            "answers in JSON lines are read as with --from-response, but plans are not; "
            "check them in two calls, or pass --from-response for all"
        )
    return replace(options, from_response=True)


def _read(text: str | bytes, path: str, options: CheckOptions, includes: Includes | None) -> Parsed:
    if not options.trees:
        machine = None
        if not options.from_response:
            machine = machine_in(text, file=path, limits=options.limits)
        return machine or parse(
            text, file=path, limits=options.limits, from_response=options.from_response
        )
    return read_plan_or_machine(
        text,
        file=path,
        limits=options.limits,
        from_response=options.from_response,
        includes=includes,
    )


def _check_read(parsed: Parsed, text: str | bytes, path: str, options: CheckOptions) -> PlanReport:
    progress = _Progress([rule(problem.rule).finding_of(problem) for problem in parsed.problems])
    progress.undecided = parsed.over_limit or parsed.lost
    progress.forest = parsed.forest
    progress.approximations = [*parsed.approximations]
    idle = _idle(parsed, options) if parsed.plan is not None and options.decides else ()
    refused = [each for each in idle if each.option not in HARMLESS or each.option in options.named]
    for each in refused:
        progress.fail("GP908", each.message)
    if parsed.plan is not None and options.decides and not refused:
        _decide(parsed.plan, options, progress)
    wrong = any(each.severity is Severity.ERROR for each in progress.findings)
    if parsed.plan is None and not (wrong or progress.undecided):
        progress.fail("GP903", "no error says why nothing was read; this is a defect of gpsfsm")
    on_engine: EngineFindings | GpsfsmError | None = None
    if options.engine != PAPER_ENGINE and not (
        parsed.over_limit or parsed.foreign or parsed.machine or parsed.trees
    ):
        # An engine reads the bytes as they are; of an answer it gets the plan.
        source = parsed.body if options.from_response and parsed.body else text
        on_engine = _check_on_engine(source, path, options, progress.context)
    if progress.context is not None:
        if on_engine is not None and not isinstance(on_engine, GpsfsmError):
            progress.context.engine = on_engine.contexts
        with span("gpsfsm.rules"):
            _find(progress.context, options.task, progress)
    if options.analysis.require_proof:
        _require_proof(progress)
    if parsed.trees:
        progress.findings = _once_per_place(progress.findings)
    if on_engine is not None:
        _add_engine_findings(on_engine, options.engine, progress)
    notes = tuple(each.message for each in idle if each not in refused)
    return _report(replace(parsed, notes=(*parsed.notes, *notes)), path, options, progress)


def _idle(parsed: Parsed, options: CheckOptions) -> tuple[Idle, ...]:
    return idle_options(
        parsed,
        options.analysis,
        options.limits,
        task=options.task is not None,
        engine=options.engine,
        from_response=options.from_response,
    )


def unreadable(path: str, message: str) -> PlanReport:
    """The report of an input that could not be read."""
    finding = rule("GP901").finding(message, Location(1, 1))
    return PlanReport(path, Verdict.UNDECIDED, None, (finding,))


def undecided(path: str, message: str, *, hint: str) -> PlanReport:
    """The report of a plan for which the time or the memory was not enough."""
    finding = rule("GP904").finding(message, Location(1, 1), hint=hint)
    return PlanReport(path, Verdict.UNDECIDED, None, (finding,))


def too_late(path: str, limit_s: float) -> PlanReport:
    """The report of a plan whose check was ended by the clock."""
    message = f"the plan is undecided after {limit_s:g} s (time limit)"
    return undecided(
        path, message, hint="allow more time, split the plan, or drop some assumptions"
    )


def failed(path: str, message: str, *, hint: str = "") -> PlanReport:
    """The report of a plan that could not be checked, through no fault of its own."""
    finding = rule("GP903").finding(message, Location(1, 1), hint=hint)
    return PlanReport(path, Verdict.UNDECIDED, None, (finding,))


def _decide(plan: Plan, check: CheckOptions, progress: _Progress) -> None:
    """Decide everything; what goes wrong becomes a finding and ``undecided``."""
    from gpsfsm.analysis.constraints import constraints_under
    from gpsfsm.compile import MachinePlan, compile_plan

    options, capabilities = check.analysis, check.described
    leaves: Sequence[StandIn] = ()
    if plan.vocabulary is Vocabulary.TREE:
        from gpsfsm.analysis.machines.runners import leaf_findings, stand_ins

        leaves = stand_ins(plan, progress.forest, capabilities)
    bindings = tuple(each.acting for each in leaves) or bind(plan, capabilities.library)
    progress.findings = without_lists(progress.findings, bindings)
    try:
        with span("gpsfsm.compile"):
            start_chain = "no-start" in options.faults
            compiled = compile_plan(plan, start_chain=start_chain, bindings=bindings)
            constraints = constraints_under(options, compiled)
    except AssumptionError as error:
        progress.fail("GP907", error.summary, hint=error.hint)
        return
    progress.findings += _unmatched(constraints, plan)
    if leaves:
        progress.findings += leaf_findings(compiled, leaves, capabilities, options)
    if isinstance(plan, MachinePlan):
        coarser = _decide_machine(compiled, constraints, check, progress)
        if coarser is not None:
            _decide(coarser, check, progress)
        else:
            progress.approximations += plan.approximations
        return
    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.decide import decide

    try:
        with span("gpsfsm.decide"):
            decided = decide(compiled, constraints, options)
        if decided.contradictory:
            progress.fail("GP902", contradiction(bindings))
            return
        progress.facts = decided.facts()
        progress.proof = decided.proof
        progress.context = Context(decided, capabilities)
    except InternalError as error:
        progress.facts = None
        progress.fail("GP903", str(error))


def _unmatched(constraints: Constraints, plan: Plan) -> Iterable[Finding]:
    for text in constraints.unmatched:
        message = f"the assumption matches no runner of this plan: {text}"
        yield rule("GP906").finding(message, plan.location(0))


def _decide_machine(
    compiled: Compiled, constraints: Constraints, check: CheckOptions, progress: _Progress
) -> TreeMachine | None:
    """Decide a machine; or the machine that is to be decided in its place, as it is too large."""
    from gpsfsm.analysis.options import InconclusiveError
    from gpsfsm.checking.machine_check import (
        decide_machine,
        findings_of_runners,
        overlap_findings,
    )

    if not all(constraints.allowed):
        progress.fail("GP902", contradiction(compiled.bindings))
        return None
    try:
        with span("gpsfsm.decide"):
            decided = decide_machine(compiled, constraints, check.analysis)
    except InternalError as error:
        progress.fail("GP903", str(error))
        return None
    if decided.contradictory:
        progress.fail("GP902", contradiction(compiled.bindings))
        return None
    if decided.too_large:
        coarser = _with_loops(compiled.automaton.plan, progress)
        if coarser is not None:
            return coarser
    if decided.reason:
        progress.fail("GP904", decided.reason, hint=decided.hint)
    progress.facts, progress.proof = decided.facts, decided.proof
    progress.findings += decided.findings
    if compiled.automaton.plan.vocabulary is not Vocabulary.TREE:  # its leaves are no runners
        progress.findings += findings_of_runners(compiled, check.described, check.analysis, decided)
    if decided.facts is not None:
        try:
            progress.findings += overlap_findings(compiled, constraints, check.analysis)
        except InconclusiveError:
            progress.record_open(["resource-overlap"])
        except InternalError as error:
            progress.fail("GP903", str(error))
            progress.facts = None
    progress.analysed = True
    return None


def _with_loops(plan: Plan, progress: _Progress) -> TreeMachine | None:
    """The machine of a behaviour tree in which no loop is written out; None if that is the same."""
    from gpsfsm.compile.tree_machine import machine_of_tree
    from gpsfsm.compile.units import TreeMachine

    if not isinstance(plan, TreeMachine) or progress.forest is None:
        return None
    coarser = machine_of_tree(progress.forest, (0,))
    if coarser is None or len(coarser.runners) >= len(plan.runners):
        return None
    return coarser


def _check_on_engine(
    text: str | bytes, path: str, options: CheckOptions, paper: Context | None
) -> EngineFindings | GpsfsmError:
    """The behaviour of the plan on the engine, or the reason why it is not known."""
    from gpsfsm.checking.engine_check import check_on_engine

    try:
        return check_on_engine(
            text,
            options.engine,
            options.analysis,
            options.described,
            file=path,
            limits=options.limits,
            paper=paper,
        )
    except (InputError, AssumptionError, InternalError) as error:
        return error


def _add_engine_findings(
    on_engine: EngineFindings | GpsfsmError, engine: str, progress: _Progress
) -> None:
    """The facts of the engine take the place of the paper's, and its findings are added."""
    if not isinstance(on_engine, GpsfsmError):
        progress.facts, progress.proof = on_engine.facts, on_engine.proof
        if on_engine.contradictory and not progress.undecided:
            progress.fail("GP902", f"the assumptions and options admit no scenario on {engine}")
        progress.findings += on_engine.findings
        progress.record_open(on_engine.undecided)
        return
    progress.facts = None
    if isinstance(on_engine, AssumptionError):  # the engine may see another plan than we do
        if not progress.undecided:
            progress.fail("GP907", on_engine.summary, hint=on_engine.hint)
    elif isinstance(on_engine, InputError):
        progress.fail("GP103", f"{engine} reads more elements in this text: {on_engine}")
    else:
        progress.fail("GP903", str(on_engine))


def contradiction(bindings: Iterable[Binding | None]) -> str:
    """The message about assumptions that admit no scenario."""
    declared = any(binding and binding.provider.outcomes != Outcomes() for binding in bindings)
    causes = "assumptions, options and declared outcomes" if declared else "assumptions and options"
    return f"the {causes} admit no scenario of this plan"


def _find(context: Context, task: Task | None, progress: _Progress) -> None:
    """Add what the rules make of the verdicts, and where the plan leaves its task."""
    from gpsfsm.analysis.solver import InconclusiveError

    trees = context.plan.vocabulary is Vocabulary.TREE
    undecided: list[str] = list(context.inconclusive)
    findings: list[Finding] = []
    try:
        for each in rules_of_plans():
            if trees and each.code in NOT_FOR_TREES:
                continue
            assert each.find is not None
            try:
                findings += each.find(context)
            except InconclusiveError:
                undecided.append(each.name)
        if task is not None:
            findings += _task_findings(context, task, undecided, progress)
    except InternalError as error:
        progress.facts = None
        progress.fail("GP903", str(error))
        return
    progress.record_open(undecided)
    progress.findings += findings
    progress.analysed = True


def _task_findings(
    context: Context, task: Task, undecided: list[str], progress: _Progress
) -> Iterable[Finding]:
    from gpsfsm.tasks.deciding import task_findings

    departures, open_demands, unclear, basis = task_findings(context, task)
    undecided += open_demands
    if basis and progress.proof is not None:
        by = {By(each.decided_by) for each in basis}
        weakest = next(each for each in (By.SEARCH, By.Z3, By.REPLAY) if each in by)
        progress.proof = Proof(
            {**progress.proof.decided_by, "task": weakest},
            {**progress.proof.unproved, **({"task": "--rlimit"} if weakest is By.SEARCH else {})},
        )
    for message in unclear:
        hint = "put a step that outputs no such value between the two"
        progress.fail("GP904", message, hint=f"{hint}, or remove the value from the task")
    return departures


def _require_proof(progress: _Progress) -> None:
    """Record that the plan is undecided if something was not proved."""
    proof = progress.proof
    if progress.facts is not None and proof is not None and proof.unproved:
        message = f"not proved ({', '.join(proof.limits)}): {', '.join(proof.unproved)}"
        hint = "raise --rlimit or --total-rlimit, leave --solver out, or split the plan"
        progress.fail("GP904", message, hint=hint)


def _report(parsed: Parsed, path: str, options: CheckOptions, progress: _Progress) -> PlanReport:
    approximations = tuple(sorted(progress.approximations, key=lambda each: each.location.order))
    terms = (Vocabulary.PLAN if parsed.plan is None else parsed.plan.vocabulary).terms
    progress.findings += approximation_findings(approximations, terms)
    verdict = Verdict.ACCEPTED
    if any(finding.severity is Severity.ERROR for finding in progress.findings):
        verdict = Verdict.REJECTED
    if progress.undecided:
        verdict = Verdict.UNDECIDED
    kept, suppressed, unused = apply_suppressions(
        progress.findings, parsed.suppressions, analysed=progress.analysed
    )
    shown, hidden = options.selection.split(_ordered([*kept, *unused]))
    # what the user does not want to see is hidden by the user, whatever a comment says
    suppressed, also = options.selection.split(suppressed)
    hidden = drop_repeated(hidden, by=[*shown, *hidden])
    shown = drop_repeated(shown, by=shown)
    return PlanReport(
        path=path,
        verdict=verdict,
        facts=progress.facts,
        proof=None if progress.facts is None else progress.proof,
        findings=tuple(shown),
        suppressed=tuple(_ordered([*suppressed, *also, *hidden])),
        source=None if parsed.foreign else parsed.text,
        included=parsed.included,
        approximations=approximations,
        notes=(*parsed.notes, *_task_notes(options)),
        machine=parsed.machine,
    )


def _task_notes(options: CheckOptions) -> Iterable[str]:
    """A note on a task beside an engine: tasks speak of the paper's automaton."""
    if options.task is not None and options.engine != PAPER_ENGINE:
        yield (
            "the task (GP6xx) is decided by the semantics of the paper; "
            f"GP7xx reports what {options.engine} does differently"
        )


def _ordered(findings: Sequence[Finding]) -> list[Finding]:
    """In document order; at one place by rule."""
    return sorted(
        findings,
        key=lambda finding: (*finding.location.order, finding.rule, finding.message),
    )


def _once_per_place(findings: Iterable[Finding]) -> list[Finding]:
    """The findings without those of the further uses of a node, of which the same is said.

    A node that runs several times, in a Retry or a SubTree, has a use for each time.
    """
    first: dict[tuple[object, ...], Finding] = {}
    for finding in findings:
        place = finding.location
        first.setdefault((finding.rule, place.order, finding.message), finding)
    return list(first.values())
