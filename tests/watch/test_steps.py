"""The steps that a model is told: the same from a run that is watched and from a journal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.compile import compile_plan
from gpsfsm.execution.journal import Heading, Journal
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.runner import Runner, RunnerError
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.running.continuation import facts_of
from gpsfsm.running.drivers import Shared
from gpsfsm.syntax import parse
from gpsfsm.watch.record_text import StepTaker, Words

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import RunContext

PLAN = """<Plan>
  <Runner interface="nav2_capabilities/RobotPoseRunner" provider="p"/>
  <Runner interface="a/Look" provider="p"/>
  <Runner interface="a/Fail" provider="p"/>
</Plan>"""


class Fake(Runner):
    """Hands over what its interface is about, with text that no file can hold as it is."""

    def __init__(self, interface: str) -> None:
        self.interface = interface

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        await context.sleep(1)
        context.log("nobody is to be told of that")
        if self.interface == "a/Fail":
            raise RunnerError("half of a character: \ud83d, and\nanother line \x1b[31m")
        return {"x": 1.234567, "y": -0.001, "qw": 1.0}


def test_steps_are_the_same_watched_and_stored(tmp_path: Path) -> None:
    plan = parse(PLAN).plan
    assert plan is not None
    kernel = Kernel(compile_plan(plan))
    words = Words(kernel.automaton, kernel.runners)
    watched, stored = StepTaker(kernel, words), StepTaker(kernel, words)
    path = str(tmp_path / "run.db")
    with Journal(path, "none") as journal:
        sink = journal.begin(kernel, Heading(plan=PLAN.encode()))
        driver = VirtualDriver(kernel, sink, lambda interface, _provider: Fake(interface))
        driver.watchers.append(watched)
        driver.run()
    with JournalReader(path) as reader:
        stored.take(reader.events(1))
    assert watched.steps == stored.steps, watched.steps
    assert [(step.action, step.failed) for step in watched.steps] == [
        ("line 2  RobotPoseRunner", False),
        ("line 3  Look", False),
        ("line 4  Fail", True),
    ]
    failed = watched.steps[-1].outcome
    assert failed.startswith("failed: half of a character: ")
    assert failed.isprintable()
    assert watched.pose == stored.pose == (1.234567, -0.001)
    assert facts_of(Shared(), [StepTaker(kernel, words), stored]) == (
        "- The robot was at x=1.23, y=0 when it was last looked up. Lengths are in metres.",
    )
    assert facts_of(Shared(), [StepTaker(kernel, words)]) == ()
