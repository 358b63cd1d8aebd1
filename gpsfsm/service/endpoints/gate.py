"""``POST /v1/gate``: may this plan run? Whatever goes wrong, the answer is no."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import Answer, Name, PlanText, Request, ShownFinding, TaskText, Wishes

if TYPE_CHECKING:
    from gpsfsm.service.kitchen import Kitchen

__all__ = ["ENDPOINTS", "GateAnswer", "GateRequest"]


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


def _gate(request: GateRequest, plan: bytes, kitchen: Kitchen) -> GateAnswer:
    from gpsfsm.gating import GateOptions, gate_text  # noqa: PLC0415  (loads the analyses)
    from gpsfsm.gating.asking import DEFAULT_TOTAL_RLIMIT  # noqa: PLC0415
    from gpsfsm.model.finding import Severity  # noqa: PLC0415
    from gpsfsm.service.kitchen import sent_task, shown  # noqa: PLC0415

    task = None if request.task is None else sent_task(request.task)
    check = kitchen.options(request.options, DEFAULT_TOTAL_RLIMIT)
    options = GateOptions(
        check=replace(check, task=task, trees=request.trees),
        fail_on=Severity(request.fail_on),
        allow_suppressions=request.allow_suppressions,
        allow_empty=request.allow_empty,
    )
    found = gate_text(plan, request.name, options)
    return GateAnswer(
        verdict=found.decision.value,
        reason=found.reason.value,
        message=found.message,
        findings=[shown(each) for each in found.findings[:_MOST]],
        more_findings=max(0, len(found.findings) - _MOST),
        digests=DigestsShown(**asdict(found.digests)),
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
