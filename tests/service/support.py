"""A real service in a process of its own, on a port that is free."""

from __future__ import annotations

import json
import random
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx

from tests.cli.support import environment
from tests.forked import Forked, can_fork

if TYPE_CHECKING:
    from types import TracebackType
    from typing import Self

GOOD = '<Plan><Runner interface="a/Go" provider="a/Go"/></Plan>'
BAD = '<Plan><Runner provider="a/Go"/></Plan>'
_NEW = ["-P", "-m", "gpsfsm", "serve", "--port", "0", "--isolated"]
_ADDRESS = re.compile(r"serving at (http://[^\s\"]+)")


class Service:
    """``gpsfsm serve`` with these words. Use it in a ``with`` statement, or start it by hand.

    The process is forked from one that has loaded what it takes, but in a ``folder`` that may hold
    traps for what it loads, or with another command. So are its own processes, but for
    ``new_workers``; of these there is one of each kind: a test that needs more names them.
    """

    def __init__(
        self, *words: object, folder: Path | None = None, new_workers: bool = False
    ) -> None:
        self._forks = not new_workers
        self._words = [str(word) for word in words]
        if "--workers" not in self._words:
            self._words += ["--workers", "1", "--gate-workers", "1"]
        self._folder = folder
        self.command = _NEW
        self.said: list[str] = []
        self.address = ""
        self._ready = threading.Event()

    def start(self) -> Self:
        self.process = self._begun()
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()
        assert self._ready.wait(120), "the service did not begin"
        assert self.address, "".join(self.said)
        return self

    def _begun(self) -> subprocess.Popen[bytes]:
        around = environment()
        if self.command is _NEW and self._folder is None and can_fork(around):
            words = [*_NEW[3:], *self._words]
            return Forked(
                words, cwd=None, environment=around, stdout=subprocess.DEVNULL, forks=self._forks
            )
        return subprocess.Popen(
            [sys.executable, *self.command, *self._words],
            stdin=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            cwd=self._folder,
            env=around,
        )

    def _listen(self) -> None:
        assert self.process.stderr is not None
        for words in self.process.stderr:
            line = words.decode("utf-8", "replace")
            self.said.append(line)
            if (match := _ADDRESS.search(line)) is not None:
                self.address = match[1]
                self._ready.set()
        self._ready.set()

    @property
    def journal(self) -> str:
        return self._words[self._words.index("--journal") + 1]

    @property
    def place(self) -> tuple[str, int]:
        host, _, port = self.address.removeprefix("http://").rpartition(":")
        return host, int(port)

    def client(self, **options: Any) -> httpx.Client:
        return httpx.Client(base_url=self.address, timeout=60, trust_env=False, **options)

    def connect(self) -> socket.socket:
        return socket.create_connection(self.place, timeout=60)

    def stop(self) -> int:
        """As a system does: SIGTERM; the exit code."""
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(60)
        self._close()
        return self.process.returncode

    def kill(self) -> None:
        self.process.kill()
        self.finish()

    def finish(self) -> None:
        """Whatever has become of it, it is over."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait(60)
        self._close()

    def _close(self) -> None:
        """Its children have its standard error as well: it ends with the last of them."""
        self._listener.join(30)
        assert not self._listener.is_alive(), f"{self.children()} hold its standard error"
        assert self.process.stderr is not None
        self.process.stderr.close()

    def children(self) -> dict[int, str]:
        """The processes of the service, with their commands."""
        results = {}
        for place in Path("/proc").iterdir():
            try:
                fields = (place / "stat").read_text().rpartition(")")[2].split()
                command = (place / "cmdline").read_bytes().replace(b"\0", b" ").decode()
                if "tests.forked" in command:  # its name says what it has become
                    command = f"gpsfsm.{(place / 'comm').read_text().strip()}"
            except OSError:
                continue
            if int(fields[1]) == self.process.pid and fields[0] != "Z":
                results[int(place.name)] = command
        return results

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.finish()


def lay_traps(folder: Path) -> None:
    """Files in a folder that would be taken for modules if somebody looked there."""
    for name in ("json", "gpsfsm", "z3", "sqlite3"):
        (folder / f"{name}.py").write_text("raise SystemExit(0)", encoding="utf-8")


def ended(client: httpx.Client, plan: str, *, within_s: float = 60) -> dict[str, Any]:
    """How a plan has ended."""
    until_s = time.monotonic() + within_s
    while time.monotonic() < until_s:
        answer = client.post(f"/v1/plans/{plan}/completion", json={"wait_s": 10})
        assert answer.status_code == 200, answer.text
        document: dict[str, Any] = answer.json()
        if document["ended"]:
            return document
    raise AssertionError(f"plan {plan} has not ended")


def events(client: httpx.Client, plan: str, after: int = 0) -> list[tuple[str, str, Any]]:
    """The events of a plan until its end: kind, id and data."""
    headers = {"last-event-id": str(after)} if after else {}
    results = []
    with client.stream("GET", f"/v1/plans/{plan}/events", headers=headers) as answer:
        assert answer.status_code == 200
        kind = number = ""
        for line in answer.iter_lines():
            name, _, value = line.partition(": ")
            if name == "event":
                kind = value
            elif name == "id":
                number = value
            elif name == "data":
                results.append((kind, number, json.loads(value)))
                number = ""
    return results


def nested_trees(depth: int, width: int = 2) -> str:
    """Behaviour trees with ``width ** depth`` uses of the innermost one."""
    trees = ""
    for each in range(depth):
        uses = f'<SubTree ID="T{each + 1}"/>' * width
        trees += f'<BehaviorTree ID="T{each}"><Sequence>{uses}</Sequence></BehaviorTree>'
    return (
        f'<root BTCPP_format="4" main_tree_to_execute="T0">{trees}<BehaviorTree ID="T{depth}">'
        "<Sequence><AlwaysSuccess/><Go/></Sequence></BehaviorTree></root>"
    )


def loops(*rounds: int) -> str:
    """A behaviour tree with loops inside each other."""
    begin = "".join(f'<Repeat num_cycles="{each}">' for each in rounds)
    return (
        '<root BTCPP_format="4" main_tree_to_execute="T0"><BehaviorTree ID="T0">'
        f"{begin}<Go/>{'</Repeat>' * len(rounds)}</BehaviorTree></root>"
    )


def slow_plan(runners: int = 20, depth: int = 6) -> str:
    """A plan that takes long under ``consistent``: few actions, again and again, nested.

    About nine seconds, until the limit of steps ends it: more than four times the two seconds
    that tests give it. A depth of 5 is decided after five to six.
    """
    chance = random.Random(1)  # noqa: S311

    def runner() -> str:
        return f'<Runner interface="a/R{chance.randrange(runners)}" provider="a/R"/>'

    def unit(left: int) -> str:
        if not left:
            return runner()
        kind = chance.choice(["sequential", "parallel_all", "parallel_any", "recovery"])
        inner = "".join(unit(left - 1) for _ in range(3))
        first = runner() if kind == "recovery" else ""
        return f'{first}<Control type="{kind}">{inner}</Control>'

    return f"<Plan>{unit(depth)}</Plan>"
