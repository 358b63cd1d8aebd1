"""A mission whose first two plans must give up, and what a model answers to that."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.journal_read import JournalReader
from tests.conftest import REPO

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["ARGUMENTS", "CLOSING", "ELSEWHERE", "MISSION", "MODEL", "TASK", "TO_ANNEX"]
__all__ += ["answers", "plan", "rows", "statuses", "waypoint"]

TASK = "bring it into a room, or to the window"
MODEL = ("--model", "replay:answers.jsonl")
MISSION = str(REPO / "corpus" / "missions" / "closed_door.xml")
CLOSING = str(REPO / "corpus" / "worlds" / "closing.yaml")
ARGUMENTS = (MISSION, "--world", CLOSING, *MODEL, "--task", TASK)


def waypoint(x: float, y: float) -> str:
    name = "nav2_capabilities/WaypointRunner"
    return f'<Runner interface="{name}" provider="{name}" x="{x}" y="{y}"/>'


def plan(*runners: str) -> str:
    return f"<Plan>\n{chr(10).join(runners)}\n</Plan>"


TO_ANNEX = plan(waypoint(1, 1), waypoint(6.5, 1.5))
"""The door is locked when the robot has been at the porch."""
ELSEWHERE = plan(waypoint(4, 3))


def answers(folder: Path, *texts: str, **more: Any) -> None:
    """What the model answers, in order; without texts those that lead to the end."""
    said = texts or ("Let me think.", TO_ANNEX, TO_ANNEX, ELSEWHERE)
    lines = [json.dumps({"answer": text, "latency_s": 1.5, **more}) for text in said]
    (folder / "answers.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8")


def statuses(journal: Path) -> list[str]:
    with JournalReader(str(journal)) as reader:
        assert reader.verify_queue()
        return [str(run.status) for run in reader.runs()]


def rows(journal: Path, *kinds: str) -> list[dict[str, object]]:
    """The data of the decisions of these kinds."""
    with JournalReader(str(journal)) as reader:
        return [
            json.loads(data or "{}")
            for _, _, kind, _, _, data, _ in reader.queue()
            if kind in kinds
        ]
