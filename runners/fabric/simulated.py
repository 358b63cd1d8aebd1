"""The fabric in a world: plans go to the plan queue of the run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.records import Status
from gpsfsm.execution.runner import RunContext, RunnerError
from gpsfsm.runners.prompting.simulated import PromptPlanRunner
from gpsfsm.simulation.base import Simulated, said_true, text_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.queue import PlanService
    from gpsfsm.execution.records import RunValue

__all__ = ["FabricCompletionRunner", "FabricGeneratePlanRunner", "FabricSetPlanRunner"]


class FabricSetPlanRunner(Simulated):
    """Puts the plan that arrives into the queue."""

    takes_s = (0.05, 0.2)

    def act(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        """Submit; raises RunnerError if the plan is refused."""
        _submit(self, text_of(parameters.get("ReceivedPlan")), context)


class FabricGeneratePlanRunner(PromptPlanRunner):
    """Has the model write a plan and puts it into the queue."""

    def act(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """Fill the buffer, or ask and submit."""
        outputs = super().act(parameters, context)
        if said_true(parameters.get("flush")):
            _submit(self, text_of(outputs.get("ReceivedPlan")), context)
        return {}


class FabricCompletionRunner(Simulated):
    """Reports the end of the plan; never fails."""

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        """Report."""
        self.act(parameters, context)

    def act(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        """Write it into the log."""
        plan = text_of(parameters.get("plan_id"))
        context.log(f"the plan {plan} is complete" if plan else "the plan is complete")


def _submit(runner: Simulated, text: str, context: RunContext) -> None:
    queue: PlanService | None = runner.services.get("plans")
    if queue is None:
        raise RunnerError("there is no plan queue that could take the plan")
    if not text.strip():
        raise RunnerError("no plan was handed over")
    plan = queue.submit(text, runner.interface.rpartition("/")[2])
    if queue.status(plan) == Status.REFUSED:
        raise RunnerError(f"the plan was refused: {'; '.join(queue.findings(plan))}")
    context.log(f"queued as plan {plan}")
