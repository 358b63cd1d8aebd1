"""Rules: documentation, metadata, and for many a function from verdicts to findings.

Their example plans are built by the functions below ``Rule``, so that they read as lists of steps.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.late import dataclass
from gpsfsm.model.finding import Confidence, Finding, Problem, Related, Scenario, Severity
from gpsfsm.model.story import PLAN_TERMS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.on_engine import OnEngine
    from gpsfsm.model.plan import Location
    from gpsfsm.model.story import Terms


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule of the catalogue.

    ``code`` and ``name`` are stable; the name reads as "allow <name>". ``summary`` says in one
    line what is found, ``why`` why it matters, ``fix`` what to do. ``bad`` and ``good`` are plans:
    a test checks that the rule finds something in the first and nothing in the second, with
    ``options`` (command line words such as ``--consistent``) where the rule needs them.
    ``severities`` explains when another severity than ``severity`` is used. ``spread``: the related
    places of a finding are further places of the same. Only rules of
    GP2xx to GP5xx have ``find``, and most of GP7xx ``find_on_engine``; the others are reported
    where their cause is met.
    """

    code: str
    name: str
    severity: Severity
    summary: str
    why: str
    fix: str
    bad: str
    good: str
    options: tuple[str, ...] = ()
    severities: str = ""
    spread: bool = False
    confidence: Confidence = Confidence.PROVED
    find: Callable[[Context], Iterable[Finding]] | None = None
    find_on_engine: Callable[[OnEngine], Iterable[Finding]] | None = None

    def finding(
        self,
        message: str,
        location: Location,
        *,
        severity: Severity | None = None,
        hint: str = "",
        related: tuple[Related, ...] = (),
        scenario: Scenario | None = None,
        length: int = 0,
        unless: str = "",
        terms: Terms = PLAN_TERMS,
    ) -> Finding:
        """A finding of this rule; ``severity`` and ``hint`` default to the rule's own.

        The rule's own hint speaks of plans; ``terms`` are those of what is checked instead.

        ``unless``: the rule that tells the same; the finding is for those who do not see that one.
        """
        return Finding(
            rule=self.code,
            name=self.name,
            severity=severity or self.severity,
            message=message,
            location=location,
            hint=hint or self.fix.replace("the plan", f"the {terms.whole}"),
            length=length or _tag_length(location.element),
            related=related,
            scenario=scenario,
            confidence=self.confidence,
            unless=unless,
        )

    def finding_of(self, problem: Problem) -> Finding:
        """The finding for a problem that the front end reported."""
        return self.finding(
            problem.message,
            problem.location,
            severity=problem.severity,
            hint=problem.hint,
            related=problem.related,
            length=problem.length,
        )


def _tag_length(element: str) -> int:
    """The length of ``<Runner`` for ``/Plan/Runner[2]``: what is underlined."""
    tag = element.rpartition("/")[2].partition("[")[0]
    return len(tag) + 1 if tag else 0


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


def ask(question: str) -> str:
    """Check a condition by what the camera sees."""
    return runner("perception_capabilities/CheckRunner", prompt=question)


def wait(seconds: float) -> str:
    """Do nothing for some time."""
    return runner("generic_capabilities/WaitRunner", seconds=str(seconds))


def hear() -> str:
    """Listen to what is said."""
    return runner("perception_capabilities/TranscribeRunner")


def locate() -> str:
    """Locate the robot."""
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


def machine(*connections: str) -> str:
    """A machine that begins with ``drive`` and ends at ``end`` or ``lost``.

    Connections are written ``drive FAILED look``.
    """
    rows = [connection.split() for connection in ("go SUCCEEDED drive", *connections)]
    kinds = {
        "go": '"kind": "start"',
        "drive": '"kind": "runner", "interface": "nav2_capabilities/WaypointRunner", '
        '"parameters": {"x": 2.0, "y": -0.5}',
        "look": '"kind": "runner", "interface": "perception_capabilities/ImageAnalysisRunner", '
        '"parameters": {"prompt": "Is the shelf full?"}',
        "end": '"kind": "complete"',
        "lost": '"kind": "give_up"',
    }
    names = dict.fromkeys(name for source, _, target in rows for name in (source, target))
    nodes = ",\n".join(f'  {{"id": "{name}", {kinds[name]}}}' for name in names)
    edges = ",\n".join(
        f'  {{"source": "{source}", "event": "{event}", "target": "{target}"}}'
        for source, event, target in rows
    )
    return f'{{"nodes": [\n{nodes}\n ],\n "edges": [\n{edges}\n ]}}\n'


def _indented(steps: tuple[str, ...]) -> str:
    lines = (line for step in steps for line in step.splitlines())
    return "".join(f"    {line}\n" for line in lines)


ROUNDS_TASK = ("--task", "docs/examples/rounds.yaml")
"""The options with which a plan is checked against the task of the examples."""

ROUNDS = (go(4.0, 1.0), go(6.5, 3.0), control("recovery", go(6.5, 5.0)), go(0.5, 3.0))
"""The steps of a plan that fulfils this task."""
