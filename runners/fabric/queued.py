"""What the queue says of a plan that a runner has submitted."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.records import Status
from gpsfsm.execution.runner import RunContext, RunnerError

if TYPE_CHECKING:
    from gpsfsm.execution.queue import PlanService

__all__ = ["NO_PLAN", "NO_QUEUE", "check_queued"]

NO_QUEUE = "there is no plan queue that could take the plan"
NO_PLAN = "no plan was handed over"


def check_queued(plans: PlanService, plan: int, context: RunContext) -> None:
    """Tell the number of a plan; raises RunnerError if it was refused."""
    if plans.status(plan) == Status.REFUSED:
        raise RunnerError(f"the plan was refused: {'; '.join(plans.findings(plan))}")
    context.log(f"queued as plan {plan}")
