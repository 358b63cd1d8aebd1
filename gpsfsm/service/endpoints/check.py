"""``POST /v1/check``: everything that can be found out about a plan."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import Field

from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import Answer, Name, PlanText, Request, Wishes

if TYPE_CHECKING:
    from gpsfsm.service.worker import WorkerContext


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
)
