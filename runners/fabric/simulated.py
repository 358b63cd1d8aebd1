"""The fabric in a world: plans go to the plan queue of the run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.runner import RunContext, RunnerError
from gpsfsm.runners.fabric import NO_PLAN, NO_QUEUE, check_queued
from gpsfsm.runners.prompting.simulated import PromptPlanRunner
from gpsfsm.simulation.base import Simulated, said_true, text_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.queue import PlanService
    from gpsfsm.execution.records import RunValue
    from gpsfsm.generation.service import Answered


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

    def answered(self, answer: Answered, context: RunContext) -> Mapping[str, RunValue]:
        """Submit what a model has answered; the queue knows what it was submitted already."""
        _submit(self, answer.text, context, queued=answer.ending is not None)
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


def _submit(runner: Simulated, text: str, context: RunContext, *, queued: bool = False) -> None:
    """Put a plan into the queue; ``queued``: the queue has it, and gives it once more."""
    queue: PlanService | None = runner.services.get("plans")
    if queue is None:
        raise RunnerError(NO_QUEUE)
    if not (text.strip() or queued):
        raise RunnerError(NO_PLAN)
    plan = queue.submit(text, runner.interface.rpartition("/")[2])
    check_queued(queue, plan, context)
