"""What many runs in a row leave behind: nothing."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

from tests.ros.support import PATIENCE, REPO, shared_memory_files

if TYPE_CHECKING:
    from tests.ros.support import Domain

RUNS = 20


def test_twenty_runs_in_a_row_leave_nothing(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "50")
    ended = ros.gpsfsm("run", "--real", REPO / "corpus/missions/navigation_1.xml")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    processes, files = ros.processes(), ros.ports()
    for _ in range(RUNS):
        ended = ros.gpsfsm("run", "--real", REPO / "corpus/missions/navigation_1.xml")
        seen = ended.stdout + ended.stderr + str(server.journal()[-9:]) + server.stderr[-2000:]
        assert (ended.returncode, ended.stderr) == (0, ""), seen
    assert ros.processes() == processes
    end = time.monotonic() + PATIENCE  # the server lets go of the ports of others in its own time
    while not ros.ports() <= files:
        assert time.monotonic() < end, shared_memory_files()
        time.sleep(0.1)
    goals = len(server.journal("goal"))
    assert goals % (RUNS + 1) == 0
    assert len(server.journal("result", status="succeeded")) == goals
    assert threading.active_count() < 10


def test_a_node_of_this_process_ends_with_its_threads(ros: Domain) -> None:
    program = (
        "import threading\n"
        "from gpsfsm.model.ros import RosSettings\n"
        "from gpsfsm.ros.node import RosNode\n"
        "for _ in range(20):\n"
        "    node = RosNode(RosSettings())\n"
        "    assert node.do(lambda: 7) == 7\n"
        "    node.close()\n"
        "    node.close()\n"
        "assert threading.active_count() == 1, threading.enumerate()\n"
        "node = RosNode(RosSettings())\n"  # the end of the process closes this one
    )
    ended = ros.python("-c", program)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")
