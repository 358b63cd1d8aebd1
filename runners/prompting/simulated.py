"""Prompting in a world: the answers of the model stand in the world file, or a model is asked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.runner import RunContext, RunnerError
from gpsfsm.runners import prompting
from gpsfsm.runners.prompting import ask_model
from gpsfsm.simulation.base import Simulated, said_true, text_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.execution.prompts import PromptBuffers
    from gpsfsm.execution.records import RunValue
    from gpsfsm.generation.service import Answered, Answers

_FILLING_S = (0.01, 0.05)


class Prompting(prompting.Prompt, Simulated):
    """Fills a prompt buffer, or flushes it and hands the answer over (semantics, section 8.3).

    Where the run has a model (the service ``answers``) that one answers, not the world file.
    """

    takes_s = (2.0, 8.0)  # of the model

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        """Fill at once; with flush ask the model, which takes its time and may fail."""
        answers: Answers | None = self.services.get("answers")
        flush = said_true(parameters.get("flush"))
        if flush and answers is not None:
            kept = self.buffers.kept(text_of(parameters.get("uuid")))
            least, greatest = self.settings.duration_s or self.takes_s
            usual_s = least + (greatest - least) * context.random.random()
            answered = await answers.answer(
                lambda service, log: ask_model(type(self), service, kept, parameters, log),
                context,
                usual_s=usual_s,
            )
            return self.answered(answered, context)
        if flush:
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
        answer = self.answer("\n".join((*kept, text)), context)
        if answer is not None:
            return {**self.outputs(answer.text, buffered=False), **answer.outputs}
        return self.outputs(self.made_up(kept, text), buffered=False)

    def answered(self, answer: Answered, context: RunContext) -> Mapping[str, RunValue]:
        """Hand over what a model has answered."""
        del context
        if answer.ending is not None:
            return answer.ending.outputs
        return self.outputs(answer.text, buffered=False)

    @property
    def buffers(self) -> PromptBuffers:
        """The buffers of this run."""
        return self.world.prompts

    def made_up(self, kept: Sequence[str], text: str) -> str:
        """An answer where the world file has none; raises RunnerError if there can be none."""
        del kept, text
        return "I see."


class PromptTextRunner(prompting.TextPrompt, Prompting):
    """Tells the model a text."""


class PromptPoseRunner(prompting.PosePrompt, Prompting):
    """Tells the model where the robot is."""


class PromptNamedPosesRunner(prompting.NamedPosesPrompt, Prompting):
    """Tells the model which poses of the arm have names."""


class PromptCurrentJointPoseRunner(prompting.JointsPrompt, Prompting):
    """Tells the model where the joints of the arm are."""


class PromptGripperStateRunner(prompting.GripperPrompt, Prompting):
    """Tells the model how far the gripper is open."""


class PromptCurrentCartesianPoseRunner(prompting.ArmPosePrompt, Prompting):
    """Tells the model where the hand of the arm is."""


class PromptOccupancyRunner(prompting.OccupancyPrompt, Prompting):
    """Tells the model the map."""


class PromptCapabilityRunner(prompting.CapabilityPrompt, Prompting):
    """Tells the model what the robot can do."""


class PromptSpeechRunner(prompting.SpeechPrompt, Prompting):
    """Asks the model for words to say. Without an answer in the file, the kept texts are said."""

    def made_up(self, kept: Sequence[str], text: str) -> str:
        """The content of the buffer, else the task."""
        return " ".join(kept) or text


class PromptPlanRunner(prompting.PlanPrompt, Prompting):
    """Asks the model for a plan; without one there is a plan only if the world file has it."""

    def made_up(self, kept: Sequence[str], text: str) -> str:
        """Nothing: a plan cannot be made up."""
        del kept, text
        raise RunnerError("the world file has no answer to this prompt")
