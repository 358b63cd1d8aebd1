"""``POST /v1/view``: everything that a page needs to show a plan."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import Field

from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import Answer, Name, PlanText, Request, TaskText, Wishes

if TYPE_CHECKING:
    from gpsfsm.service.worker import WorkerContext


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
        path="/v1/view",
        name="view",
        summary="What a page shows of a plan",
        request=ViewRequest,
        answer=ViewAnswer,
        work=_view,
        takes_plan=True,
    ),
)
