"""Processes of the command line that begin quickly: each is forked from one that has loaded it.

What a process of ``python -m gpsfsm`` does until it has read its modules takes longer than most of
what tests let it do. A process forked from one that has read them is as much a process of its own:
it has its own files, folder, environment, exit code and end. Where an environment could change how
Python itself begins, a new one is to be started instead. With ``forks`` the workers of such a
process are forked from it in turn, and are as much children of it as those that it would start.
"""

from __future__ import annotations

import atexit
import fcntl
import gc
import importlib
import json
import os
import pkgutil
import runpy
import select
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import traceback
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import IO, Any, NoReturn

__all__ = ["Forked", "can_fork", "run_forked", "take_terminal", "write_program"]

_OF_PYTHON = ("PYTHON", "LANG", "LC_", "LD_")
_UTF8 = (  # as it is where nothing is said, in the tests
    ("LANG", "C.UTF-8"),
    ("LC_ALL", "C.UTF-8"),
    ("LC_CTYPE", "C.UTF-8"),
    ("PYTHONUTF8", "1"),
)
_HEAVY = ("httpx", "lark", "lxml.etree", "networkx", "pydantic", "rich.console", "yaml", "z3")
_QUEUE = "gpsfsm.running.serving"  # a program of the service
_EXTRA = ("starlette.applications", "starlette.responses", "uvicorn")  # if they are installed
_ROOT = Path(__file__).resolve().parents[1]


def can_fork(environment: Mapping[str, str]) -> bool:
    """Whether a process with this environment may be forked: it changes nothing of Python's own."""
    usual = (*_UTF8, ("PYTHONPATH", str(_ROOT)))
    changed = (each for each in environment.items() if each not in usual)
    own = not any(name.startswith(_OF_PYTHON) for name, _ in changed)
    return own and hasattr(os, "fork") and hasattr(socket, "send_fds")


class Forked(subprocess.Popen[bytes]):
    """``python -m MODULE ARGUMENTS…``; whoever has it does with it what is done with a Popen."""

    def __init__(
        self,
        arguments: Sequence[str],
        *,
        cwd: Path | None,
        environment: Mapping[str, str],
        stdin: int | IO[bytes] = subprocess.DEVNULL,
        stdout: int | IO[bytes] = subprocess.PIPE,
        stderr: int | IO[bytes] = subprocess.PIPE,
        module: str = "gpsfsm",
        leads: bool = False,
        forks: bool = False,
    ) -> None:
        """``leads``: standard input is a terminal, which is to be its own (as a login has one).

        ``forks``: the children that it starts for its own work are forked from it.
        """
        assert can_fork(environment), environment
        self._wish = {
            "module": module,
            "arguments": list(arguments),
            "folder": str(cwd or Path.cwd()),
            "environment": dict(environment),
            "leads": leads,
            "forks": forks,
        }
        words = [module, *arguments]
        super().__init__(words, stdin=stdin, stdout=stdout, stderr=stderr)

    def _execute_child(self, *details: Any) -> None:
        """Called by Popen, which has made the pipes."""
        pipes = details[10:16]
        standard = (pipes[0], pipes[3], pipes[5])
        files = [number if used == -1 else used for number, used in enumerate(standard)]
        self._line = socket.socket(socket.AF_UNIX)
        self._line.connect(_address(os.getpid()))
        socket.send_fds(self._line, [_frame(self._wish)], files)
        self._close_pipe_fds(*pipes)  # type: ignore[attr-defined]
        self.pid = self._status()

    def _status(self) -> int:
        return int(struct.unpack("!i", _exactly(self._line, 4))[0])

    def _internal_poll(self, *_: object, **__: object) -> int | None:
        with self._waitpid_lock:  # type: ignore[attr-defined]  # several threads may ask at once
            if self.returncode is None and select.select([self._line], [], [], 0)[0]:
                self.returncode = self._status()
                self._line.close()
        return self.returncode

    def _wait(self, timeout: float | None) -> int:
        if self.returncode is None:
            select.select([self._line], [], [], timeout)
            if self._internal_poll() is None:
                raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
        return self.returncode


def run_forked(
    arguments: Sequence[str],
    *,
    cwd: Path | None,
    stdin: bytes,
    environment: Mapping[str, str],
    timeout_s: float,
    module: str = "gpsfsm",
    forks: bool = False,
) -> subprocess.CompletedProcess[bytes]:
    """``python -m MODULE ARGUMENTS…``, to its end. Raises TimeoutExpired, as ``run`` does."""
    new = tempfile.TemporaryFile  # no pipes: what the process leaves behind may hold them open
    with new() as child, new() as out, new() as errors:
        child.write(stdin)
        child.seek(0)
        with Forked(
            arguments,
            cwd=cwd,
            environment=environment,
            stdin=child,
            stdout=out,
            stderr=errors,
            module=module,
            forks=forks,
        ) as process:
            try:
                code = process.wait(timeout_s)
            except subprocess.TimeoutExpired as error:
                process.kill()
                process.wait()
                error.output, error.stderr = _whole(out), _whole(errors)
                raise
        return subprocess.CompletedProcess(process.args, code, _whole(out), _whole(errors))


def _whole(file: IO[bytes]) -> bytes:
    file.seek(0)
    return file.read()


def _frame(wish: Mapping[str, object]) -> bytes:
    data = json.dumps(wish).encode()
    return struct.pack("!i", len(data)) + data


def _exactly(line: socket.socket, most: int) -> bytes:
    output = b""
    while len(output) < most:
        part = line.recv(most - len(output))
        if not part:
            raise RuntimeError("the process that forks others has ended")
        output += part
    return output


@cache
def _address(_process: int) -> str:
    """Where the process that forks is asked; there is one for each process that runs tests."""
    folder = tempfile.mkdtemp(prefix="gpsfsm-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    address = f"{folder}/wishes"
    with socket.socket(socket.AF_UNIX) as wishes:
        wishes.bind(address)
        wishes.listen(100)
        code = f"from tests.forked import serve; serve({wishes.fileno()})"
        process = subprocess.Popen(
            [sys.executable, "-c", code],
            cwd=_ROOT,
            pass_fds=[wishes.fileno()],
            env={**os.environ, **dict(_UTF8), "PYTHONPATH": str(_ROOT)},
            stdin=subprocess.PIPE,
            start_new_session=True,  # keys are for the tests, not for it
        )
    atexit.register(process.communicate)  # the end of its input is its own
    return address


_PROGRAM = """\
#!{python} -IS
import json, os, signal, socket, sys

usual = {usual!r}
changed = [name for name, value in os.environ.items() if (name, value) not in usual]
if any(name.startswith({of_python!r}) for name in changed):
    os.execv({python!r}, [{python!r}, "-m", "gpsfsm", *sys.argv[1:]])
wish = {{
    "module": "gpsfsm",
    "arguments": sys.argv[1:],
    "folder": os.getcwd(),
    "first": os.path.dirname(sys.argv[0]),
    "environment": dict(os.environ),
    "forks": True,
}}
data = json.dumps(wish).encode()
line = socket.socket(socket.AF_UNIX)
line.connect({address!r})
socket.send_fds(line, [len(data).to_bytes(4, "big") + data], [0, 1, 2])
child = int.from_bytes(line.recv(4), "big")
for number in (signal.SIGHUP, signal.SIGINT, signal.SIGTERM):
    signal.signal(number, lambda number, _: os.kill(child, number))
code = int.from_bytes(line.recv(4), "big", signed=True)
if code < 0:
    signal.signal(-code, signal.SIG_DFL) if -code != signal.SIGKILL else None
    os.kill(os.getpid(), -code)
os._exit(code)
"""


def write_program(folder: Path) -> None:
    """Write a program ``gpsfsm`` for shell scripts, which is forked wherever it may be."""
    program = folder / "gpsfsm"
    text = _PROGRAM.format(
        python=sys.executable,
        usual=(*_UTF8, ("PYTHONPATH", str(_ROOT))),
        of_python=_OF_PYTHON,
        address=_address(os.getpid()),
    )
    program.write_text(text, encoding="utf-8")
    program.chmod(0o755)


# --- the process that forks ---------------------------------------------------------------------


def serve(number: int) -> None:
    """Read all modules, then fork a process for every wish that comes in."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # pressed at a terminal, it means the tests
    _read_all()
    gc.freeze()  # else each process would copy what it only counts
    wishes = socket.socket(fileno=number)
    ended, wakes = socket.socketpair()
    wakes.setblocking(False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(wakes.fileno(), warn_on_full_buffer=False)
    lines: dict[socket.socket, int] = {}  # to those who wait for the end of a process
    while True:
        waiting: list[Any] = [sys.stdin, wishes, ended, *lines]
        ready = set(select.select(waiting, [], [])[0])
        if sys.stdin in ready:
            return
        if ended in ready:
            ended.recv(4096)
            _tell_of_ends(lines)
        for line in lines.keys() & ready:  # whoever waited is gone
            os.kill(lines[line], signal.SIGKILL)
            _tell(line, os.waitstatus_to_exitcode(os.waitpid(lines.pop(line), 0)[1]))
        if wishes in ready:
            line, _ = wishes.accept()
            data, files, _, _ = socket.recv_fds(line, 4, 3)
            if not data:  # it has thought better of it
                continue
            wish = json.loads(_exactly(line, struct.unpack("!i", data)[0]))
            child = os.fork()
            if child == 0:
                signal.set_wakeup_fd(-1)
                for ours in (wishes, ended, wakes, line, *lines):
                    ours.close()
                _become(wish, files)
            for file in files:
                os.close(file)
            lines[line] = child
            with suppress(OSError):  # gone: the next round will see it
                line.sendall(struct.pack("!i", child))


def _tell_of_ends(lines: dict[socket.socket, int]) -> None:
    for line, child in list(lines.items()):
        pid, status = os.waitpid(child, os.WNOHANG)
        if pid:
            del lines[line]
            _tell(line, os.waitstatus_to_exitcode(status))


def _tell(line: socket.socket, code: int) -> None:
    with line, suppress(OSError):  # nobody wants to know
        line.sendall(struct.pack("!i", code))


def _read_all() -> None:
    """Read all modules, those too that commands load late, and by one check what that loads."""
    import gpsfsm

    for name in _HEAVY:
        importlib.import_module(name)
    modules = pkgutil.walk_packages(gpsfsm.__path__, "gpsfsm.", onerror=lambda _: None)
    names = (module.name for module in modules)
    for name in (*_EXTRA, *names):
        if not name.endswith("__main__"):
            with suppress(ImportError):
                importlib.import_module(name)
    gpsfsm.check('<Plan><Runner interface="demo/Go" provider="demo/Go"/></Plan>', solver="z3")


def take_terminal() -> None:
    """Lead a session whose terminal is standard input."""
    if os.getsid(0) != os.getpid():
        os.setsid()
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


def _become(wish: Mapping[str, Any], files: Sequence[int]) -> NoReturn:
    """Be ``python -m MODULE``; ends as that does."""
    for target, file in enumerate(files):
        os.dup2(file, target)
        os.close(file)
    if wish.get("leads"):
        take_terminal()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    os.chdir(wish["folder"])
    os.environ.clear()
    os.environ.update(wish["environment"])
    sys.argv[:] = [wish["module"], *wish["arguments"]]
    sys.path[0] = wish.get("first", wish["folder"])
    sys.stdin, sys.stdout, sys.stderr = (
        open(0, encoding="utf-8", errors="surrogateescape"),  # noqa: SIM115  (of a number)
        open(1, "w", encoding="utf-8", errors="surrogateescape"),  # noqa: SIM115
        open(2, "w", encoding="utf-8", errors="backslashreplace", buffering=1),  # noqa: SIM115
    )
    if wish.get("forks"):
        _fork_children()
    code: object = 1
    try:
        runpy.run_module(wish["module"], run_name="__main__", alter_sys=True)
        code = 0
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


# --- the children of what was forked --------------------------------------------------------------


_former: list[object] = []
"""Streams that would close the files of others if nobody had them any more."""


def _fork_children() -> None:
    """From now on fork the children of ``child_command``, which else load all modules anew."""
    from gpsfsm.workers.child_process import child_command

    start = child_command("")[:-1][:4]

    class Popen(subprocess.Popen[bytes]):
        def __init__(self, args: Any, *more: Any, **options: Any) -> None:
            words = list(args)
            if words[:4] == start or (words[1:3] == ["-P", "-m"] and words[3:] == [_QUEUE]):
                options["preexec_fn"] = partial(_be_child, words[3:], options.get("env"))
            super().__init__(args, *more, **options)

    vars(subprocess)["Popen"] = Popen


def _be_child(words: Sequence[str], environment: Mapping[str, str] | None) -> NoReturn:
    """Be the child, once Popen has given it its files and its session; ends as that does."""
    code = 1
    try:
        gc.freeze()  # what its parent had open stays in its memory, but is not to be closed by it
        signal.set_wakeup_fd(-1)
        for number in (signal.SIGTERM, signal.SIGCHLD, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        os.closerange(3, 1 << 20)
        if environment is not None:
            os.environ.clear()
            os.environ.update(environment)
        _former.extend((sys.stdin, sys.stdout, sys.stderr))
        sys.stdin, sys.stdout = os.fdopen(0, closefd=False), os.fdopen(1, "w", closefd=False)
        sys.stderr = os.fdopen(2, "w", 1, errors="backslashreplace", closefd=False)
        sys.argv[1:] = []
        if words == [_QUEUE]:
            _take_name(_QUEUE)
            sys.exit(importlib.import_module(_QUEUE).main())
        _, target, *sys.path[:] = words
        _take_name(target.partition(":")[0])
        importlib.import_module("gpsfsm.workers.parent_link").main(target)
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError, AttributeError):
                stream.flush()
        os._exit(code)


def _take_name(module: str) -> None:
    """Have the end of its name, for whoever looks for the process: its command is its parent's."""
    with suppress(OSError):
        Path("/proc/self/comm").write_text(".".join(module.split(".")[-2:]), encoding="ascii")
