"""Whatever programs do, and however gpsfsm ends: no process of them is left behind."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import pytest

from gpsfsm.execution.lane import Action, Lane
from gpsfsm.execution.runner import StopRequested
from gpsfsm.runners import generic
from gpsfsm.runners.generic import supervisor
from tests.runners.acting import WAIT_S, act, acting, context, fails

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")

SERVICES = {"allow_programs": [sys.executable]}


def marked(marker: str) -> dict[int, bytes]:
    """The processes that carry a marker in their environment or their arguments."""
    results = {}
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit() or int(folder.name) == os.getpid():
            continue
        try:
            command = (folder / "cmdline").read_bytes()
            text = (folder / "environ").read_bytes() + command
        except OSError:  # it has just ended, or is of somebody else
            continue
        if marker.encode() in text:
            results[int(folder.name)] = command
    return results


def until(condition: Callable[[], Any]) -> bool:
    end = time.monotonic() + WAIT_S
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.02)
    return False


@pytest.fixture
def marker(request: pytest.FixtureRequest) -> Iterator[str]:
    """A text by which the processes of a test are known; they are ended if any are left."""
    text = f"marker-{os.getpid()}-{abs(hash(request.node.nodeid))}"
    yield text
    for process in marked(text):
        os.kill(process, signal.SIGKILL)


HEAD = "import os, signal, sys, time\n"
IGNORES = "signal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
STAYS = "READY\ntime.sleep(60)\n"
NEW_SESSION = "if os.fork() == 0:\n    os.setsid()\n    time.sleep(60)\n"
DAEMON = (
    "if os.fork() == 0:\n    os.setsid()\n    signal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
    "    if os.fork() == 0:\n        os.close(1); os.close(2); time.sleep(60)\n    os._exit(0)\n"
)
BOMB = "for _ in range(5):\n    os.fork()\n"  # 32 processes
CHAIN = (  # the next one is started, then the one before ends
    "if os.fork() == 0:\n    for _ in range(10_000):\n"
    "        if os.fork(): os._exit(0)\n    os._exit(0)\n"
)
CASES = {
    "alone": STAYS,
    "ignores": IGNORES + STAYS,
    "new-session": NEW_SESSION + STAYS,
    "ignoring-children": IGNORES + NEW_SESSION + STAYS,
    "daemon": DAEMON + STAYS,
    "bomb": BOMB + STAYS,
    "ignoring-bomb": IGNORES + BOMB + STAYS,
    "stopped": NEW_SESSION + "READY\nos.kill(os.getpid(), signal.SIGSTOP)\n",
}


def program(code: str, file: Path | str = os.devnull) -> str:
    return HEAD + code.replace("READY", f"open({str(file)!r}, 'w').close()")


def services(marker: str) -> dict[str, Any]:
    return {**SERVICES, "environment": {"MARKER": marker}}


each_case = pytest.mark.parametrize("code", CASES.values(), ids=CASES)


@each_case
def test_after_its_time_nothing_is_left(code: str, marker: str) -> None:
    command = [sys.executable, "-c", program(code)]
    error = fails(generic.ProcessRunner(), services(marker), command=command, timeout_s=0.5)
    assert str(error).endswith("was stopped after 0.5 s")
    assert until(lambda: not marked(marker)), marked(marker)


@pytest.mark.parametrize("code", [NEW_SESSION, DAEMON, BOMB, CHAIN], ids=["new", "d", "b", "c"])
def test_when_it_ends_by_itself_nothing_is_left(code: str, marker: str) -> None:
    command = [sys.executable, "-c", HEAD + code + "print('done', flush=True)\n"]
    outputs = act(generic.ProcessRunner(), services(marker), command=command)
    assert "done" in outputs["stdout"]
    assert until(lambda: not marked(marker)), marked(marker)


@pytest.mark.parametrize("code", [CASES["daemon"], CASES["ignoring-bomb"]], ids=["d", "b"])
def test_when_it_is_stopped_nothing_is_left(code: str, marker: str, tmp_path: Path) -> None:
    ended: list[BaseException | None] = []
    over = threading.Event()

    def tell(_: object, error: BaseException | None) -> None:
        ended.append(error)
        over.set()

    lane = Lane("tested")
    values = {"command": [sys.executable, "-c", program(code, tmp_path / "ready")]}
    action = Action(lane, lambda: acting(generic.ProcessRunner(), services(marker), values), tell)
    assert until((tmp_path / "ready").exists)
    action.interrupt()
    assert over.wait(WAIT_S)
    lane.close()
    assert isinstance(ended[0], StopRequested)
    assert until(lambda: not marked(marker)), marked(marker)


def test_when_it_is_cut_off_nothing_is_left(marker: str, tmp_path: Path) -> None:
    """Then gpsfsm does not wait for the end of the program, which comes all the same."""
    lane = Lane("tested")
    values = {"command": [sys.executable, "-c", program(CASES["daemon"], tmp_path / "ready")]}
    action = Action(
        lane,
        lambda: acting(generic.ProcessRunner(), services(marker), values),
        lambda _value, _error: None,
    )
    assert until((tmp_path / "ready").exists)
    action.cut_off()
    lane.close()
    assert until(lambda: not marked(marker)), marked(marker)


@pytest.mark.parametrize("code", [CASES["daemon"], CASES["ignoring-bomb"]], ids=["d", "b"])
def test_when_gpsfsm_is_killed_nothing_is_left(code: str, marker: str, tmp_path: Path) -> None:
    """A real ``gpsfsm run --real`` and SIGKILL."""
    script, plan, ready = (tmp_path / name for name in ("program.py", "plan.xml", "ready"))
    script.write_text(program(code, ready))
    command = quoteattr(f"{sys.executable} {script} {marker}")
    plan.write_text(
        '<Plan><Runner interface="generic_capabilities/ProcessRunner" '
        f'provider="generic_capabilities/ProcessRunner" command={command} timeout_s="60"/></Plan>'
    )
    arguments = ["run", "--real", "--allow-program", sys.executable, "--force", str(plan)]
    running = subprocess.Popen(
        [sys.executable, "-m", "gpsfsm", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    try:
        assert until(lambda: ready.exists() or running.poll() is not None)
        assert running.poll() is None, running.stdout.read()  # type: ignore[union-attr]
        assert len(marked(marker)) >= 2  # the program and who supervises it
    finally:
        running.kill()
        running.communicate()
    assert until(lambda: not marked(marker)), marked(marker)


def supervisors(marker: str) -> list[int]:
    """The supervisors of a test, as far as they have begun with their program."""
    return [number for number, command in marked(marker).items() if b"supervisor.py" in command]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_supervisor_that_is_ended_takes_the_program_with_it(
    number: signal.Signals, marker: str, tmp_path: Path
) -> None:
    """Asked to, it ends everything; killed, it cannot, but the program ends with it."""
    ready = tmp_path / "ready"

    def end_it() -> None:
        until(ready.exists)
        os.kill(supervisors(marker)[0], number)

    ending = threading.Thread(target=end_it)
    ending.start()
    command = [sys.executable, "-c", program(CASES["bomb"], ready)]
    error = fails(generic.ProcessRunner(), services(marker), command=command)
    ending.join()
    if number is signal.SIGKILL:
        assert str(error) == "the process that supervises it was killed"
    else:
        assert str(error).endswith("ended with exit code -15")
    assert until(lambda: not marked(marker)), marked(marker)


def test_a_signal_that_ends_a_program_is_its_exit_code() -> None:
    command = [sys.executable, "-c", "import os; os.kill(os.getpid(), 9)"]
    error = fails(generic.ProcessRunner(), SERVICES, command=command)
    assert error.outputs["exit_code"] == -9


def test_nothing_of_the_supervisor_shows_in_a_program(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its input is empty, signals are as usual, only three files are open, few variables set."""
    monkeypatch.setenv("LD_LIBRARY_PATH", "/nowhere")
    monkeypatch.delenv("LANG", raising=False)
    code = (
        "import os, sys\n"
        "print(sys.stdin.read() == '', os.getsid(0) == os.getpid())\n"
        "print(sorted(set(os.environ) - {'LC_CTYPE'}), sorted(os.listdir('/proc/self/fd'))[:3])\n"
        "lines = open('/proc/self/status').read().splitlines()\n"
        "print([line for line in lines if line.startswith(('SigBlk', 'SigIgn', 'SigCgt'))])\n"
    )
    command = [sys.executable, "-I", "-c", code]
    # tests that run in the background of a shell ignore some signals, and so would this process
    as_usual = (
        "import os, signal, sys\n"
        "for each in (signal.SIGINT, signal.SIGQUIT): signal.signal(each, signal.SIG_DFL)\n"
        "os.execv(sys.argv[1], sys.argv[1:])\n"
    )
    expected = subprocess.run(
        [sys.executable, "-I", "-c", as_usual, *command],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        start_new_session=True,
        env={"PATH": os.environ["PATH"], "A": "\u00fc", "GPSFSM_KEY": "x"},
        check=True,
    )
    runner = generic.ProcessRunner()
    values = {**SERVICES, "environment": {"A": "\u00fc"}}
    for name in ("HOME", "LC_ALL", "LOGNAME", "TMPDIR", "TZ", "USER"):
        monkeypatch.delenv(name, raising=False)
    assert act(runner, values, command=command)["stdout"] == expected.stdout.decode()


def test_where_orphans_do_not_come_back_the_group_is_ended(marker: str, tmp_path: Path) -> None:
    """As on macOS: what a program leaves behind in its group."""
    as_elsewhere = (
        "import sys; sys.platform = 'other'; import runpy; "
        f"sys.argv = ['x', *sys.argv[1:]]; runpy.run_path({supervisor.__file__!r}, "
        "run_name='__main__')"
    )
    ours, theirs = socket.socketpair()
    code = HEAD + "if os.fork() == 0:\n    time.sleep(60)\nprint('done', flush=True)\n"
    with ours, theirs:
        started = subprocess.Popen(
            [sys.executable, "-c", as_elsewhere, "0.1", "MARKER", sys.executable, "-c", code],
            stdin=theirs.fileno(),
            env={"MARKER": marker},
            stdout=subprocess.PIPE,
        )
        theirs.close()
        ours.sendall(b"g")
        said = b""
        while piece := ours.recv(100):
            said += piece
        assert started.communicate()[0] == b"done\n"
    assert said.split()[-3:] == [b"ended", b"0", b"0"]
    assert until(lambda: not marked(marker)), marked(marker)


def test_what_cannot_be_ended_is_told(
    marker: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a program of another user, which may not be signalled: here no signal arrives at all."""
    powerless = tmp_path / "supervisor.py"
    powerless.write_text(
        "import os, runpy\nos.kill = lambda *_: None\n"
        f"runpy.run_path({supervisor.__file__!r}, run_name='__main__')\n"
    )
    monkeypatch.setattr("gpsfsm.runners.generic.process._SUPERVISOR", powerless)
    code = HEAD + "if os.fork() == 0:\n    time.sleep(60)\nprint('done', flush=True)\n"
    lines: list[str] = []
    runner = generic.ProcessRunner()
    runner._programs = frozenset([sys.executable])
    runner._environment = {"MARKER": marker}
    value: dict[str, Any] = {"command": [sys.executable, "-c", code]}
    assert asyncio.run(runner.run(value, context(lines)))["stdout"] == "done\n"
    assert lines == ["1 of its processes could not be ended"]
