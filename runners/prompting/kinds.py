"""What each prompt tells a model, and what becomes of the answer: for all runners that prompt.

Nothing here acts or knows of a run, so that simulated and real runners say the same, and the fills
of a run can be found again from its journal.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

from gpsfsm.execution.runner import Runner
from gpsfsm.runners.prompting.maps import shortened_map
from gpsfsm.simulation.base import said_true, text_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue

__all__ = [
    "CapabilityPrompt",
    "OccupancyPrompt",
    "PlanPrompt",
    "PosePrompt",
    "Prompt",
    "SpeechPrompt",
    "TextPrompt",
]

_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")


class Prompt(Runner):
    """Words for a model. ``writes_plan``: what it answers is to be a plan."""

    writes_plan = False

    @classmethod
    @abstractmethod
    def prompt(cls, parameters: Mapping[str, RunValue]) -> str:
        """What the model is told."""

    @classmethod
    def question(cls, parameters: Mapping[str, RunValue]) -> str:
        """What a model is told that has to answer."""
        return cls.prompt(parameters)

    @classmethod
    def task(cls, parameters: Mapping[str, RunValue]) -> str:
        """What it is about; recorded answers are looked up by it."""
        return cls.prompt(parameters)

    @classmethod
    def outputs(cls, answer: str, *, buffered: bool) -> Mapping[str, RunValue]:
        """What is handed over."""
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


class OccupancyPrompt(Prompt):
    """Tells the model the map."""

    @classmethod
    def prompt(cls, parameters: Mapping[str, RunValue]) -> str:
        """The map as it arrives, with larger cells if it is a large one."""
        found = shortened_map(text_of(parameters.get("OccupancyGrid")))
        return f"This is the map of the robot:\n{found}"


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
        """The task."""
        return text_of(parameters.get("task"))

    @classmethod
    def question(cls, parameters: Mapping[str, RunValue]) -> str:
        """The task, and that nothing but the words is wanted."""
        return (
            f"Write what a robot says aloud for this: {cls.prompt(parameters)}\n"
            "Answer with the words alone, without quotes, explanations or Markdown."
        )

    @classmethod
    def outputs(cls, answer: str, *, buffered: bool) -> Mapping[str, RunValue]:  # noqa: ARG003
        """The words."""
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
    def outputs(cls, answer: str, *, buffered: bool) -> Mapping[str, RunValue]:  # noqa: ARG003
        """The plan."""
        return {"ReceivedPlan": answer}
