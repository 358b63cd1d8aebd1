"""``POST /v1/gate``: may this plan run? Whatever goes wrong, the answer is no."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import Answer, Name, PlanText, Request, ShownFinding, TaskText, Wishes

if TYPE_CHECKING:
    from gpsfsm.service.worker import WorkerContext


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
    trees: bool = Field(default=False, description="Behaviour trees are plans as well.")


class DigestsShown(Answer):
    """SHA-256 of what was decided about; ``all`` is over the four others."""

    plan: str
    capabilities: str
    options: str
    version: str
    all: str


class GateAnswer(Answer):
    """The verdict. ``reason`` is inconclusive where nothing could be decided."""

    verdict: Literal["accept", "refuse"]
    reason: Literal["passed", "findings", "empty", "inconclusive", "unreadable"]
    message: str
    findings: list[ShownFinding]
    more_findings: int
    digests: DigestsShown


_MOST = 100


def _gate(request: GateRequest, plan: bytes, context: WorkerContext) -> GateAnswer:
    from gpsfsm.errors import UsageError
    from gpsfsm.gating import GateOptions, gate_text
    from gpsfsm.gating.gate_call import DEFAULT_TOTAL_RLIMIT, IDLE_IGNORE, is_idle
    from gpsfsm.model.finding import Severity
    from gpsfsm.service.worker import sent_task, shown

    if is_idle(request.options.ignore, request.fail_on):
        raise UsageError(IDLE_IGNORE.format(codes=", ".join(request.options.ignore)[:100]))
    task = None if request.task is None else sent_task(request.task)
    check = context.options(request.options, DEFAULT_TOTAL_RLIMIT)
    options = GateOptions(
        check=replace(check, task=task, trees=request.trees),
        fail_on=Severity(request.fail_on),
        allow_suppressions=request.allow_suppressions,
        allow_empty=request.allow_empty,
    )
    verdict = gate_text(plan, request.name, options)
    return GateAnswer(
        verdict=verdict.decision.value,
        reason=verdict.reason.value,
        message=verdict.message,
        findings=[shown(each) for each in verdict.findings[:_MOST]],
        more_findings=max(0, len(verdict.findings) - _MOST),
        digests=DigestsShown(**asdict(verdict.digests)),
    )


ENDPOINTS = (
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
)
