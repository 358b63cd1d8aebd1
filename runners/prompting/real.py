"""Prompting for real: a flush asks the language model of the run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.prompts import PromptBuffers
from gpsfsm.execution.runner import LoadContext, RunContext, RunnerError
from gpsfsm.generation.service import model_of
from gpsfsm.runners import prompting
from gpsfsm.runners.prompting import ask_model
from gpsfsm.simulation.base import said_true, text_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue


class Prompting(prompting.Prompt):
    """Fills a prompt buffer, or flushes it and hands the answer over (semantics, section 8.3).

    The fill itself takes place when the success is journaled (``FillsWritten``). To ask changes
    nothing, so after a crash it is done again.
    """

    asks_model = True
    idempotent = True

    async def start(self, context: LoadContext) -> None:
        """Find model and buffers. Raises RunnerError without a model."""
        self._service = model_of(context)
        self._buffers: PromptBuffers = context.services.get("prompts") or PromptBuffers()

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        """Fill at once; with flush ask, however long that takes."""
        return self.outputs(
            await self.answer(parameters, context),
            buffered=not said_true(parameters.get("flush")),
        )

    async def answer(self, parameters: Mapping[str, RunValue], context: RunContext) -> str:
        """The answer, "" for a fill. Raises RunnerError."""
        uuid = text_of(parameters.get("uuid"))
        if not said_true(parameters.get("flush")):
            try:
                self._buffers.check(uuid, self.prompt(parameters))
            except OverflowError as error:
                raise RunnerError(str(error)) from None
            return ""
        kept = self._buffers.kept(uuid)
        return await ask_model(type(self), self._service, kept, parameters, context.log)


class PromptTextRunner(prompting.TextPrompt, Prompting):
    """Tells the model a text."""


class PromptPoseRunner(prompting.PosePrompt, Prompting):
    """Tells the model where the robot is."""


class PromptOccupancyRunner(prompting.OccupancyPrompt, Prompting):
    """Tells the model the map."""


class PromptCapabilityRunner(prompting.CapabilityPrompt, Prompting):
    """Tells the model what the robot can do."""


class PromptSpeechRunner(prompting.SpeechPrompt, Prompting):
    """Asks the model for words to say."""


class PromptPlanRunner(prompting.PlanPrompt, Prompting):
    """Asks the model for a plan, again if it is rejected."""
