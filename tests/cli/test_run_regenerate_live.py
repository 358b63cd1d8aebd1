"""Plans that a model writes behind those that gave up: for real, interrupted, and killed."""

from __future__ import annotations

import signal
import subprocess
import time
from typing import TYPE_CHECKING

import pytest

from tests.cli.regenerating import (
    CLOSING,
    ELSEWHERE,
    MISSION,
    MODEL,
    TASK,
    answers,
    plan,
    rows,
    statuses,
)
from tests.cli.support import run, start, write
from tests.generation.fake_server import FakeServer

if TYPE_CHECKING:
    from pathlib import Path

PROCESS = "generic_capabilities/ProcessRunner"
WAIT = "generic_capabilities/WaitRunner"


def program(name: str) -> str:
    return f'<Runner interface="{PROCESS}" provider="{PROCESS}" command="{name}"/>'


def wait(seconds: float) -> str:
    return f'<Runner interface="{WAIT}" provider="{WAIT}" seconds="{seconds}"/>'


def under_way(
    folder: Path, server: FakeServer, *arguments: str, journal: str = "run.db"
) -> subprocess.Popen[bytes]:
    """A run whose request for another plan has reached the server, which does not answer."""
    how = ("--model", "openai-compatible:tiny", "--base-url", f"{server.url}/v1", "--no-constrain")
    command = ("run", *arguments, *how, "--journal", journal)
    process = start(*command, cwd=folder, stdin=subprocess.PIPE)
    until = time.monotonic() + 60
    while not server.plan_requests:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
        time.sleep(0.01)
    return process


ALLOWED = ("--allow-program", "false", "--allow-program", "true")
REAL = ("a.xml", "--real", *ALLOWED, "--task", "Wait.")
HOW = [(MISSION, "--world", CLOSING, "--task", TASK), REAL]


@pytest.mark.parametrize("how", HOW)
def test_ctrl_c_ends_the_request_at_once(how: tuple[str, ...], tmp_path: Path) -> None:
    write(tmp_path, a=plan(program("false")), b=plan(wait(600)))
    with (
        FakeServer(faults=["slow:60"] * 9) as server,
        under_way(tmp_path, server, *how, "b.xml") as process,
    ):
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)  # not the 60 seconds of the server
    assert (process.returncode, b"Traceback" in err) == (130, False), (out, err)
    assert b"plan 1 is not continued: interrupted" in err
    assert statuses(tmp_path / "run.db") == ["GAVE_UP"]
    done = run("resume", "run.db", *MODEL, "--real", cwd=tmp_path)
    assert b"has ended already: GAVE_UP" in done.stderr


@pytest.mark.parametrize("how", HOW)
def test_killed_while_the_model_is_asked(how: tuple[str, ...], tmp_path: Path) -> None:
    write(tmp_path, a=plan(program("false")))
    answers(tmp_path, plan(wait(0.01)) if how is REAL else ELSEWHERE)
    with FakeServer(faults=["slow:60"] * 9) as server, under_way(tmp_path, server, *how) as process:
        process.kill()
    allowed = ALLOWED if how is REAL else ()
    done = run("resume", "run.db", "--real", *allowed, cwd=tmp_path)
    assert done.returncode == 2
    assert b"name it: --model" in done.stderr  # a journal makes nobody ask
    done = run("resume", "run.db", *MODEL, "--real", *allowed, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert statuses(tmp_path / "run.db") == ["GAVE_UP", "COMPLETED"]
    assert len(rows(tmp_path / "run.db", "ASKED")) == 1  # the question is the same to the letter


def test_for_real_a_failed_program_is_followed_by_another_plan(tmp_path: Path) -> None:
    write(tmp_path, a=plan(wait(0.01), program("false")))
    answers(tmp_path, plan(program("false"), wait(0.02)), plan(program("true")))
    done = run("run", *REAL, *MODEL, "--journal", "run.db", cwd=tmp_path)
    assert done.returncode == 0, (done.stdout, done.stderr)
    assert statuses(tmp_path / "run.db") == ["GAVE_UP", "GAVE_UP", "COMPLETED"]
    done = run("replay", "run.db", cwd=tmp_path)
    assert done.stdout.count(b"without simulating it again") == 3


def test_a_bond_that_is_lost_while_a_model_is_asked_begins_no_plan(tmp_path: Path) -> None:
    write(tmp_path, a=plan(program("false")))
    answers(tmp_path, plan(wait(0.01)))
    with (
        FakeServer(faults=["slow:60"] * 9) as server,
        under_way(tmp_path, server, *REAL, "--bond", "2") as process,
    ):
        out, err = process.communicate(timeout=30)
    assert process.returncode == 1, (out, err)
    assert b"the bond is lost, so 1 plan has not begun" in err
    assert rows(tmp_path / "run.db", "GENERATED") == []
    done = run("resume", "run.db", *MODEL, "--real", *ALLOWED, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert statuses(tmp_path / "run.db") == ["GAVE_UP", "COMPLETED"]
