"""Builds the example plans of the rules, so that they read as a list of steps."""

from __future__ import annotations

__all__ = [
    "ROUNDS",
    "ROUNDS_TASK",
    "ask_plan",
    "control",
    "go",
    "hear",
    "locate",
    "look",
    "note",
    "phrase",
    "plan",
    "runner",
    "say",
    "set_plan",
    "tell_pose",
    "wait",
]


def runner(interface: str, **parameters: str) -> str:
    """Any runner, with its provider of the same name."""
    words = "".join(f' {name}="{value}"' for name, value in parameters.items())
    return f'<Runner interface="{interface}" provider="{interface}"{words}/>'


def go(x: float, y: float) -> str:
    """Drive to a waypoint."""
    return runner("nav2_capabilities/WaypointRunner", x=str(x), y=str(y))


def say(text: str) -> str:
    """Speak."""
    return runner("perception_capabilities/SpeechRunner", text=text)


def look(prompt: str) -> str:
    """Analyse what the camera sees."""
    return runner("perception_capabilities/ImageAnalysisRunner", prompt=prompt)


def wait(seconds: float) -> str:
    """Do nothing for some time."""
    return runner("generic_capabilities/WaitRunner", seconds=str(seconds))


def hear() -> str:
    """Listen to what is said."""
    return runner("perception_capabilities/TranscribeRunner")


def locate() -> str:
    """Where the robot is."""
    return runner("nav2_capabilities/RobotPoseRunner")


def tell_pose(**parameters: str) -> str:
    """Put the pose that arrives into a prompt."""
    return runner("prompt_capabilities/PromptPoseRunner", **parameters)


def note(**parameters: str) -> str:
    """Put a text into a prompt."""
    return runner("prompt_capabilities/PromptTextRunner", **parameters)


def phrase(task: str, **parameters: str) -> str:
    """Have a model write what to say."""
    return runner("prompt_capabilities/PromptSpeechRunner", task=task, **parameters)


def ask_plan(task: str, **parameters: str) -> str:
    """Have a model write a plan."""
    return runner("prompt_capabilities/PromptPlanRunner", task=task, **parameters)


def set_plan() -> str:
    """Queue the plan that arrives."""
    return runner("fabric_capabilities/FabricSetPlanRunner")


def control(control_type: str, *steps: str, name: str = "") -> str:
    """A control around steps."""
    label = f' name="{name}"' if name else ""
    return f'<Control type="{control_type}"{label}>\n{_indented(steps)}</Control>'


def plan(*steps: str) -> str:
    """A whole plan."""
    return f"<Plan>\n{_indented(steps)}</Plan>\n"


def _indented(steps: tuple[str, ...]) -> str:
    lines = (line for step in steps for line in step.splitlines())
    return "".join(f"    {line}\n" for line in lines)


ROUNDS_TASK = ("--task", "docs/examples/rounds.yaml")
"""The options with which a plan is checked against the task of the examples."""

ROUNDS = (go(4.0, 1.0), go(6.5, 3.0), control("recovery", go(6.5, 5.0)), go(0.5, 3.0))
"""The steps of a plan that fulfils this task."""
