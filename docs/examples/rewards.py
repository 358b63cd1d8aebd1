"""Rewards of five answers to one task."""

from pathlib import Path

from gpsfsm import Rewards, rewards

TASK = "docs/examples/rounds.yaml"
GO = (
    '<Runner interface="nav2_capabilities/WaypointRunner"'
    ' provider="nav2_capabilities/WaypointRunner" x="{}" y="{}"/>'
)
LAB = GO.format(6.5, 3.0) + f'<Control type="recovery">{GO.format(6.5, 5.0)}</Control>'
GOOD = f"<Plan>{GO.format(4.0, 1.0)}{LAB}{GO.format(0.5, 3.0)}</Plan>"
ANSWERS = [
    f"Here is the plan:\n{GOOD}",
    GOOD.removesuffix("</Plan>"),
    f"<Plan>{GO.format(4.0, 1.0)}</Plan>",
    "I cannot do that.",
    Path("docs/examples/shown.xml").read_text(),
]

print(rewards(ANSWERS, TASK))
with Rewards(jobs=2, timeout_s=60.0) as grader:
    for reward in grader.batch(ANSWERS, TASK):
        print(reward.value, reward.grade, reward.reason[:60].strip())
