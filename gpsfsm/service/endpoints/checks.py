"""``POST /v1/check``, ``gate``, ``grade``, ``fix``, ``view``: work on one plan, done by a worker.

Whatever goes wrong with a gate request, the answer is no.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import Answer, Name, PlanText, Request, ShownFinding, TaskText, Wishes

if TYPE_CHECKING:
    from gpsfsm.service.worker import WorkerContext

# ---- /v1/check -----------------------------------------------------------------------------------


class CheckRequest(Request):
    """A plan to check."""

    plan: PlanText
    name: Name = "plan.xml"
    options: Wishes = Wishes()
    format: Name = Field(default="", description="A format of gpsfsm: the report in it as well.")


class CheckAnswer(Answer):
    """``ok``: the plan is accepted; ``report`` is version 1 of the JSON report."""

    ok: bool
    report: dict[str, Any]
    rendered: str | None = None


def _check(request: CheckRequest, plan: bytes, context: WorkerContext) -> CheckAnswer:
    import json

    from gpsfsm.checking import check_text
    from gpsfsm.model.report import Report
    from gpsfsm.report import find_format, render

    wanted = find_format(request.format) if request.format else None
    report = Report((check_text(plan, request.name, context.options(request.options)),))
    return CheckAnswer(
        ok=report.ok,
        report=json.loads(render(report, "json")),
        rendered=None if wanted is None else render(report, wanted.name),
    )


# ---- /v1/gate ------------------------------------------------------------------------------------


class GateRequest(Request):
    """A plan that wants to run."""

    plan: PlanText
    name: Name = "plan.xml"
    task: TaskText | None = None
    options: Wishes = Wishes()
    fail_on: Literal["error", "warning"] = "error"
    allow_suppressions: bool = Field(
        default=False, description="Comments in the plan may excuse findings."
    )
    allow_empty: bool = Field(default=False, description="A plan that does nothing passes.")
    trees: bool = Field(default=False, description="Behaviour trees are accepted too.")
    allow_approximated: bool = Field(
        default=False, description="Errors that only an over-approximation has are accepted."
    )


class DigestsShown(Answer):
    """SHA-256 of what was decided about; ``all`` is over the four others."""

    plan: str
    capabilities: str
    options: str
    version: str
    all: str


class EngineShown(Answer):
    """An engine on which any failure that nothing handles hangs; in which runs the plan does."""

    name: str
    hangs: Literal["always", "sometimes", "never", "unknown"]


class BasisShown(Answer):
    """The demands; ``task``: SHA-256 of the task, null if none was given."""

    scope: Literal["structure", "structure and task"]
    task: str | None
    engine: EngineShown | None
    allow_approximated: bool


class GateAnswer(Answer):
    """The verdict. ``basis`` says what was demanded of the plan, as in a receipt."""

    verdict: Literal["accepted", "rejected", "undecided"]
    reason: Literal["passed", "findings", "empty", "inconclusive", "unreadable"]
    message: str
    basis: BasisShown
    findings: list[ShownFinding]
    more_findings: int
    digests: DigestsShown


_MOST = 100
_ONLY_PLANS = "; behaviour trees are decided only if the request sets trees"


def _gate(request: GateRequest, plan: bytes, context: WorkerContext) -> GateAnswer:
    from gpsfsm.errors import UsageError
    from gpsfsm.gating import GateOptions, gate_text
    from gpsfsm.gating.gate_call import DEFAULT_TOTAL_RLIMIT, IDLE_IGNORE, is_idle
    from gpsfsm.model.finding import Severity
    from gpsfsm.service.worker import sent_task, shown
    from gpsfsm.syntax.source import read_source
    from gpsfsm.syntax.trees import is_trees

    if is_idle(request.options.ignore, request.fail_on):
        raise UsageError(IDLE_IGNORE.format(codes=", ".join(request.options.ignore)[:100]))
    task = None if request.task is None else sent_task(request.task)
    check = context.options(request.options, DEFAULT_TOTAL_RLIMIT)
    options = GateOptions(
        check=replace(check, task=task),
        fail_on=Severity(request.fail_on),
        allow_suppressions=request.allow_suppressions,
        allow_empty=request.allow_empty,
        allow_approximated=request.allow_approximated,
        allow_trees=request.trees,
    )
    verdict = gate_text(plan, request.name, options)
    refused_tree = not request.trees and is_trees(read_source(plan, check.limits).text or "")
    return GateAnswer(
        verdict=verdict.decision.value,
        reason=verdict.reason.value,
        message=verdict.message + (_ONLY_PLANS if refused_tree else ""),
        basis=BasisShown.model_validate(verdict.basis.to_dict()),
        findings=[shown(each) for each in verdict.findings[:_MOST]],
        more_findings=max(0, len(verdict.findings) - _MOST),
        digests=DigestsShown(**asdict(verdict.digests)),
    )


# ---- /v1/grade -----------------------------------------------------------------------------------


class GradeRequest(Request):
    """An answer of a model, and the task."""

    plan: PlanText
    task: TaskText
    name: Name = "answer.xml"
    options: Wishes = Wishes()


class GradeAnswer(Answer):
    """The grade; ``theory`` is null where it could not be decided."""

    grade: Literal["success", "partial", "failed", "undecided"]
    syntax: bool
    theory: bool | None
    reason: str


def _grade(request: GradeRequest, plan: bytes, context: WorkerContext) -> GradeAnswer:
    from gpsfsm.grading.grader import Grader
    from gpsfsm.service.worker import sent_task

    grader = Grader(sent_task(request.task), context.options(request.options))
    graded = grader.grade(plan, request.name)
    return GradeAnswer(
        grade=graded.grade.value, syntax=graded.syntax, theory=graded.theory, reason=graded.reason
    )


# ---- /v1/fix -------------------------------------------------------------------------------------


class FixRequest(Request):
    """A plan to repair."""

    plan: PlanText
    name: Name = "plan.xml"
    options: Wishes = Wishes()
    unsafe: bool = Field(
        default=False, description="Also apply repairs that may change the meaning."
    )


class Repair(Answer):
    """A repair that was done; ``line`` is that of the text as it was sent."""

    rule: str
    title: str
    line: int
    safety: Literal["safe", "unsafe"]


class FixAnswer(Answer):
    """The repaired plan, what was done to it, and the report on what remains."""

    plan: str
    changed: bool
    repairs: list[Repair]
    unsafe_left: int
    report: dict[str, Any]


def _fix(request: FixRequest, plan: bytes, context: WorkerContext) -> FixAnswer:
    import json

    from gpsfsm.fixing.engine import fix_text
    from gpsfsm.model.report import Report
    from gpsfsm.report import render

    options = context.options(request.options)
    fixed = fix_text(plan, options, unsafe=request.unsafe, path=request.name)
    return FixAnswer(
        plan=fixed.text,
        changed=fixed.text != fixed.original,
        repairs=[
            Repair(rule=each.rule, title=each.title, line=each.line, safety=each.safety.value)
            for each in fixed.applied
        ],
        unsafe_left=fixed.unsafe_left,
        report=json.loads(render(Report((fixed.report,)), "json")),
    )


# ---- /v1/view ------------------------------------------------------------------------------------


class ViewRequest(Request):
    """A plan to show, the task that it is to do and another plan, if there are such."""

    plan: PlanText
    name: Name = "plan.xml"
    options: Wishes = Wishes()
    task: TaskText | None = Field(default=None, description="Grade the plan against this task.")
    other: PlanText | None = Field(default=None, description="Compare the plan with this one.")
    other_name: Name = "other.xml"


class ViewAnswer(Answer):
    """Version 1 of the view document (docs/view.md)."""

    format: str
    version: int
    tool: str
    title: str
    rules: dict[str, dict[str, str]]
    plans: list[dict[str, Any]]
    diff: dict[str, Any] | None


def _view(request: ViewRequest, plan: bytes, context: WorkerContext) -> ViewAnswer:
    from dataclasses import replace

    from gpsfsm.checking import check_text
    from gpsfsm.service.worker import sent_task
    from gpsfsm.viewing.document import document
    from gpsfsm.viewing.plans import Viewed

    options = context.options(request.options)
    if request.task is not None:
        options = replace(options, task=sent_task(request.task))
    viewed = [Viewed(plan, check_text(plan, request.name, options))]
    if request.other is not None:
        other = request.other.encode("utf-8", "surrogatepass")
        viewed.append(Viewed(other, check_text(other, request.other_name, options)))
    return ViewAnswer(**document(viewed, options, diff=len(viewed) > 1))


ENDPOINTS = (
    Endpoint(
        method="POST",
        path="/v1/check",
        name="check",
        summary="Check a plan",
        request=CheckRequest,
        answer=CheckAnswer,
        work=_check,
        takes_plan=True,
    ),
    Endpoint(
        method="POST",
        path="/v1/gate",
        name="gate",
        summary="Decide whether a plan may run",
        request=GateRequest,
        answer=GateAnswer,
        work=_gate,
        takes_plan=True,
        refuses=True,
    ),
    Endpoint(
        method="POST",
        path="/v1/grade",
        name="grade",
        summary="Grade an answer against a task",
        request=GradeRequest,
        answer=GradeAnswer,
        work=_grade,
    ),
    Endpoint(
        method="POST",
        path="/v1/fix",
        name="fix",
        summary="Repair a plan",
        request=FixRequest,
        answer=FixAnswer,
        work=_fix,
        takes_plan=True,
    ),
    Endpoint(
        method="POST",
        path="/v1/view",
        name="view",
        summary="Return what a page shows of a plan",
        request=ViewRequest,
        answer=ViewAnswer,
        work=_view,
        takes_plan=True,
    ),
)
