"""The ledger in a journal: the lines that are written, and what they mean without their process."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import time
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest

import gpsfsm
from gpsfsm.errors import GpsfsmError
from gpsfsm.execution.journal import Journal
from gpsfsm.execution.journal_file import silence_of
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.runner import InDoubtError, Runner, RunnerError
from gpsfsm.model.ros import RosCall, RosKind
from gpsfsm.ros.ledger import LOST, Entry, GoalState, Ledger, Said, goal_id
from gpsfsm.ros.runner import RosRunner
from gpsfsm.running.goals import ledger_of, status_lines

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import RunContext

WAYPOINT = "nav2_capabilities/WaypointRunner"
STEP = f'<Runner interface="{WAYPOINT}" provider="{WAYPOINT}" x="{{}}" y="0.0"/>'
PLAN = f'<Plan>{STEP.format(1.0)}<Control type="recovery">{STEP.format(2.0)}</Control></Plan>'
BASE = frozenset({"base"})


def test_a_journal_is_told_what_its_steps_do_not_say() -> None:
    lines: list[dict[str, Any]] = []
    ledger = Ledger()
    ledger.begin(Entry("a" * 32, "the action drive", BASE), lambda _, data: lines.append({**data}))
    for said in (Said.SENT, Said.ACCEPTED, Said.ACCEPTED, Said.ENDED):
        ledger.take("a" * 32, said)
    assert [each["ledger"] for each in lines] == ["ACCEPTED"]
    lines.clear()
    entry = Entry("b" * 32, "the action drive", BASE, may_repeat=True)
    ledger.begin(entry, lambda _, data: lines.append({**data}))
    for said in (Said.SENT, Said.SILENT, Said.ALIVE, Said.ABSENT_IN_NEW, Said.SENT, Said.SILENT):
        ledger.take("b" * 32, said)
    ledger.take("b" * 32, Said.REJECTED)
    words = [each["ledger"] for each in lines]
    assert words == ["UNKNOWN", "IN_FLIGHT", "NOT_SENT", "UNKNOWN", "ENDED"]
    assert lines[0] == {"ledger": "UNKNOWN", "goal": "b" * 32, "server": "the action drive"}


def test_a_release_ends_requests_in_the_journal_too() -> None:
    lines: list[str] = []
    ledger = Ledger()
    ledger.begin(Entry("a", "the service arm", is_request=True), lambda text, _: lines.append(text))
    ledger.take("a", Said.SENT)
    ledger.take("a", Said.SILENT)
    ledger.release()
    assert "whether it acts is unknown" in lines[0]
    assert lines[1] == f"the request to the service arm: {LOST}"


class Drive(Runner):
    """Writes the lines of a script instead of driving; each word is a state of the ledger."""

    script: tuple[str, ...] = ()
    fails = False
    keys: list[str]

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        Drive.keys.append(context.key)
        if len(Drive.keys) > 1:
            return
        entry = Entry(goal_id(context.key).hex, "the action drive")
        for word in Drive.script:
            if word == "left":
                context.log("in doubt", {"left": "unknown"})
            else:
                context.log(*replace(entry, state=GoalState(word)).line)
        if Drive.fails:
            raise RunnerError("it was aborted")


def goals(tmp_path: Path, *script: str, fails: bool = False) -> list[str]:
    """The states of the goals of a plan, whose process has ended."""
    Drive.script, Drive.fails, Drive.keys = script, fails, []
    file, journal = tmp_path / "plan.xml", str(tmp_path / "run.db")
    file.write_text(PLAN)
    gpsfsm.run(str(file), runners={WAYPOINT: Drive}, journal=journal, real=True, force=True)
    with JournalReader(journal) as reader:
        ledger = ledger_of(reader, silence_of(journal))
    assert [each.goal for each in ledger] == [goal_id(key).hex for key in Drive.keys]
    assert "uses base" in "\n".join(status_lines(ledger))
    return [f"{each.state} {each.how}" for each in ledger]


@pytest.mark.parametrize(
    ("script", "fails", "states"),
    [
        ((), False, ["ENDED succeeded"]),
        (("ACCEPTED",), False, ["ENDED succeeded"]),
        (("ACCEPTED",), True, ["ENDED failed", "ENDED succeeded"]),
        (("ACCEPTED", "UNKNOWN", "ACCEPTED"), True, ["ENDED failed", "ENDED succeeded"]),
        (("UNKNOWN",), True, ["UNKNOWN failed", "ENDED succeeded"]),
        (("UNKNOWN", "ENDED"), True, ["ENDED failed", "ENDED succeeded"]),
        (("ACCEPTED", "left"), True, ["UNKNOWN failed", "ENDED succeeded"]),
        (("UNKNOWN",), False, ["ENDED succeeded"]),
    ],
)
def test_the_states_of_goals_by_the_journal(
    tmp_path: Path, script: tuple[str, ...], fails: bool, states: list[str]
) -> None:
    assert goals(tmp_path, *script, fails=fails) == states


class Clients:
    """The action of a robot; what is cancelled does not answer."""

    def __init__(self) -> None:
        self.cancelled: list[str] = []

    def goal(self, key: str) -> Any:
        async def cancel_left(_within_s: float) -> str:
            self.cancelled.append(key)
            return "it does not answer"

        return SimpleNamespace(cancel_left=cancel_left)


@pytest.mark.parametrize("word", [None, "ended", "never", "succeeded"])
def test_a_goal_is_cancelled_whatever_a_person_says(word: str | None) -> None:
    runner, clients = RosRunner(), Clients()
    runner._call, runner._client = RosCall(RosKind.ACTION), clients
    runner._said = {} if word is None else {goal_id("k").hex: word}
    if word is None:
        with pytest.raises(InDoubtError, match="does not answer"):
            asyncio.run(runner.left("k"))
    else:
        said = "never began" if word == "never" else f"has {word}"
        assert asyncio.run(runner.left("k")).endswith(f"a person says that it {said}")
    assert clients.cancelled == ["k"]


def test_a_ledger_needs_a_run(tmp_path: Path) -> None:
    path = str(tmp_path / "run.db")
    Journal(path).close()
    with JournalReader(path) as reader, pytest.raises(GpsfsmError, match="there is no run"):
        ledger_of(reader, "")


WRITER = """
import sys, time
from gpsfsm.execution.journal import Journal
journal = Journal(sys.argv[1])
journal.beat()
print("open", flush=True)
sys.stdin.readline()
"""


def test_a_writer_lives_is_silent_or_has_ended(tmp_path: Path) -> None:
    path = tmp_path / "run.db"
    words = [sys.executable, "-c", WRITER, str(path)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(words, text=True, **pipes) as process:  # type: ignore[call-overload]
        assert process.stdout.readline() == "open\n"
        assert silence_of(str(path)) == ""
        before = time.time() - 60
        os.utime(f"{path}-lock", (before, before))
        assert "has given no sign of life for 6" in silence_of(str(path))
        process.communicate("\n")
    assert silence_of(str(path)) == "no process writes to the journal any more"
    assert silence_of(str(tmp_path / "other.db")) == "no process writes to the journal any more"
