"""The runner of a gripper; docs/runners.md explains it."""

from collections.abc import Mapping
from typing import Any

from gpsfsm import RunContext, Runner, RunnerError


class GraspRunner(Runner):
    """Closes the gripper until the wanted force is reached."""

    simulated = True  # it waits through its context alone: it can act in a simulation too

    async def run(self, parameters: Mapping[str, Any], context: RunContext) -> dict[str, Any]:
        """Close it step by step."""
        force = parameters["force"]
        held = context.random.uniform(0.0, 0.06)  # a real gripper would measure this
        width = 0.08
        while width > held:
            await context.sleep(0.1)  # here StopRequested is raised if it is to stop
            width -= 0.004
        if held < 0.005:
            raise RunnerError(f"nothing is held with {force:g} N")
        context.log(f"holds {1000 * width:.0f} mm")
        return {"width": round(width, 3)}
