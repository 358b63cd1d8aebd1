"""``POST /v1/fix``: repair a plan without a language model."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import Answer, Name, PlanText, Request, Wishes

if TYPE_CHECKING:
    from gpsfsm.service.worker import WorkerContext


class FixRequest(Request):
    """A plan to repair."""

    plan: PlanText
    name: Name = "plan.xml"
    options: Wishes = Wishes()
    unsafe: bool = Field(default=False, description="Also repairs that may change the meaning.")


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


ENDPOINTS = (
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
)
