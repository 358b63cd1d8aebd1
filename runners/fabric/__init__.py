"""Runners that hand plans to the plan queue, and what the queue says of such a plan."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.records import Status
from gpsfsm.execution.runner import RunContext, RunnerError

if TYPE_CHECKING:
    from gpsfsm.execution.queue import PlanService
    from gpsfsm.runners.fabric.real import (
        FabricCompletionRunner,
        FabricGeneratePlanRunner,
        FabricSetPlanRunner,
    )

__all__ = [
    "FabricCompletionRunner",
    "FabricGeneratePlanRunner",
    "FabricSetPlanRunner",
]

NO_QUEUE = "there is no plan queue that could take the plan"
NO_PLAN = "no plan was handed over"


def check_queued(plans: PlanService, plan: int, context: RunContext) -> None:
    """Log the number of a plan; raises RunnerError if it was refused."""
    if plans.status(plan) == Status.REFUSED:
        raise RunnerError(f"the plan was refused: {'; '.join(plans.findings(plan))}")
    context.log(f"queued as plan {plan}")


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.real"), name)
