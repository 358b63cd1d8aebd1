"""Runners that prompt a language model (docs/runners.md); without one they are refused.

A prompt is the request that is made of a model, and the outputs that the answer gives. That does
not act or know of a run, so that simulated and real runners say the same, and the fills of a run
can be read again from its journal. The runners here act for real: a flush asks the language model
of the run.
"""

from __future__ import annotations

import re
from abc import abstractmethod
from itertools import zip_longest
from typing import TYPE_CHECKING

from gpsfsm.execution.prompts import PromptBuffers
from gpsfsm.execution.runner import LoadContext, RunContext, Runner, RunnerError
from gpsfsm.simulation.base import said_true, text_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import Logger
    from gpsfsm.generation.service import ModelService

_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
MAX_CELLS = 1_600
"""Cells of a map that a model is shown: each one may be a token."""
_MAX_OTHER = 6_000  # characters of what is no map that we can read
_HEAD = re.compile(
    r"width=(\d{1,6}) height=(\d{1,6}) resolution=(\d{1,6}(?:\.\d{1,9})?)(?: ([^\n]{0,100}))?"
)


class Prompt(Runner):
    """Words for a model. ``writes_plan``: what it answers is to be a plan."""

    writes_plan = False

    @classmethod
    @abstractmethod
    def prompt(cls, parameters: Mapping[str, RunValue]) -> str:
        """The text for the model."""

    @classmethod
    def question(cls, parameters: Mapping[str, RunValue]) -> str:
        """The text for a model that has to answer."""
        return cls.prompt(parameters)

    @classmethod
    def task(cls, parameters: Mapping[str, RunValue]) -> str:
        """The task; recorded answers are looked up by it."""
        return cls.prompt(parameters)

    @classmethod
    def outputs(cls, answer: str, *, buffered: bool) -> Mapping[str, RunValue]:
        """The outputs for an answer."""
        return {"response": answer, "buffered": buffered, "success": not buffered}

    @classmethod
    def filled(cls, parameters: Mapping[str, RunValue]) -> tuple[str, str] | None:
        """The uuid and the text that a success puts into the buffers; None for a flush."""
        if said_true(parameters.get("flush")):
            return None
        return text_of(parameters.get("uuid")), cls.prompt(parameters)


class TextPrompt(Prompt):
    """Tells the model a text."""

    @classmethod
    def prompt(cls, parameters: Mapping[str, RunValue]) -> str:
        """The text itself."""
        return text_of(parameters.get("text"))


class PosePrompt(Prompt):
    """Tells the model where the robot is."""

    @classmethod
    def prompt(cls, parameters: Mapping[str, RunValue]) -> str:
        """The pose in words."""
        pose = ", ".join(f"{name} {text_of(parameters.get(name))}" for name in _POSE)
        return f"The robot is at this pose: {pose}."


class NamedPosesPrompt(Prompt):
    """Tells the model which poses of the arm have names."""

    @classmethod
    def prompt(cls, parameters: Mapping[str, RunValue]) -> str:
        """A line for each name."""
        names, words = _items(parameters, "pose_names"), _items(parameters, "descriptions")
        lines = [
            f"{name}: {said}".rstrip(": ") for name, said in zip_longest(names, words, fillvalue="")
        ]
        return "\n".join(("The arm has these named poses:", *lines))


class JointsPrompt(Prompt):
    """Tells the model where joints are. ``part`` is the part of the robot that has them."""

    part = "arm"

    @classmethod
    def prompt(cls, parameters: Mapping[str, RunValue]) -> str:
        """The positions in words."""
        names = _items(parameters, "joint_names")
        pairs = zip_longest(names, _items(parameters, "joint_positions"), fillvalue="?")
        return f"The joints of the {cls.part} are at: {', '.join(map(' '.join, pairs))}."


class GripperPrompt(JointsPrompt):
    """Tells the model how far the gripper is open."""

    part = "gripper"


class ArmPosePrompt(Prompt):
    """Tells the model where the hand of the arm is."""

    @classmethod
    def prompt(cls, parameters: Mapping[str, RunValue]) -> str:
        """The pose in words."""
        names = (*_POSE, "roll", "pitch", "yaw")
        pose = ", ".join(f"{name} {text_of(parameters.get(name))}" for name in names)
        return f"The arm is at this pose: {pose}."


class OccupancyPrompt(Prompt):
    """Tells the model the map."""

    @classmethod
    def prompt(cls, parameters: Mapping[str, RunValue]) -> str:
        """The map as it arrives, with larger cells if it is a large one."""
        shortened = shortened_map(text_of(parameters.get("OccupancyGrid")))
        return f"This is the map of the robot:\n{shortened}"


class CapabilityPrompt(Prompt):
    """Tells the model what the robot can do."""

    @classmethod
    def prompt(cls, parameters: Mapping[str, RunValue]) -> str:
        """The descriptions as they arrive."""
        return f"The robot can do this:\n{text_of(parameters.get('CapabilitySpecs'))}"


class SpeechPrompt(Prompt):
    """Asks the model for words to say."""

    @classmethod
    def prompt(cls, parameters: Mapping[str, RunValue]) -> str:
        """The task; fabric-v3 calls it the text of the speech."""
        return text_of(parameters.get("task", parameters.get("speech_text")))

    @classmethod
    def question(cls, parameters: Mapping[str, RunValue]) -> str:
        """The task, and that nothing but the words is wanted."""
        return (
            f"Write what a robot says aloud for this: {cls.prompt(parameters)}\n"
            "Answer with the words alone, without quotes, explanations or Markdown."
        )

    @classmethod
    def outputs(cls, answer: str, *, buffered: bool) -> Mapping[str, RunValue]:
        """The words."""
        del buffered
        return {"text": answer}


class PlanPrompt(Prompt):
    """Asks the model for a plan."""

    writes_plan = True

    @classmethod
    def task(cls, parameters: Mapping[str, RunValue]) -> str:
        """The task itself."""
        return text_of(parameters.get("task"))

    @classmethod
    def prompt(cls, parameters: Mapping[str, RunValue]) -> str:
        """The task, and what was wrong with the last plan."""
        parts = [f"Write a plan for this task: {cls.task(parameters)}"]
        if said_true(parameters.get("replan")):
            wrong = text_of(parameters.get("FailedElements"))
            parts.append(f"The last plan was not good. {wrong}".strip())
        return "\n".join(parts)

    @classmethod
    def outputs(cls, answer: str, *, buffered: bool) -> Mapping[str, RunValue]:
        """The plan."""
        del buffered
        return {"ReceivedPlan": answer}


def _items(parameters: Mapping[str, RunValue], name: str) -> list[str]:
    """The items of a list as texts."""
    value = parameters.get(name)
    return [text_of(each) for each in (value if isinstance(value, list) else [value])]


async def ask_model(
    prompt: type[Prompt],
    service: ModelService,
    kept: Sequence[str],
    parameters: Mapping[str, RunValue],
    log: Logger,
) -> str:
    """The answer of the model to what is kept and the prompt itself. Raises RunnerError."""
    question, task, context = prompt.question(parameters), prompt.task(parameters), "\n".join(kept)
    if prompt.writes_plan:
        return await service.plan(task, question=question, log=log, context=context)
    whole = f"{context}\n{question}" if context else question
    return await service.words(whole, task=task, log=log)


def shortened_map(text: str) -> str:
    """A map in at most 1,600 cells; a large cell has something in it if any of its parts has.

    The form is that of OccupancyGridRunner: a line with ``width=`` ``height=`` ``resolution=``,
    then one line for each row, ``#`` for what has something in it. Other texts are clipped.
    """
    lines = text.strip().split("\n")
    head = _HEAD.fullmatch(lines[0].strip())
    rows = [line.strip() for line in lines[1:]]
    width = 0 if head is None else int(head[1])
    if head is None or len(rows) != int(head[2]) or any(len(row) != width for row in rows):
        return text if len(text) <= _MAX_OTHER else f"{text[:_MAX_OTHER]}…"
    side = 1
    while -(-width // side) * -(-len(rows) // side) > MAX_CELLS:
        side += 1
    if side == 1:
        return text
    coarse = [_row(rows[begin : begin + side], side) for begin in range(0, len(rows), side)]
    edge = float(head[3]) * side
    first = f"width={len(coarse[0])} height={len(coarse)} resolution={edge:g} {head[4] or ''}"
    return "\n".join((first.strip(), *coarse))


def _row(rows: list[str], side: int) -> str:
    """One row of large cells."""
    return "".join(
        "#" if any("#" in row[begin : begin + side] for row in rows) else "."
        for begin in range(0, len(rows[0]), side)
    )


class Prompting(Prompt):
    """Fills a prompt buffer, or flushes it and hands the answer over (semantics, section 8.3).

    The fill itself takes place when the success is journaled (``FillsWritten``). To ask changes
    nothing, so after a crash it is done again.
    """

    asks_model = True
    idempotent = True

    async def start(self, context: LoadContext) -> None:
        """Find model and buffers. Raises RunnerError without a model."""
        from gpsfsm.generation.service import model_of  # loads what a simulation does not need

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


class PromptTextRunner(TextPrompt, Prompting):
    """Tells the model a text."""


class PromptPoseRunner(PosePrompt, Prompting):
    """Tells the model where the robot is."""


class PromptNamedPosesRunner(NamedPosesPrompt, Prompting):
    """Tells the model which poses of the arm have names."""


class PromptCurrentJointPoseRunner(JointsPrompt, Prompting):
    """Tells the model where the joints of the arm are."""


class PromptGripperStateRunner(GripperPrompt, Prompting):
    """Tells the model how far the gripper is open."""


class PromptCurrentCartesianPoseRunner(ArmPosePrompt, Prompting):
    """Tells the model where the hand of the arm is."""


class PromptOccupancyRunner(OccupancyPrompt, Prompting):
    """Tells the model the map."""


class PromptCapabilityRunner(CapabilityPrompt, Prompting):
    """Tells the model what the robot can do."""


class PromptSpeechRunner(SpeechPrompt, Prompting):
    """Asks the model for words to say."""


class PromptPlanRunner(PlanPrompt, Prompting):
    """Asks the model for a plan, again if it is rejected."""
