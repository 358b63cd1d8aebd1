"""Runs the command line as a user does: in a process of its own."""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING

import gpsfsm
from tests.forked import Forked, can_fork, run_forked, write_program

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = [
    "ACCEPTED",
    "BROKEN",
    "REJECTED",
    "WARNED",
    "environment",
    "run",
    "runner",
    "shell",
    "start",
]
__all__ += ["write"]

TIMEOUT_S = 60


def runner(**parameters: str) -> str:
    """A runner that the built-in library describes, with all that it needs."""
    written = {"x": "1", "y": "2"} | parameters
    words = "".join(f' {key}="{value}"' for key, value in written.items())
    name = "nav2_capabilities/WaypointRunner"
    return f'<Runner interface="{name}" provider="{name}"{words}/>'


ACCEPTED = f"<Plan>\n  {runner()}\n</Plan>\n"
"""No warning; GP302, an info, at /Plan/Runner[1]."""
WARNED = f"<Plan>\n  {runner(speed='1')}\n</Plan>\n"
"""One warning: GP203 at /Plan/Runner[1]."""
REJECTED = f'<Plan>\n  <Control type="recovery">{runner()}</Control>\n</Plan>\n'
"""One error: GP307 at /Plan/Control[1]."""
BROKEN = "<Plan>\n  <Control>\n</Plan>\n"
"""Not well-formed: no facts."""


def environment(**changes: str) -> dict[str, str]:
    """What a process needs, and nothing that could colour or configure it."""
    kept = {name: os.environ[name] for name in ("PATH", "SYSTEMROOT", "HOME") if name in os.environ}
    own = {"XDG_CONFIG_HOME": os.devnull, "PYTHONPATH": str(Path(gpsfsm.__file__).parents[1])}
    return {**kept, **own, **changes}


def run(
    *arguments: str | Path,
    cwd: Path | None = None,
    stdin: bytes = b"",
    env: Mapping[str, str] | None = None,
    module: str = "gpsfsm",
) -> subprocess.CompletedProcess[bytes]:
    """``gpsfsm ARGUMENTS…`` (or another module); must end in time and without a traceback.

    What it starts for its own work is forked as well, unless the environment is Python's own.
    """
    words, around = [*map(str, arguments)], environment(**(env or {}))
    if can_fork(around):
        done = run_forked(
            words,
            cwd=cwd,
            stdin=stdin,
            environment=around,
            timeout_s=TIMEOUT_S,
            module=module,
            forks=True,
        )
    else:
        done = subprocess.run(
            [sys.executable, "-m", module, *words],
            cwd=cwd,
            input=stdin,
            env=around,
            capture_output=True,
            timeout=TIMEOUT_S,
            check=False,
        )
    assert b"Traceback" not in done.stderr + done.stdout
    return done


def start(
    *arguments: str | Path,
    cwd: Path | None = None,
    stdin: int = subprocess.DEVNULL,
    env: Mapping[str, str] | None = None,
) -> subprocess.Popen[bytes]:
    """Begin ``gpsfsm ARGUMENTS…``, with pipes for what it writes."""
    words, around = [*map(str, arguments)], environment(**(env or {}))
    if can_fork(around):
        return Forked(words, cwd=cwd, environment=around, stdin=stdin)
    return subprocess.Popen(
        [sys.executable, "-m", "gpsfsm", *words],
        cwd=cwd,
        stdin=stdin,
        env=around,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


@cache
def _program(_process: int) -> str:
    """The program that is forked; there is one for each process that runs tests."""
    folder = Path(mkdtemp(prefix="gpsfsm-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    write_program(folder)
    return str(folder / "gpsfsm")


def shell(command: str, folder: Path) -> subprocess.CompletedProcess[bytes]:
    """A command line with redirections; ``$GPSFSM`` is the program.

    ``$NEW_GPSFSM`` is a process that the shell itself starts: one that is forked gets none of the
    limits and further files that the shell hands on, and needs its first three files to be open.
    """
    replacements = {"$GPSFSM": '"$PROGRAM"', "$NEW_GPSFSM": '"$BEGIN" -m gpsfsm'}
    for name, words in replacements.items():
        command = command.replace(name, words)
    done = subprocess.run(
        ["sh", "-c", command],
        cwd=folder,
        env=environment(PROGRAM=_program(os.getpid()), BEGIN=sys.executable),
        capture_output=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    assert b"Traceback" not in done.stderr + done.stdout
    return done


def write(folder: Path, **texts: str) -> None:
    """``write(folder, a=text)`` writes a.xml."""
    folder.mkdir(exist_ok=True, parents=True)
    for name, text in texts.items():
        (folder / f"{name}.xml").write_text(text, encoding="utf-8")
