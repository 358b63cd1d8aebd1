"""``POST /v1/grade``: grade a model's answer against a task."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import Answer, Name, PlanText, Request, TaskText, Wishes

if TYPE_CHECKING:
    from gpsfsm.service.worker import WorkerContext


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


ENDPOINTS = (
    Endpoint(
        method="POST",
        path="/v1/grade",
        name="grade",
        summary="Grade an answer against a task",
        request=GradeRequest,
        answer=GradeAnswer,
        work=_grade,
    ),
)
