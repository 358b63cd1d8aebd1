"""Processes of ROS 2 for tests that have none themselves: fake servers, clients, gpsfsm.

The tests run in an environment without ROS 2. Each gets a ``Domain`` (the fixture ``ros``) and
starts processes in it with the Python of ``.venv-ros``, which ``make .venv-ros/installed`` makes.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import signal
import subprocess
import tempfile
import threading
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

REPO = Path(__file__).parents[2]
ROS = REPO / ".venv-ros"
PYTHON = ROS / "bin" / "python"
PATIENCE = 60.0
"""The seconds after which a process that is waited for counts as stuck."""

_NOT_INHERITED = ("ROS_", "RMW_", "FASTDDS_", "FASTRTPS_", "AMENT_", "CYCLONEDDS_", "_ROS_")
_SHARED_MEMORY = Path("/dev/shm")  # noqa: S108
_FIRST_PORT, _PORTS = 7400, 250
"""Fast DDS numbers the ports of a domain so; a port in shared memory is a file of that number."""
_TAKEN_PORT = re.compile(r"^.*RTPS_TRANSPORT_SHM.* init_port fastdds_port70\d\d\b.*\n", re.M)
"""A complaint of Fast DDS about a port that belongs to no domain of the tests, so that processes of
several of them may want it in the same moment. It goes on without."""
_DOMAINS = range(1, 102)
"""Those whose ports no other program is likely to have; 0 is the one of everybody."""


def missing() -> str:
    """The reason why nothing can be run on ROS 2 here, or nothing."""
    if not (ROS / "installed").exists():
        return "there is no .venv-ros with ROS 2 (make .venv-ros/installed)"
    return ""


_PROFILE = """<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com">
  <participant profile_name="tests" is_default_profile="true">
    <rtps>
      <builtin>
        <discovery_config>
          <leaseDuration><sec>{lease}</sec></leaseDuration>
          <leaseAnnouncement><nanosec>200000000</nanosec></leaseAnnouncement>
          <initialAnnouncements>
            <count>20</count>
            <period><nanosec>50000000</nanosec></period>
          </initialAnnouncements>
        </discovery_config>
      </builtin>
    </rtps>
  </participant>
</profiles>
"""
"""Participants announce themselves often: by the defaults some need three seconds to meet."""


class Program:
    """A process with JSON lines on stdout, which are kept, and perhaps commands on stdin."""

    def __init__(self, words: list[str], *, environment: dict[str, str], folder: Path) -> None:
        self.words, self.environment = words, environment
        with tempfile.NamedTemporaryFile(dir=folder, prefix="stderr-", delete=False) as errors:
            self._errors = Path(errors.name)
            self.process = subprocess.Popen(
                words,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                env=environment,
                cwd=REPO,
                text=True,
            )
        self._rows: list[dict[str, Any]] = []
        self._news = threading.Condition()
        self._ended = False
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def stderr(self) -> str:
        """Output of the process for people."""
        return self._errors.read_text(errors="replace")

    def journal(self, event: str | None = None, **fields: Any) -> list[dict[str, Any]]:
        """The lines so far; of one event, if it is named, and with these values in its fields."""
        with self._news:
            return self._matching(event, fields)

    def wait_for(self, event: str, *, count: int = 1, **fields: Any) -> dict[str, Any]:
        """The line with which there are so many of an event; the test fails if it does not come."""

        def enough() -> bool:
            return self._ended or len(self._matching(event, fields)) >= count

        with self._news:
            self._news.wait_for(enough, PATIENCE)
            rows = self._matching(event, fields)
        assert len(rows) >= count, self._account(f"{count} x {event} {fields} did not come")
        return rows[count - 1]

    def command(self, do: str, **fields: Any) -> None:
        """Command the process, and wait until it has done so."""
        number = len(self.journal("done", do=do)) + 1
        self.send(do, **fields)
        self.wait_for("done", do=do, count=number)

    def send(self, do: str, **fields: Any) -> None:
        """Command the process."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps({"do": do, **fields}) + "\n")
        self.process.stdin.flush()

    def stop(self, number: signal.Signals = signal.SIGINT) -> int:
        """Ask the process to end: its exit code."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        try:
            return self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.send_signal(signal.SIGABRT)  # it writes where its threads are
            self.process.wait()
            raise AssertionError(self._account("the process did not end")) from None
        finally:
            self.close()

    def close(self) -> None:
        """Close the streams of a process that has ended."""
        self._reader.join(PATIENCE)
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                with suppress(BrokenPipeError):
                    stream.close()

    def _matching(self, event: str | None, fields: dict[str, Any]) -> list[dict[str, Any]]:
        wanted = fields if event is None else {"event": event, **fields}
        return [row for row in self._rows if wanted.items() <= row.items()]

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            row = json.loads(line) if line.startswith("{") else {"event": "text", "text": line}
            with self._news:
                self._rows.append(row)
                self._ended |= row["event"] == "error"
                self._news.notify_all()
        with self._news:
            self._ended = True
            self._news.notify_all()

    def _account(self, problem: str) -> str:
        rows = "\n".join(map(json.dumps, self.journal()))
        return f"{problem}: {' '.join(self.words)}\n{rows}\n{self.stderr[-4000:]}"


@dataclass(kw_only=True)
class Domain:
    """A domain of ROS 2 that no other test has, with all processes that one test starts in it."""

    number: int
    folder: Path
    variants: tuple[str, ...] = ()
    """The sets of interfaces that come before those of ``interfaces/main``: ``humble``."""
    lease: int = 20
    """The seconds after which a participant that was killed is no longer in the graph."""
    programs: list[Program] = field(default_factory=list)
    abandoned: set[str] = field(default_factory=set)
    """The shared memory of processes that the test has killed."""

    def environment(self, *variants: str) -> dict[str, str]:
        """The environment of a process in this domain."""
        kept = {n: v for n, v in os.environ.items() if not n.startswith(_NOT_INHERITED)}
        sets = [ROS / f"interfaces-{name}" for name in (*variants, *self.variants)]
        for path in sets:
            assert path.is_dir(), f"there is no {path}"
        profile = self.folder / "fastdds.xml"
        profile.write_text(_PROFILE.format(lease=self.lease))
        own = {
            "FASTDDS_DEFAULT_PROFILES_FILE": str(profile),
            "ROS_DOMAIN_ID": str(self.number),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_LOG_DIR": str(self.folder / "ros-log"),
            "PYTHONPATH": os.pathsep.join(map(str, (REPO, *sets, ROS / "interfaces"))),
            "PYTHONUNBUFFERED": "1",
            _MARK: str(self.folder),
        }
        return kept | own

    def start(self, module: str, *arguments: str, variants: tuple[str, ...] = ()) -> Program:
        """A program of ours, when it is ready."""
        program = Program(
            [str(PYTHON), "-X", "faulthandler", "-m", module, *arguments],
            environment=self.environment(*variants),
            folder=self.folder,
        )
        self.programs.append(program)
        program.wait_for("ready")
        return program

    def server(self, name: str, *arguments: str, variants: tuple[str, ...] = ()) -> Program:
        """A fake server of ``tests/ros/servers``, when it is ready."""
        return self.start(f"tests.ros.servers.{name}", *arguments, variants=variants)

    def client(self, *arguments: str, variants: tuple[str, ...] = ()) -> Client:
        """A client for whatever the servers offer, when it is ready."""
        return Client(self.start("tests.ros.servers.client", *arguments, variants=variants))

    def gpsfsm(
        self,
        *arguments: str | Path,
        variants: tuple[str, ...] = (),
        environment: dict[str, str] | None = None,
        stdin: str = "",
        timeout: float = PATIENCE,
    ) -> subprocess.CompletedProcess[str]:
        """The command ``gpsfsm`` in the folder of the test, when it has ended."""
        return self.python(
            "-m",
            "gpsfsm",
            *map(str, arguments),
            environment=environment or self.environment(*variants),
            stdin=stdin,
            timeout=timeout,
        )

    def python(
        self,
        *words: str,
        environment: dict[str, str] | None = None,
        stdin: str = "",
        timeout: float = PATIENCE,
    ) -> subprocess.CompletedProcess[str]:
        """The interpreter that has ROS 2, in the folder of the test, when it has ended."""
        ended = subprocess.run(
            [str(PYTHON), *words],
            input=stdin,
            env=environment or self.environment(),
            cwd=self.folder,
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
        )
        ended.stderr = _TAKEN_PORT.sub("", ended.stderr)
        return ended

    @contextmanager
    def running(
        self, *arguments: str | Path, variants: tuple[str, ...] = ()
    ) -> Iterator[subprocess.Popen[str]]:
        """The command ``gpsfsm``, to be stopped, killed or watched; afterwards it is killed."""
        process = subprocess.Popen(
            [str(PYTHON), "-m", "gpsfsm", *map(str, arguments)],
            env=self.environment(*variants),
            cwd=self.folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        with process:
            try:
                yield process
            finally:
                self.kill(process)

    def processes(self) -> list[str]:
        """The command lines of the processes that were started in this domain and still run."""
        mark = f"{_MARK}={self.folder}".encode()
        results = []
        for folder in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):  # it may end meanwhile, or be somebody else's
                if mark in (folder / "environ").read_bytes().split(b"\0"):
                    words = (folder / "cmdline").read_text().split("\0")
                    results.append(f"{folder.name} {' '.join(words)}")
        return results

    def kill(self, process: subprocess.Popen[str]) -> None:
        """End a process without notice, as a crash of it would.

        Fast DDS leaves files in shared memory then, which other processes still use: they are
        removed when the test ends.
        """
        if process.poll() is None:
            self.give_up(process.pid)
            process.kill()
        process.wait()

    def give_up(self, pid: int) -> None:
        """Note what a process leaves in shared memory that somebody is going to kill."""
        self.abandoned |= _mapped(Path(f"/proc/{pid}"))

    def ports(self) -> set[str]:
        """The files in shared memory that can only be of a process in this domain."""
        first = _FIRST_PORT + _PORTS * self.number
        stems = {f"fastdds_port{port}" for port in range(first, first + _PORTS)}
        return {name for name in shared_memory_files() if _stem(name) in stems}

    def close(self) -> None:
        """Stop all servers, and demand that they end well and that nothing is left."""
        problems = []
        for program in reversed(self.programs):
            if program.process.poll() is not None:
                program.close()
                continue
            try:
                code = program.stop()
            except AssertionError as error:  # the others are to be stopped all the same
                problems.append(str(error))
            else:
                problems += [f"exit code {code} of {program.words}\n{program.stderr}"] * bool(code)
        assert not problems, "\n".join(problems)
        running = self.processes()
        assert not running, running
        files = shared_memory_files()
        remove_orphaned({name for name in files if _stem(name) in self.abandoned})
        left = sorted(orphaned(self.ports()))
        assert not left, f"a process did not leave well, and left in {_SHARED_MEMORY}: {left}"


_MARK = "GPSFSM_TEST_OF_ROS"


class Client:
    """A process that calls services, sends goals and listens, for tests of the servers."""

    def __init__(self, program: Program) -> None:
        self.program = program

    def call(self, name: str, of_type: str, *, timeout: float = 10.0, **request: Any) -> Any:
        """The response of a service as JSON has it, or nothing if none comes in time."""
        return self._answer("call", name=name, of_type=of_type, timeout=timeout, request=request)

    def send_calls(self, name: str, of_type: str, requests: list[dict[str, Any]]) -> None:
        """Send requests that do not wait for each other; one of ``answers`` has the responses."""
        self.program.send("calls", name=name, of_type=of_type, timeout=10.0, requests=requests)

    def answers(self, number: int) -> Any:
        """The answer to the command of this number."""
        return self.program.wait_for("answer", count=number)["value"]

    def services(self) -> dict[str, str]:
        """The services that this client sees, with their types."""
        return dict(self._answer("services"))

    def nodes(self) -> list[str]:
        """The names of the nodes that this client sees."""
        return list(self._answer("nodes"))

    def send_goal(self, name: str, of_type: str, goal: dict[str, Any]) -> str:
        """The id of a goal that was accepted, and an empty one if it was rejected."""
        return str(self._answer("goal", name=name, of_type=of_type, goal=goal))

    def cancel(self, goal: str) -> int:
        """Try to cancel a goal: the return code of the server."""
        return int(self._answer("cancel", goal=goal))

    def result(self, goal: str) -> dict[str, Any]:
        """The status and the result of a goal, when it has ended."""
        return self.program.wait_for("result", goal=goal)

    def feedback(self, goal: str) -> list[dict[str, Any]]:
        """The messages of feedback on a goal so far."""
        return [row["feedback"] for row in self.program.journal("feedback", goal=goal)]

    def message(self, name: str, of_type: str) -> Any:
        """The next message of a topic."""
        return self._answer("listen", name=name, of_type=of_type)

    def _answer(self, do: str, **fields: Any) -> Any:
        number = len(self.program.journal("answer")) + 1
        self.program.send(do, **fields)
        return self.answers(number)


@contextmanager
def reserved_domain() -> Iterator[int]:
    """A domain that no other process of this machine has, of these tests in any folder.

    The one that was in use longest ago comes first: a participant that was killed stays in the
    memory of others for twenty seconds.
    """
    folder = Path(tempfile.gettempdir()) / f"gpsfsm-ros-domains-{os.getuid()}"
    folder.mkdir(exist_ok=True)
    files = [folder / str(number) for number in _DOMAINS]
    for file in files:
        if not file.exists():
            file.touch()
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        for file in sorted(files, key=lambda file: file.stat().st_mtime_ns):
            with file.open("a") as opened:
                if not _lock(opened):
                    continue
                os.utime(file)
                try:
                    yield int(file.name)
                finally:
                    os.utime(file)
                return
        time.sleep(0.1)
    raise AssertionError("all domains of ROS 2 are in use")


def _lock(opened: IO[str]) -> bool:
    try:
        fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def shared_memory_files() -> set[str]:
    """The files by which processes with Fast DDS share memory."""
    names = {path.name for path in _SHARED_MEMORY.glob("*")}
    return {name for name in names if _stem(name).startswith("fast")}


def orphaned(files: set[str]) -> set[str]:
    """Those of these files that belong to no process any more."""
    held = set().union(*map(_mapped, Path("/proc").glob("[0-9]*")))
    return {name for name in files if _stem(name) not in held} & shared_memory_files()


def remove_orphaned(files: set[str]) -> None:
    """Remove those of these files that belong to no process any more."""
    for name in orphaned(files):
        (_SHARED_MEMORY / name).unlink(missing_ok=True)


def _stem(name: str) -> str:
    """A segment's name, from the names of the files around it: a lock and a semaphore."""
    return name.removeprefix("sem.").removesuffix("_mutex").removesuffix("_el")


def _mapped(process: Path) -> set[str]:
    """The names of the segments that a process has mapped."""
    try:
        lines = (process / "maps").read_text(errors="replace").splitlines()
    except OSError:  # it has ended, or is somebody else's
        return set()
    marker = f"{_SHARED_MEMORY}/"
    return {_stem(line.rpartition(marker)[2]) for line in lines if marker in line}
