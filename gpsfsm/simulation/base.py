"""What all runners that live in a world have in common."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.runner import LoadContext, RunContext, Runner, RunnerError
from gpsfsm.simulation.state import WorldState

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue
    from gpsfsm.simulation.world import Answer, Settings

__all__ = ["Simulated", "number", "said_true", "text_of"]


class Simulated(Runner):
    """A runner that lets some time pass, may fail as the world says, and then acts at once.

    ``takes_s`` is how long it usually takes, from and to; the world file can say something else.
    """

    takes_s: tuple[float, float] = (0.5, 1.5)

    world: WorldState
    interface: str
    settings: Settings

    async def start(self, context: LoadContext) -> None:
        """Find the world. Raises RunnerError without one."""
        world = context.services.get("world")
        if not isinstance(world, WorldState):
            raise RunnerError("this runner is simulated and needs a world")
        self.world = world
        self.interface = context.interface
        self.settings = world.world.settings_of(context.interface)
        self.services = context.services

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        """Wait, perhaps fail, then act."""
        await self.pass_time(context)
        return self.act(parameters, context)

    async def pass_time(self, context: RunContext) -> None:
        """Let the usual time pass; raises RunnerError if it fails by chance."""
        least, greatest = self.settings.duration_s or self.takes_s
        seconds = least + (greatest - least) * context.random.random()
        chance = context.random.random()
        await context.sleep(seconds)
        if chance < self.settings.fails:
            raise RunnerError(self.settings.message or "it failed by chance, as the world has it")

    def act(
        self,
        parameters: Mapping[str, RunValue],  # noqa: ARG002
        context: RunContext,  # noqa: ARG002
    ) -> Mapping[str, RunValue] | None:
        """What it does, at the end of its time: nothing, unless a runner says more."""
        return None

    def now(self, context: RunContext) -> float:
        """The time in the world, in seconds."""
        return self.world.begun_s + context.now_s

    def answer(self, question: str, context: RunContext) -> Answer | None:
        """What the world file says to a question here and now.

        Raises RunnerError if it says that this fails.
        """
        now = self.now(context)
        pose = self.world.pose(now)
        found = self.world.world.answer(self.interface, question, now_s=now, x=pose.x, y=pose.y)
        if found is not None and found.fails:
            error = RunnerError(found.fails)
            error.outputs = found.outputs  # not as arguments: an output may be called message
            raise error
        return found


def said_true(value: RunValue | None) -> bool:
    """Whether a parameter is true; a step before may hand it over as text."""
    return value is True or (isinstance(value, str) and value.strip().lower() == "true")


def text_of(value: RunValue | None) -> str:
    """A parameter as text; "" if it is not there."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return "\n".join(text_of(item) for item in value)
    return str(value)


def number(value: RunValue | None, default: float) -> float:
    """A parameter as a number; the default if it is not there or none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return default
    try:
        return float(value)
    except OverflowError:  # a whole number of hundreds of digits
        return default
