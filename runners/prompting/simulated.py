"""Prompting in a world: the answers of the model stand in the world file."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

from gpsfsm.execution.runner import RunContext, RunnerError
from gpsfsm.simulation.base import Simulated, said_true, text_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.execution.records import RunValue
    from gpsfsm.simulation.buffer import PromptBuffers

__all__ = [
    "PromptCapabilityRunner",
    "PromptOccupancyRunner",
    "PromptPlanRunner",
    "PromptPoseRunner",
    "PromptSpeechRunner",
    "PromptTextRunner",
    "Prompting",
]

_FILLING_S = (0.01, 0.05)
_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")


class Prompting(Simulated):
    """Fills a prompt buffer, or flushes it and hands the answer over (semantics, section 8.3)."""

    takes_s = (2.0, 8.0)  # of the model

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        """Fill at once; with flush ask the model, which takes its time and may fail."""
        if said_true(parameters.get("flush")):
            await self.pass_time(context)
        else:
            least, greatest = _FILLING_S
            await context.sleep(least + (greatest - least) * context.random.random())
        return self.act(parameters, context)

    def act(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """Fill the buffer, or answer."""
        uuid, text = text_of(parameters.get("uuid")), self.prompt(parameters)
        if not said_true(parameters.get("flush")):
            self.buffers.fill(uuid, text)
            return self.outputs("", buffered=True)
        kept = self.buffers.kept(uuid)
        found = self.answer("\n".join((*kept, text)), context)
        if found is not None:
            return {**self.outputs(found.text, buffered=False), **found.outputs}
        return self.outputs(self.made_up(kept, text), buffered=False)

    @property
    def buffers(self) -> PromptBuffers:
        """The buffers of this run."""
        return self.world.prompts

    @abstractmethod
    def prompt(self, parameters: Mapping[str, RunValue]) -> str:
        """What the model is told."""

    def outputs(self, answer: str, *, buffered: bool) -> Mapping[str, RunValue]:
        """What is handed over."""
        return {"response": answer, "buffered": buffered, "success": not buffered}

    def made_up(self, kept: Sequence[str], text: str) -> str:  # noqa: ARG002
        """An answer where the world file has none; raises RunnerError if there can be none."""
        return "I see."


class PromptTextRunner(Prompting):
    """Tells the model a text."""

    def prompt(self, parameters: Mapping[str, RunValue]) -> str:
        """The text itself."""
        return text_of(parameters.get("text"))


class PromptPoseRunner(Prompting):
    """Tells the model where the robot is."""

    def prompt(self, parameters: Mapping[str, RunValue]) -> str:
        """The pose in words."""
        pose = ", ".join(f"{name} {text_of(parameters.get(name))}" for name in _POSE)
        return f"The robot is at this pose: {pose}."


class PromptOccupancyRunner(Prompting):
    """Tells the model the map."""

    def prompt(self, parameters: Mapping[str, RunValue]) -> str:
        """The map as it arrives."""
        return f"This is the map of the robot:\n{text_of(parameters.get('OccupancyGrid'))}"


class PromptCapabilityRunner(Prompting):
    """Tells the model what the robot can do."""

    def prompt(self, parameters: Mapping[str, RunValue]) -> str:
        """The descriptions as they arrive."""
        return f"The robot can do this:\n{text_of(parameters.get('CapabilitySpecs'))}"


class PromptSpeechRunner(Prompting):
    """Asks the model for words to say. Without an answer in the file, the kept texts are said."""

    def prompt(self, parameters: Mapping[str, RunValue]) -> str:
        """The task."""
        return text_of(parameters.get("task"))

    def outputs(self, answer: str, *, buffered: bool) -> Mapping[str, RunValue]:  # noqa: ARG002
        """The words."""
        return {"text": answer}

    def made_up(self, kept: Sequence[str], text: str) -> str:
        """What is in the buffer, else the task."""
        return " ".join(kept) or text


class PromptPlanRunner(Prompting):
    """Asks the model for a plan; there is one only if the world file has it."""

    def prompt(self, parameters: Mapping[str, RunValue]) -> str:
        """The task, and what was wrong with the last plan."""
        parts = [f"Write a plan for this task: {text_of(parameters.get('task'))}"]
        if said_true(parameters.get("replan")):
            wrong = text_of(parameters.get("FailedElements"))
            parts.append(f"The last plan was not good. {wrong}".strip())
        return "\n".join(parts)

    def outputs(self, answer: str, *, buffered: bool) -> Mapping[str, RunValue]:  # noqa: ARG002
        """The plan."""
        return {"ReceivedPlan": answer}

    def made_up(self, kept: Sequence[str], text: str) -> str:  # noqa: ARG002
        """Nothing: a plan cannot be made up."""
        raise RunnerError("the world file has no answer to this prompt")
