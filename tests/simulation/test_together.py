"""Worlds with the other parts of the engine: the plan queue, real time, other processes."""

from __future__ import annotations

import asyncio
import hashlib
import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from gpsfsm.capabilities.library import bind
from gpsfsm.compile import compile_plan
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.queues import VirtualQueue
from gpsfsm.execution.realtime import RealtimeDriver
from gpsfsm.execution.records import Status
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.simulation.load import load_world
from gpsfsm.simulation.makers import world_maker, world_services
from tests.conftest import REPO
from tests.simulation.support import LIBRARY, field_of, plan, run, runner
from tests.support import plan_of

if TYPE_CHECKING:
    from gpsfsm.compile import Compiled
    from gpsfsm.execution.queue import PlanState

HOME = REPO / "corpus" / "worlds" / "home.yaml"
ASK = plan(
    runner("Waypoint", x="2.0", y="0.0"),
    runner("PromptText", text="kept", uuid="u"),
    runner("PromptPlan", task="go home", flush="true"),
    runner("FabricSetPlan"),
)


class Sink:
    def write(self, at_us, happened, records):
        pass

    def write_queue(self, at_us, row):
        pass


def compiled(text: str, _name: str = "") -> Compiled:
    parsed = plan_of(text)
    return compile_plan(parsed, bindings=bind(parsed, LIBRARY))


def test_a_plan_that_a_model_writes_runs_next_in_the_same_world():
    world = load_world(HOME)
    services = world_services(world, LIBRARY)
    state = services["world"]

    def begin(plan_state: PlanState, what: Compiled) -> VirtualDriver:
        state.next_plan(plan_state.began_us / 1e6)
        plans = {"plans": queue.service(plan_state.plan)}
        make = world_maker(world, LIBRARY)
        return VirtualDriver(Kernel(what), Sink(), make, services={**services, **plans})

    queue = VirtualQueue(compiled, Sink(), begin)
    queue.submit(ASK)
    queue.run_all()
    assert [each.status for each in queue.states()] == [Status.COMPLETED, Status.COMPLETED]
    assert [(x, y) for _, x, y in state.arrivals] == [(2.0, 0.0), (0.0, 0.0)]
    first, second = (at for at, _, _ in state.arrivals)
    assert second > queue.state(2).began_us / 1e6 > first
    assert state.prompts.kept("u") == ()


def test_a_world_in_real_time():
    world = field_of()
    services = world_services(world, LIBRARY)
    text = plan(runner("Waypoint", x="1.0", y="0.0"), runner("Waypoint", x="1.0", y="1.0"))
    driver = RealtimeDriver(
        Kernel(compiled(text)),
        Sink(),
        world_maker(world, LIBRARY),
        services=services,
        speed=100.0,
        isolate=False,
    )
    asyncio.run(driver.run())
    assert driver.kernel.status is Status.COMPLETED
    assert [(x, y) for _, x, y in services["world"].arrivals] == [(1.0, 0.0), (1.0, 1.0)]


_CHILD = """
import hashlib, sys
from pathlib import Path
from gpsfsm.simulation.load import load_world
from tests.simulation.support import run
text = Path("corpus/missions/bring_back_name.xml").read_text("utf-8")
ran = run(text, load_world("corpus/worlds/home.yaml"), seed=11)
print(hashlib.sha256(repr(ran.rows).encode()).hexdigest())
"""


@pytest.mark.parametrize("seed", ["0", "4711"])
def test_processes_agree(seed):
    text = (REPO / "corpus" / "missions" / "bring_back_name.xml").read_text("utf-8")
    here = repr(run(text, load_world(HOME), seed=11).rows).encode()
    there = subprocess.run(
        [sys.executable, "-c", _CHILD],
        cwd=REPO,
        env={**os.environ, "PYTHONHASHSEED": seed},
        capture_output=True,
        text=True,
        check=True,
    )

    assert there.stdout.strip() == hashlib.sha256(here).hexdigest()


@pytest.mark.parametrize("world", ["arena", "home"])
@pytest.mark.parametrize(
    "path", sorted((REPO / "corpus" / "plans").glob("*.xml")), ids=lambda path: path.stem
)
def test_every_plan_of_the_corpus_comes_to_an_end(path, world):
    ran = run(path.read_text("utf-8"), load_world(REPO / "corpus" / "worlds" / f"{world}.yaml"))
    assert ran.status in (Status.COMPLETED, Status.GAVE_UP, Status.STUCK)
    assert not any("Error" in message for message in ran.messages.values()), ran.messages
    assert [where for _, where, _ in ran.driver.logs if not where] == []  # nothing about unloading
