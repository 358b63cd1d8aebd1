"""Builds the example plans of the rules, so that they read as a list of steps."""

from __future__ import annotations

__all__ = ["control", "go", "look", "plan", "say"]


def _runner(interface: str, **parameters: str) -> str:
    words = "".join(f' {name}="{value}"' for name, value in parameters.items())
    return f'<Runner interface="{interface}" provider="{interface}"{words}/>'


def go(x: float, y: float) -> str:
    """Drive to a waypoint."""
    return _runner("nav2_capabilities/WaypointRunner", x=str(x), y=str(y))


def say(text: str) -> str:
    """Speak."""
    return _runner("perception_capabilities/SpeechRunner", text=text)


def look(prompt: str) -> str:
    """Analyse what the camera sees."""
    return _runner("perception_capabilities/ImageAnalysisRunner", prompt=prompt)


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
