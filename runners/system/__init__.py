"""Runners about the system itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.runner import LoadContext, RunContext, Runner, RunnerError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue


class GetCapabilitySpecsRunner(Runner):
    """Hands over the descriptions of what the robot can do: those with which the plan is run."""

    idempotent = True

    async def start(self, context: LoadContext) -> None:
        """Find them. Raises RunnerError if the run has none."""
        texts = context.services.get("specs")
        if texts is None:
            raise RunnerError("this run has no descriptions of capabilities")
        self._specs = list(map(str, texts))

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """One text for each capability."""
        del parameters, context
        return {"CapabilitySpecs": list(self._specs)}


class InputMultiplexRunner(Runner):
    """Succeeds as soon as it is triggered: joins are made by the compiler."""

    idempotent = True

    async def run(
        self,
        parameters: Mapping[str, RunValue],
        context: RunContext,
    ) -> None:
        """Nothing is left to do."""
