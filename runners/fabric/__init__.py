"""Runners that hand plans to the plan queue, and what the queue says of such a plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.records import Status
from gpsfsm.execution.runner import LoadContext, RunContext, Runner, RunnerError
from gpsfsm.runners.prompting import PromptPlanRunner
from gpsfsm.simulation.base import said_true, text_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.queue import PlanService
    from gpsfsm.execution.records import RunValue

NO_QUEUE = "there is no plan queue that could take the plan"
NO_PLAN = "no plan was handed over"


def check_queued(plans: PlanService, plan: int, context: RunContext) -> None:
    """Log the number of a plan; raises RunnerError if it was refused."""
    if plans.status(plan) == Status.REFUSED:
        raise RunnerError(f"the plan was refused: {'; '.join(plans.findings(plan))}")
    context.log(f"queued as plan {plan}")


class FabricSetPlanRunner(Runner):
    """Puts the plan that arrives into the queue. After a crash it may be there already."""

    async def start(self, context: LoadContext) -> None:
        """Find the queue."""
        self._plans: PlanService | None = context.services.get("plans")
        self._name = context.interface.rpartition("/")[2]

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        """Submit; raises RunnerError if the plan is refused."""
        await _submit(self._plans, text_of(parameters.get("ReceivedPlan")), self._name, context)


class FabricGeneratePlanRunner(PromptPlanRunner):
    """Has the model write a plan and puts it into the queue."""

    idempotent = False  # a plan must not be queued twice

    async def start(self, context: LoadContext) -> None:
        """Find model, buffers and queue."""
        await super().start(context)
        self._plans: PlanService | None = context.services.get("plans")
        self._name = context.interface.rpartition("/")[2]

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """Fill the buffer, or ask and submit."""
        answer = await self.answer(parameters, context)
        if said_true(parameters.get("flush")):
            await _submit(self._plans, answer, self._name, context)
        return {}


class FabricCompletionRunner(Runner):
    """Reports the end of the plan; never fails."""

    idempotent = True

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        """Write it into the log."""
        plan = text_of(parameters.get("plan_id"))
        context.log(f"the plan {plan} is complete" if plan else "the plan is complete")


async def _submit(plans: PlanService | None, text: str, name: str, context: RunContext) -> None:
    if plans is None:
        raise RunnerError(NO_QUEUE)
    if not text.strip():
        raise RunnerError(NO_PLAN)
    check_queued(plans, await plans.submitted(text, name), context)
