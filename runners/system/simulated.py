"""The system in a world."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.simulation.base import Simulated

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import RunContext


class GetCapabilitySpecsRunner(Simulated):
    """Hands over the descriptions of what the robot can do."""

    idempotent = True
    takes_s = (0.01, 0.05)

    def act(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """One text for each capability."""
        del parameters, context
        return {"CapabilitySpecs": list(self.world.specs)}


class InputMultiplexRunner(Simulated):
    """Succeeds as soon as it is triggered: joins are made by the compiler."""

    idempotent = True
    takes_s = (0.01, 0.05)
