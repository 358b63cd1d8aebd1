"""The grade of a plan against a task, and where the plan leaves it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.grading import Grader
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.checking import CheckOptions
    from gpsfsm.tasks.task import Task

__all__ = ["OF_TASKS", "task_data"]

OF_TASKS = "GP6"
"""How the codes of rules begin that tell where a plan leaves its task."""
_MOST_TEXT = 2_000


def task_data(
    text: str | bytes | None,
    path: str,
    task: Task,
    options: CheckOptions,
    findings: Sequence[dict[str, Any]],
) -> dict[str, Any]:
    """How the plan is graded; ``findings`` are the rows of what its check has found."""
    left = next((row for row in findings if row["rule"].startswith(OF_TASKS)), None)
    grade, words = "undecided", ["the text was not read"]
    if text is not None:
        graded = Grader(task, options).grade(text, path)
        grade, words = graded.grade.value, [graded.reason]
    return {
        "name": task.file,
        "text": clip(" ".join(task.text.split()), _MOST_TEXT),
        "grade": grade,
        "words": words,
        "element": -1 if left is None else left["element"],
        "line": 0 if left is None else left["line"],
        "play": -1 if left is None else left["play"],
    }
