"""The rules on the loops of machines: documentation of what ``machines/findings.py`` reports."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule, machine
from gpsfsm.model.finding import Severity

RULES = (
    Rule(
        code="GP313",
        name="inescapable-loop",
        severity=Severity.ERROR,
        summary="The machine can get into a loop that no outcomes lead out of.",
        why=(
            "From there on the robot repeats the same actions until somebody switches it off: "
            "neither completion nor give-up nor a standstill can be reached any more, whatever "
            "succeeds or fails."
        ),
        fix="connect an event of the loop to what leads out of it, such as its success to complete",
        bad=machine(
            "drive SUCCEEDED look",
            "look SUCCEEDED drive",
            "look FAILED drive",
            "drive FAILED drive",
        ),
        good=machine(
            "drive SUCCEEDED look", "look SUCCEEDED end", "look FAILED drive", "drive FAILED drive"
        ),
    ),
    Rule(
        code="GP314",
        name="endless-loop",
        severity=Severity.INFO,
        summary="The machine runs for ever if the same outcomes repeat.",
        why=(
            "A loop that only a success leads out of goes on as long as there is none. That is "
            "often what was wanted; a robot that tries without end may still not be. The scenario "
            "shows the shortest loop."
        ),
        fix="nothing, if that is wanted; else count the attempts, by one instance for each",
        bad=machine("drive SUCCEEDED end", "drive FAILED drive"),
        good=machine("drive SUCCEEDED end", "drive FAILED lost"),
    ),
)
