"""A child process: its answers, and what is said when there is none."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import gpsfsm
import gpsfsm.workers.child_process as child_module
import gpsfsm.workers.parent_link as link_module
from gpsfsm.workers.child_process import AsyncChildProcess, ChildProcess, child_command
from gpsfsm.workers.frames import GoneError

if TYPE_CHECKING:
    from collections.abc import Iterator

CODE = f"""
import os
import signal
import sys
import threading
from contextlib import suppress
sys.path.insert(0, {str(Path(gpsfsm.__file__).parents[1])!r})
from gpsfsm.workers.parent_link import ParentLink
link = ParentLink()
print("this is no answer")
while True:
    head, body = link.messages.get()
    if "exit" in head:
        raise SystemExit(head["exit"])
    if "wait" not in head:
        link.send({{"length": len(body), **head}}, body[::-1])
"""


@pytest.fixture
def child() -> Iterator[ChildProcess]:
    child_process = ChildProcess([sys.executable, "-I", "-c", CODE], silent=True)
    yield child_process
    child_process.end()


def test_answers_come_in_the_order_of_the_questions(child: ChildProcess) -> None:
    for body in (b"", b"abc", bytes(1 << 20)):
        answer = child.ask({"a": [1, "\ud800"]}, body, within_s=60)
        assert answer == ({"length": len(body), "a": [1, "\ud800"]}, body[::-1])


def test_who_has_ended_is_gone(child: ChildProcess) -> None:
    with pytest.raises(GoneError):
        child.ask({"exit": 3}, within_s=60)


def test_who_says_nothing_is_too_late_and_is_ended(child: ChildProcess) -> None:
    with pytest.raises(TimeoutError):
        child.ask({"wait": True}, within_s=0.2)
    child.end()
    assert child._process.poll() is not None
    assert not child._thread.is_alive()


def test_what_cannot_be_written_is_not_sent(child: ChildProcess) -> None:
    with pytest.raises(TypeError):
        child.ask({"a": object()}, within_s=60)
    assert child.ask({}, within_s=60) == ({"length": 0}, b"")


def test_a_program_that_is_not_there() -> None:
    with pytest.raises(OSError, match="no/such"):
        ChildProcess(["/no/such/program"], silent=True)


def test_a_child_ends_where_there_are_no_process_groups(
    child: ChildProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on Windows, which has none of these names."""

    def missing(*_: object, **__: object) -> None:
        raise AttributeError("module 'signal' has no attribute 'SIGKILL'")

    with monkeypatch.context() as patched:
        patched.delattr(os, "killpg")
        patched.setattr(child_module, "kill_below", missing)
        child.send({"wait": 1})
        child.end()
    assert not child.alive


def test_who_says_what_is_no_message_is_killed() -> None:
    code = "import os, time; os.read(0, 8); os.write(1, b'\\xff' * 100); time.sleep(600)"
    child = ChildProcess([sys.executable, "-I", "-c", code], silent=True)
    with pytest.raises(GoneError):
        child.ask({}, within_s=60)
    assert child.garbled
    assert child.exit_code() == -signal.SIGKILL
    child.end()


def test_what_is_asked_after_the_end_is_answered_at_once(child: ChildProcess) -> None:
    child.ask({}, within_s=60)
    child.end()
    assert not child.alive
    with pytest.raises(GoneError):
        child.ask({}, within_s=60)


def test_who_waits_is_told_when_another_thread_ends_it(child: ChildProcess) -> None:
    timer = threading.Timer(0.3, child.end)
    timer.start()
    with pytest.raises(GoneError):
        child.ask({"wait": True}, within_s=60)
    timer.join()


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="needs /proc")
def test_nothing_is_left_behind() -> None:
    def left() -> tuple[int, int, list[str]]:
        stats = [_fields(each) for each in Path("/proc").glob("[0-9]*/stat")]
        children = [each[0] for each in stats if each and each[1] == str(os.getpid())]
        return len(list(Path("/proc/self/fd").iterdir())), threading.active_count(), children

    before = left()
    for within_s in (60.0, 0.0):
        child = ChildProcess([sys.executable, "-I", "-c", CODE], silent=True)
        with suppress(TimeoutError):
            child.ask({}, within_s=within_s)
        child.end()
        child.end()  # once more makes no difference
    with pytest.raises(OSError, match="no/such"):
        ChildProcess(["/no/such/program"], silent=True)
    assert left() == before


def _fields(stat: Path) -> list[str]:
    try:
        return stat.read_text().rpartition(")")[2].split()
    except OSError:  # it has just ended
        return []


WHERE = """
import os, sys
sys.path[:] = {path!r}
from gpsfsm.workers.child_process import child_command
os.chdir({here!r})
print("\\n".join(child_command("a:b")[5:]))
"""


@pytest.mark.parametrize("entry", ["", "HERE"])
@pytest.mark.parametrize(("pythonpath", "is_there"), [(None, 0), ("HERE", 1), ("/no/such", 0)])
def test_the_working_folder_is_no_place_of_modules_unless_it_is_named(
    tmp_path: Path, entry: str, pythonpath: str | None, is_there: int
) -> None:
    """As with ``python -m gpsfsm serve`` in a folder of plans, or ``python -c``."""
    here = str(tmp_path)
    path = [entry.replace("HERE", here), *sys.path]
    code = WHERE.format(path=path, here=here)
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    if pythonpath is not None:
        env["PYTHONPATH"] = pythonpath.replace("HERE", here)
    command = [sys.executable, "-P", "-c", code]
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
    folders = done.stdout.splitlines()
    assert ("" in folders, here in folders) == (False, bool(is_there))
    assert str(Path(gpsfsm.__file__).parents[1]) in folders


def test_a_folder_of_modules_stays_one_where_gpsfsm_itself_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    home = Path(gpsfsm.__file__).parents[1]
    monkeypatch.chdir(home)
    monkeypatch.delenv("PYTHONPATH", raising=False)
    assert str(home) in child_command("a:b")


def test_a_working_folder_that_was_removed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    monkeypatch.chdir(tmp_path / "folder")
    (tmp_path / "folder").rmdir()
    monkeypatch.setattr(sys, "path", ["", *sys.path])
    assert "" not in child_command("a:b")


def test_who_announces_more_than_there_is_memory_for_is_killed(
    monkeypatch: pytest.MonkeyPatch, child: ChildProcess
) -> None:
    def too_much(_: object) -> None:
        raise MemoryError

    monkeypatch.setattr(child_module, "read", too_much)
    with pytest.raises(GoneError):
        child.ask({}, within_s=60)
    assert child.garbled
    assert child.exit_code() == -signal.SIGKILL


FORKS = """
import os, time
if os.fork():
    os.read(0, 8)
{leader}
time.sleep(600)
"""


@pytest.mark.parametrize("leader", ["os.getpid() == os.getpgrp() and os._exit(0)", ""])
def test_children_of_a_child_hold_up_nobody(leader: str) -> None:
    """They have its pipes, too, so that none of these ends when it is killed, or ends by itself."""
    command = [sys.executable, "-I", "-c", FORKS.format(leader=leader)]
    child = ChildProcess(command, silent=True)
    with pytest.raises(TimeoutError):
        child.ask({}, within_s=0.5)
    began = time.monotonic()
    child.end()
    assert time.monotonic() - began < 60  # the children sleep ten times as long
    assert not child._thread.is_alive()


def test_children_of_a_child_of_an_event_loop_hold_up_nobody() -> None:
    async def started_and_ended() -> float:
        command = [sys.executable, "-I", "-c", FORKS.format(leader="")]
        child = await AsyncChildProcess.start(command)
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.5):
                await child.receive()
        began = time.monotonic()
        await child.end()
        return time.monotonic() - began

    assert asyncio.run(started_and_ended()) < 5


def test_a_child_that_has_ended_is_not_alive_before_the_event_loop_notices() -> None:
    async def alive() -> list[bool]:
        child = await AsyncChildProcess.start([sys.executable, "-I", "-c", "input()"])
        before = child.alive
        os.kill(child._process.pid, signal.SIGKILL)
        with suppress(ChildProcessError):  # whoever waits for it, and the loop has no turn
            os.waitid(os.P_PID, child._process.pid, os.WEXITED | os.WNOWAIT)
        after = child.alive
        await child.end()
        return [before, after, child.alive]

    assert asyncio.run(alive()) == [True, False, False]


ESCAPES = """
import os, time
from gpsfsm.workers.parent_link import ParentLink

def main():
    link = ParentLink()
    link.messages.get()
    reading, writing = os.pipe()
    if os.fork() == 0:
        os.setsid()
        if os.fork() == 0:  # an orphan, in a session of its own, that has the pipes of the child
            os.write(writing, str(os.getpid()).encode())
            time.sleep(600)
        os._exit(0)
    link.send({"escaped": int(os.read(reading, 20))})
    link.messages.get()
"""


@pytest.fixture
def escaped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[ChildProcess, int]]:
    """A child, and a process below it."""
    (tmp_path / "escapes.py").write_text(ESCAPES)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    child = ChildProcess(child_command("escapes:main", own_modules=False))
    head, _ = child.ask({}, within_s=60)
    yield child, head["escaped"]
    child.end()
    with suppress(ProcessLookupError):
        os.kill(head["escaped"], signal.SIGKILL)


def _ends(process: int) -> bool:
    until = time.monotonic() + 10
    while time.monotonic() < until:
        fields = _fields(Path(f"/proc/{process}/stat"))
        if not fields or fields[0] == "Z":
            return True
        time.sleep(0.02)
    return False


only_linux = pytest.mark.skipif(sys.platform != "linux", reason="orphans are found on Linux alone")


@only_linux
def test_what_has_left_the_group_and_the_session_of_a_child_ends_with_it(
    escaped: tuple[ChildProcess, int],
) -> None:
    child, process = escaped
    assert os.getsid(process) != os.getsid(child.pid)
    child.end()
    assert _ends(process)
    assert not child._thread.is_alive()


@only_linux
def test_what_a_child_has_started_ends_when_nobody_asks_it_any_more(
    escaped: tuple[ChildProcess, int],
) -> None:
    """As when its parent was killed: the pipe ends."""
    child, process = escaped
    assert child._process.stdin is not None
    child._process.stdin.close()
    assert child.exit_code() == 0
    assert _ends(process)


def test_a_child_is_never_left_stopped_by_who_is_killed_while_killing_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A stopped process would not notice that its parent has ended, and would stay for ever."""
    sent: list[tuple[int, int]] = []
    monkeypatch.setattr(
        link_module, "_send", lambda process, number: sent.append((process, number))
    )
    monkeypatch.setattr(link_module, "_below", lambda process: {process + 1, process + 2})
    link_module.kill_below(7, itself=True)
    assert (7, signal.SIGSTOP) not in sent
    assert sent == [
        *((8, signal.SIGSTOP), (9, signal.SIGSTOP)),
        *((8, signal.SIGKILL), (9, signal.SIGKILL), (7, signal.SIGKILL)),
    ]


def test_the_lines_of_standard_error_come_one_by_one() -> None:
    program = (
        "import sys; sys.stderr.buffer.write(b'one\\n' + b'x' * 20_000 + b'\\nlast'); "
        "sys.stderr.flush(); sys.stdin.read()"
    )
    lines: list[bytes] = []

    async def started_and_ended() -> None:
        child = await AsyncChildProcess.start([sys.executable, "-c", program], line=lines.append)
        async with asyncio.timeout(30):
            while b"last" not in b"".join(lines[-1:]) and len(b"".join(lines)) < 20_003:
                await asyncio.sleep(0.01)
        await child.end()
        await asyncio.sleep(0.1)

    asyncio.run(started_and_ended())
    assert lines[0] == b"one"
    assert lines[-1] == b"last"
    assert b"".join(lines[1:-1]) == b"x" * 20_000
    assert max(map(len, lines)) < 20_000, "a line without an end takes no memory without an end"
