"""Processes of the command line that begin quickly: each is forked from one that has loaded it.

What a process of ``python -m gpsfsm`` does until it has read its modules takes longer than most of
what tests let it do. A process forked from one that has read them is as much a process of its own:
it has its own files, folder, environment, exit code and end. Where an environment could change how
Python itself begins, a new one is started instead.
"""

from __future__ import annotations

import atexit
import gc
import importlib
import json
import os
import pkgutil
import runpy
import select
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import traceback
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import IO, Any, NoReturn

__all__ = ["can_fork", "run_forked"]

_KNOWN = ("PATH", "SYSTEMROOT", "HOME", "PYTHONPATH")
_HEAVY = ("httpx", "lark", "lxml.etree", "networkx", "pydantic", "rich.console", "yaml", "z3")
_ROOT = Path(__file__).resolve().parents[1]


def can_fork(environment: Mapping[str, str]) -> bool:
    """Whether a process with this environment may be forked: it changes nothing of Python's own."""
    usual = environment.get("PYTHONPATH") == str(_ROOT)
    own = all(name in _KNOWN or name.startswith("GPSFSM_") for name in environment)
    return usual and own and hasattr(os, "fork") and hasattr(socket, "send_fds")


def run_forked(
    arguments: Sequence[str],
    *,
    cwd: Path | None,
    stdin: bytes,
    environment: Mapping[str, str],
    timeout_s: float,
) -> subprocess.CompletedProcess[bytes]:
    """``gpsfsm ARGUMENTS…`` in a process of its own. Raises TimeoutExpired, as ``run`` does."""
    line = _parent(os.getpid())
    new = tempfile.TemporaryFile  # no pipes: what the process leaves behind may hold them open
    with new() as given, new() as out, new() as errors:
        given.write(stdin)
        given.seek(0)
        wish = {
            "arguments": list(arguments),
            "folder": str(cwd or Path.cwd()),
            "environment": dict(environment),
        }
        files = [given.fileno(), out.fileno(), errors.fileno()]
        socket.send_fds(line, [_frame(wish)], files)
        child = int.from_bytes(_exactly(line, 4), "big")
        ready, _, _ = select.select([line], [], [], timeout_s)
        if not ready:
            os.kill(child, signal.SIGKILL)
        (code,) = struct.unpack("!i", _exactly(line, 4))
        words = ["gpsfsm", *arguments]
        written, complained = _whole(out), _whole(errors)
        if not ready:
            raise subprocess.TimeoutExpired(words, timeout_s, written, complained)
        return subprocess.CompletedProcess(words, code, written, complained)


def _whole(file: IO[bytes]) -> bytes:
    file.seek(0)
    return file.read()


def _frame(wish: Mapping[str, object]) -> bytes:
    data = json.dumps(wish).encode()
    return struct.pack("!i", len(data)) + data


def _exactly(line: socket.socket, most: int) -> bytes:
    found = b""
    while len(found) < most:
        part = line.recv(most - len(found))
        if not part:
            raise RuntimeError("the process that forks others has ended")
        found += part
    return found


@cache
def _parent(_process: int) -> socket.socket:
    """A line to the process that forks; one for each process that runs tests."""
    ours, theirs = socket.socketpair()
    with theirs:
        subprocess.Popen(
            [sys.executable, "-c", f"from tests.forked import serve; serve({theirs.fileno()})"],
            cwd=_ROOT,
            pass_fds=[theirs.fileno()],
            env={**os.environ, "PYTHONPATH": str(_ROOT)},
            stdin=subprocess.DEVNULL,
            start_new_session=True,  # keys are for the tests, not for it
        ).returncode = 0  # it ends with the line to it, and nobody waits for it
    return ours


# --- the process that forks ---------------------------------------------------------------------


def serve(number: int) -> None:
    """Read all modules, then fork a process for every wish that comes in."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # pressed at a terminal, it means the tests
    _read_all()
    gc.freeze()  # else each process would copy what it only counts
    line = socket.socket(fileno=number)
    while True:
        data, files, _, _ = socket.recv_fds(line, 4, 3)
        if not data:
            return
        wish = json.loads(_exactly(line, struct.unpack("!i", data)[0]))
        child = os.fork()
        if child == 0:
            line.close()
            _become(wish, files)
        for file in files:
            os.close(file)
        line.sendall(struct.pack("!i", child))
        _, status = os.waitpid(child, 0)
        line.sendall(struct.pack("!i", os.waitstatus_to_exitcode(status)))


def _read_all() -> None:
    """Read the modules of all commands, and by one check what that loads."""
    from gpsfsm import check, cli  # noqa: PLC0415

    commands = (f"{cli.__name__}.{module.name}" for module in pkgutil.iter_modules(cli.__path__))
    for name in (*_HEAVY, *commands):
        importlib.import_module(name)
    check('<Plan><Runner interface="demo/Go" provider="demo/Go"/></Plan>', solver="z3")


def _become(wish: Mapping[str, Any], files: Sequence[int]) -> NoReturn:
    """Be ``python -m gpsfsm``; ends as that does."""
    for target, file in enumerate(files):
        os.dup2(file, target)
        os.close(file)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.chdir(wish["folder"])
    os.environ.clear()
    os.environ.update(wish["environment"])
    sys.argv[:] = ["gpsfsm", *wish["arguments"]]
    sys.path[0] = wish["folder"]
    sys.stdin, sys.stdout, sys.stderr = (
        open(0, encoding="utf-8"),  # noqa: SIM115  (of a number)
        open(1, "w", encoding="utf-8"),  # noqa: SIM115
        open(2, "w", encoding="utf-8", errors="backslashreplace", buffering=1),  # noqa: SIM115
    )
    code: object = 1
    try:
        runpy.run_module("gpsfsm", run_name="__main__", alter_sys=True)
    except SystemExit as end:
        code = end.code
    except BaseException:
        traceback.print_exc()
    finally:  # what Python does at its end, but for tidying up its memory, which takes long
        threading._shutdown()  # type: ignore[attr-defined]
        atexit._run_exitfuncs()
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError, AttributeError):  # closed, perhaps by the program
                stream.flush()
        os._exit(code if isinstance(code, int) else int(code is not None))
