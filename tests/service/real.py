"""A service that lets real runners act, on a robot that is a file in which they write that."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.journal_read import JournalReader
from tests.cli.support import environment
from tests.service.support import Service

if TYPE_CHECKING:
    from collections.abc import Callable

    import httpx

ROOT = Path(__file__).resolve().parents[2]
WAIT_S = 60.0
TOKEN = "a-token-of-an-operator"  # noqa: S105  (of the tests)
OTHER = "a-token-of-another-client"

_RUNNER = '''
import os
from gpsfsm import Runner


class MoveRunner(Runner):
    """Notes what it does: go, arrive, stop; and what a process before it had begun: left."""

    def note(self, what, key):
        with open(os.environ["MOVER_LOG"], "a") as file:
            file.write(f"{what} {key.partition(':')[2]}\\n")

    async def run(self, parameters, context):
        self.note("go", context.key)
        left = parameters["seconds"]
        try:
            while left > 0:
                x = parameters["seconds"] - left
                context.log("on its way", {"feedback": "drive", "distance_left_m": round(left, 1)})
                context.log("it is there", {"world": "pose", "x": x, "y": 2.0 * x, "yaw": 0.5})
                await context.sleep(min(left, 0.2))
                left -= 0.2
        except BaseException:
            self.note("stop", context.key)
            raise
        self.note("arrive", context.key)

    async def left(self, key):
        self.note("left", key)
        return "its goal is cancelled"
'''
_INTERFACE = """name: mover_capabilities/MoveRunner
spec_type: interface
spec_version: 1.2
"""
_PROVIDER = """name: mover_capabilities/MoveRunner
spec_type: provider
spec_version: 1.2
implements: mover_capabilities/MoveRunner
runner: mover:MoveRunner
definition:
  configuration_parameters:
    - {name: seconds, type: double, default: 0.1}
"""


def move(seconds: float) -> str:
    name = "mover_capabilities/MoveRunner"
    return f'<Runner interface="{name}" provider="{name}" seconds="{seconds}"/>'


def program(command: str) -> str:
    name = "generic_capabilities/ProcessRunner"
    return f'<Runner interface="{name}" provider="{name}" command="{command}"/>'


def plan(*runners: str) -> str:
    return f"<Plan>{''.join(runners)}</Plan>"


LONG, SHORT = plan(move(300)), plan(move(0.1))


class RealService(Service):
    """``gpsfsm serve --real`` in a folder of its own, with a stopper if there is to be one."""

    def __init__(self, folder: Path, *words: object, stopper: bool = False) -> None:
        folder.mkdir(exist_ok=True)
        self.home = folder
        self.log = folder / "moves"
        self.stops = folder / "stops"
        (folder / "mover.py").write_text(_RUNNER, encoding="utf-8")
        for kind, text in (("interfaces", _INTERFACE), ("providers", _PROVIDER)):
            (folder / "mover_capabilities" / kind).mkdir(parents=True, exist_ok=True)
            (folder / "mover_capabilities" / kind / "MoveRunner.yaml").write_text(text)
        (folder / "tokens").write_text(f"{TOKEN}\n{OTHER}\n", encoding="utf-8")
        usual = (
            *("--real", "--journal", folder / "queue.db", "--durability", "process"),
            *("--token-file", folder / "tokens", "--workers", "1", "--capabilities", folder),
            *("--allow-module", "mover", "--allow-program", "sleep"),
        )
        super().__init__(*usual, *words)
        self._stopper = stopper
        self.behave("well")

    def _begun(self) -> subprocess.Popen[bytes]:
        around = environment(
            PYTHONPATH=os.pathsep.join([str(ROOT), str(self.home)]),
            MOVER_LOG=str(self.log),
            STOPPER=str(self.home) if self._stopper else "",
        )
        words = ["-P", "-m", "tests.service.real_child", "serve", "--port", "0", "--isolated"]
        return subprocess.Popen(
            [sys.executable, *words, *self._words],
            stdin=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            env=around,
        )

    def client(self, token: str = TOKEN, **options: Any) -> httpx.Client:
        return super().client(headers={"Authorization": f"Bearer {token}"}, **options)

    def moves(self) -> list[str]:
        """What the robot has done: what, in which action."""
        return self.log.read_text(encoding="utf-8").splitlines() if self.log.exists() else []

    def did(self, what: str) -> list[str]:
        return [each.partition(" ")[2] for each in self.moves() if each.split()[0] == what]

    def forget(self) -> None:
        """What was until now is no matter."""
        self.log.unlink(missing_ok=True)
        self.stops.unlink(missing_ok=True)

    def behave(self, how: str) -> None:
        """Let the stopper answer so."""
        (self.home / "how").write_text(how, encoding="utf-8")

    def process_of_queue(self) -> int:
        return self.child("real_serving")

    def child(self, name: str) -> int:
        (number,) = [pid for pid, command in self.children().items() if name in command]
        return number

    def decisions(self, kind: str) -> list[str]:
        """Why the queue has decided so, each time."""
        with JournalReader(self.journal) as reader:
            return [row[6] for row in reader.queue() if row[2] == kind]


def set_plan(client: httpx.Client, text: str, **more: Any) -> str:
    answer = client.post("/v1/plans", json={"plan": text, **more})
    assert answer.status_code == 200, answer.text
    plan_id: str = answer.json()["plan_id"]
    return plan_id


def until(condition: Callable[[], Any], what: str = "what was waited for") -> Any:
    end_s = time.monotonic() + WAIT_S
    while not (parsed := condition()):
        assert time.monotonic() < end_s, f"{what} did not happen"
        time.sleep(0.02)
    return parsed


def held(client: httpx.Client) -> str:
    answer = client.get("/v1/queue")
    assert answer.status_code == 200, answer.text
    result: str = answer.json()["held"]
    return result


def status(client: httpx.Client, number: str) -> str:
    result: str = client.get(f"/v1/plans/{number}").json()["status"]
    return result
