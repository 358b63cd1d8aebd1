"""The runner of the tutorial: it rings a bell and waits for somebody."""

from collections.abc import Mapping
from typing import Any

from gpsfsm import RunContext, Runner, RunnerError


class RingRunner(Runner):
    """Rings the bell; fails if nobody comes in time."""

    simulated = True  # waits only through its context, so it also works in simulation

    async def run(self, parameters: Mapping[str, Any], context: RunContext) -> dict[str, Any]:
        """Ring, and wait as long as the plan says."""
        needed = context.random.uniform(0.2, 8.0)  # a real runner would query the door
        if needed > parameters["patience_s"]:
            await context.sleep(parameters["patience_s"])
            raise RunnerError("nobody came")
        await context.sleep(needed)
        return {"waited_s": round(needed, 1)}
