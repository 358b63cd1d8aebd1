"""The keys of the live view, on real terminals: space pauses, q cancels, no terminal stays raw."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from typing import TYPE_CHECKING

import pytest

from gpsfsm.compile import compile_plan
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Kind, Status
from gpsfsm.execution.runner import Runner
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.running.interruption import Interruption
from gpsfsm.running.pace import InterruptiblePace
from gpsfsm.syntax import parse
from tests.cli.support import environment, run, write
from tests.cli.terminal import PATIENCE_S, SPACE_PAUSES, Terminal, gpsfsm

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from gpsfsm.execution.records import Input, Record, RunValue
    from gpsfsm.execution.runner import RunContext

WAIT = "generic_capabilities/WaitRunner"
HOW = [["--speed", "5"], ["--real"]]


def a_while(how: list[str]) -> float:
    """As a plan says it for 1.5 s of a clock on the wall: in time for a slow machine."""
    return 7.5 if "--speed" in how else 1.5


def waits(*seconds: float) -> str:
    written = (f'<Runner interface="{WAIT}" provider="{WAIT}" seconds="{s}"/>' for s in seconds)
    return f"<Plan>\n{''.join(written)}\n</Plan>\n"


def kinds(folder: Path, number: int = 1) -> list[str]:
    done = run("events", "run.db", "--run", str(number), "--format", "jsonl", cwd=folder)
    assert done.returncode == 0
    return [json.loads(line).get("kind", "") for line in done.stdout.splitlines()]


@pytest.mark.parametrize("how", HOW)
def test_space_pauses_and_goes_on_and_q_cancels(how: list[str], tmp_path: Path) -> None:
    write(tmp_path, a=waits(a_while(how), 600, 600))
    command = gpsfsm("run", "a.xml", *how, "--journal", "run.db")
    with Terminal(command, tmp_path) as terminal:
        terminal.until(SPACE_PAUSES)
        assert terminal.is_raw
        terminal.type("x\x1b[A ")
        terminal.until("paused: space continues, q cancels")
        terminal.until("is held until the run continues")
        terminal.type(" ")
        terminal.until("the run continues")
        terminal.until(SPACE_PAUSES)
        terminal.type("qqq")  # held down: it is no second Ctrl-C
        assert terminal.ended() == 130
        assert not terminal.is_raw
        assert "CANCELLED after" in terminal.shown
        assert SPACE_PAUSES not in terminal.shown.partition("CANCELLED")[2]
    events = kinds(tmp_path)
    assert [kind for kind in events if kind in ("PAUSE", "HELD", "RESUME", "CANCEL")] == [
        "PAUSE",
        "HELD",
        "RESUME",
        "CANCEL",
    ]
    done = run("replay", "run.db", cwd=tmp_path)
    assert done.returncode == 0
    if "--real" not in how:
        assert b"and simulated again" in done.stdout


@pytest.mark.parametrize(
    ("leaving", "code"),
    [
        ("end", 0),
        ("\x03", 130),
        ("\x03\x03", 130),
        (signal.SIGTERM, 130),
        (signal.SIGHUP, 130),
        ("\x1c", -signal.SIGQUIT),
    ],
)
def test_the_terminal_is_restored_however_a_run_ends(
    leaving: str | signal.Signals, code: int, tmp_path: Path
) -> None:
    write(tmp_path, a=waits(1) if leaving == "end" else waits(600))
    with Terminal(gpsfsm("run", "a.xml", "--real"), tmp_path) as terminal:
        terminal.until(SPACE_PAUSES)
        assert terminal.is_raw
        if isinstance(leaving, signal.Signals):
            os.kill(terminal.pid, leaving)
        elif leaving != "end":
            terminal.type(leaving)
        assert terminal.ended() == code, terminal.shown[-3000:]
        assert not terminal.is_raw
        assert "Traceback" not in terminal.shown
        assert "\x1b[?25h" in terminal.shown  # the cursor


def test_the_terminal_is_restored_when_the_journal_breaks(tmp_path: Path) -> None:
    write(tmp_path, a=waits(1, 1, 600))
    command = gpsfsm("run", "a.xml", "--real", "--journal", "run.db")
    with Terminal(command, tmp_path) as terminal:
        terminal.until(SPACE_PAUSES)
        with closing(sqlite3.connect(tmp_path / "run.db")) as other:
            other.execute("ALTER TABLE event RENAME TO gone")
        assert terminal.ended() == 2
        assert not terminal.is_raw


def test_ctrl_z_gives_the_terminal_back_for_a_while(tmp_path: Path) -> None:
    shell = shutil.which("bash")
    if shell is None:
        pytest.skip("there is no bash, whose job control this needs")
    write(tmp_path, a=waits(1, 600))
    with Terminal([shell, "--norc", "--noprofile", "-i"], tmp_path, PS1="READY:") as terminal:
        terminal.until("READY:")
        terminal.type(f"{' '.join(gpsfsm('run', 'a.xml', '--speed', '1'))}\n")
        terminal.until(SPACE_PAUSES)
        terminal.type("\x1a")
        terminal.until("READY:")
        terminal.type("stty -a\n")
        modes = terminal.until("READY:").split()
        assert "-icanon" not in modes
        assert "icanon" in modes
        terminal.type("bg\n")
        terminal.until("READY:")
        terminal.type("echo '<'space q'>'\n")  # in the background no key is for the run
        terminal.until("<space q>")
        terminal.until("READY:")
        terminal.type("fg\n")
        terminal.until(SPACE_PAUSES)
        terminal.type("q")
        terminal.until("CANCELLED after")
        terminal.until("READY:")
        terminal.type("stty -a; exit 7\n")
        assert terminal.ended() == 7
        assert "-icanon" not in terminal.shown.split()


LEADER = """
import os, signal, subprocess, sys

orders = open(sys.argv[1])
signal.signal(signal.SIGTTOU, signal.SIG_IGN)
job = subprocess.Popen(sys.argv[2:], process_group=0, restore_signals=True,
    preexec_fn=lambda: signal.signal(signal.SIGTTOU, signal.SIG_DFL))
os.tcsetpgrp(0, job.pid)
for order in orders:
    match order.strip():
        case "stop":
            os.killpg(job.pid, signal.SIGTSTP)
            os.waitpid(job.pid, os.WUNTRACED)
            os.tcsetpgrp(0, os.getpgrp())
        case "bg":
            os.killpg(job.pid, signal.SIGCONT)
        case "fg":  # as shells do it with a job that runs: without any signal
            os.tcsetpgrp(0, job.pid)
    print(f"<{order.strip()}>", flush=True)
sys.exit(job.wait())
"""


def test_keys_come_back_without_a_signal_and_without_a_key(tmp_path: Path) -> None:
    write(tmp_path, a=waits(600))
    orders = tmp_path / "orders"
    os.mkfifo(orders)
    command = gpsfsm("run", "a.xml", "--real")
    with (
        Terminal([sys.executable, "-c", LEADER, str(orders), *command], tmp_path) as terminal,
        orders.open("w", buffering=1, encoding="utf-8") as tell,
    ):
        for _ in range(2):
            terminal.until(SPACE_PAUSES)
            assert terminal.is_raw
            for order in ("stop", "bg"):
                tell.write(f"{order}\n")
                terminal.until(f"<{order}>")
                assert not terminal.is_raw
            time.sleep(0.5)  # it goes on in the background for a while
            assert not terminal.is_raw
            tell.write("fg\n")
        terminal.until(SPACE_PAUSES)
        terminal.type("q")
        terminal.until("CANCELLED after")
        tell.close()
        assert terminal.ended() == 130
        assert not terminal.is_raw


@pytest.mark.parametrize(
    ("arguments", "second"),
    [
        (["--bond", "60"], "2 started, 1 succeeded"),
        (["--format", "plain"], "WaitRunner (seconds=600) started"),
    ],
)
def test_no_keys_are_read_where_nobody_is_to_press_them(
    arguments: list[str], second: str, tmp_path: Path
) -> None:
    write(tmp_path, a=waits(1, 600))
    with Terminal(gpsfsm("run", "a.xml", "--real", *arguments), tmp_path) as terminal:
        shown = terminal.until("WaitRunner")
        assert not terminal.is_raw
        terminal.type("q\n ")
        shown += terminal.until(second)  # a second later: the keys did nothing
        os.kill(terminal.pid, signal.SIGTERM)
        assert terminal.ended() == 130
        assert "2 started, 1 succeeded" in terminal.shown
        assert SPACE_PAUSES not in shown + terminal.shown


@pytest.mark.parametrize("how", HOW)
def test_a_run_that_was_killed_while_it_paused_goes_on(how: list[str], tmp_path: Path) -> None:
    write(tmp_path, a=waits(a_while(how), 0.1))
    command = gpsfsm("run", "a.xml", *how, "--journal", "run.db")
    with Terminal(command, tmp_path) as terminal:
        terminal.until(SPACE_PAUSES)
        terminal.type(" ")
        terminal.until("is held until the run continues")
        os.kill(terminal.pid, signal.SIGKILL)
        assert terminal.ended() == -signal.SIGKILL
    done = run("resume", "run.db", *(["--real"] if "--real" in how else []), cwd=tmp_path)
    assert done.returncode == 0
    assert b"COMPLETED" in done.stdout
    events = kinds(tmp_path)
    assert (events.count("PAUSE"), events.count("RESUME")) == (1, 1)
    assert run("replay", "run.db", cwd=tmp_path).returncode == 0


def test_a_terminal_that_is_closed_cancels_a_real_run(tmp_path: Path) -> None:
    write(tmp_path, a=waits(600))
    command = gpsfsm("run", "a.xml", "--real", "--journal", "run.db")
    with Terminal(command, tmp_path) as terminal:
        terminal.until(SPACE_PAUSES)
        os.close(terminal.number)
        assert terminal.process.wait(PATIENCE_S) == 130
        terminal.number = os.open(os.devnull, os.O_RDONLY)
    assert kinds(tmp_path)[-1] == "ENDED"


def test_nohup_keeps_a_run_going(tmp_path: Path) -> None:
    write(tmp_path, a=waits(0.8))
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        process = subprocess.Popen(
            gpsfsm("run", "a.xml", "--real"),
            cwd=tmp_path,
            env=environment(),
            stdout=subprocess.PIPE,
        )
    finally:
        signal.signal(signal.SIGHUP, before)
    with process:
        assert process.stdout is not None
        assert b"started" in process.stdout.readline()
        process.send_signal(signal.SIGHUP)
        assert b"succeeded" in process.stdout.readline()
        process.communicate(timeout=30)
    assert process.returncode == 0


# -- in virtual time, without a terminal ----------------------------------------------------------


class Sleeper(Runner):
    """Sleeps for as long as its plan says."""

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        await context.sleep(float(str(parameters["seconds"])))


class Rows:
    """A sink that keeps kinds with their times."""

    def __init__(self) -> None:
        self.kept: list[tuple[int, Kind]] = []

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        self.kept += [(at_us, record.kind) for record in records]

    def at(self, kind: Kind) -> int:
        return next(at_us for at_us, each in self.kept if each is kind)


def simulated(
    text: str, interruption: Interruption, *, speed: float | None
) -> tuple[VirtualDriver, InterruptiblePace, Rows]:
    plan = parse(text, file="p.xml").plan
    assert plan is not None
    sink = Rows()
    kernel = Kernel(compile_plan(plan))
    pace = InterruptiblePace(interruption, speed)
    return VirtualDriver(kernel, sink, lambda *_: Sleeper(), pace=pace), pace, sink


@pytest.mark.parametrize("speed", [None, 1e6])
def test_a_runner_that_hangs_is_stuck_at_once(speed: float | None) -> None:
    driver, _, _ = simulated(waits(1e300), Interruption(), speed=speed)
    driver.run()
    assert driver.kernel.status is Status.STUCK


def test_who_cancels_does_so_now() -> None:
    interruption = Interruption()
    driver, pace, sink = simulated(waits(1e6), interruption, speed=1e5)

    def tick(now_us: int) -> None:
        interruption.requested = interruption.requested or now_us > 1_000_000

    pace.tick = tick
    driver.run()
    assert driver.kernel.status is Status.CANCELLED
    assert 1_000_000 < sink.at(Kind.CANCEL) < 1e12


@pytest.mark.parametrize("speed", [None, 1e5])
def test_a_pause_waits_for_somebody(speed: float | None) -> None:
    interruption, ticks = Interruption(), []
    driver, pace, sink = simulated(waits(1, 1), interruption, speed=speed)
    interruption.toggle()

    def tick(now_us: int) -> None:
        ticks.append(now_us)
        if len(ticks) == 3:
            interruption.toggle()

    pace.tick = tick
    pace.before_run(driver)
    driver.run()
    assert driver.kernel.status is Status.COMPLETED
    assert [kind for _, kind in sink.kept[:3]] == [Kind.PAUSE, Kind.BEGIN, Kind.HELD]
    assert (sink.at(Kind.RESUME) > 0) is (speed is not None)  # else time stands still


def test_what_a_key_asks_for_is_told() -> None:
    paused: list[bool] = []
    interruption = Interruption()
    turned: Callable[[bool], None] = paused.append
    interruption.on_pause = turned
    interruption.toggle()
    interruption.toggle()
    assert paused == [True, False]
