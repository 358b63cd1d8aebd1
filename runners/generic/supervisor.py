"""Watches over one program, in a process of its own, so that nothing of it is left behind.

A script of its own, of the standard library alone, so that it starts within milliseconds:

    python -I -S supervisor.py GRACE_S NAME=NAME=… PROGRAM [ARGUMENT]…

``NAME=NAME`` are the variables of its environment that the program gets. Standard input is a
socket to the process that has asked for the program. When a byte arrives there the program is
started, and ``started PID`` or ``error ERRNO`` is written. When the other end is closed, for
whatever reason, the program and all that it has started are asked to end, and killed after the
grace time. When the program ends by itself, what it leaves behind is killed at once. At last
``ended CODE LEFT`` is written: the exit code (negative: the signal) and how many processes could
not be killed.

On Linux orphans come to the supervisor and not to the init process, so it finds all descendants,
whatever they have done to get away. Elsewhere it finds the process group of the program.
"""

from __future__ import annotations

import ctypes
import os
import select
import signal
import sys
import time
from contextlib import suppress

_CONTROL = 0  # file descriptor of the socket
_KILL_S = 2.0  # for killing: there are processes that cannot be killed
_TICK_S = 0.02
_STOPS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT)
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36
_IS_LINUX = sys.platform == "linux"


class _Supervisor:
    """The program and its descendants. ``code`` is None while the program runs."""

    def __init__(self) -> None:
        self.program = 0
        self.code: int | None = None
        self.stopping = False
        self._woken, wake = os.pipe()
        for end in (self._woken, wake):
            os.set_blocking(end, False)
        signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
        for number in (*_STOPS, signal.SIGCHLD):
            signal.signal(number, lambda *_: None)
        self._poll = select.poll()
        self._poll.register(self._woken, select.POLLIN)
        self._poll.register(_CONTROL, select.POLLIN)

    def begin(self, command: list[str], environment: dict[bytes, bytes]) -> int:
        """Start the program; the number of the error if it cannot be started, else 0."""
        failure, reports = os.pipe()
        here = os.getpid()
        self.program = os.fork()
        if self.program == 0:
            _become(command, environment, reports=reports, parent=here)
        os.close(reports)
        number = os.read(failure, 16)
        os.close(failure)
        for stream in (1, 2):  # only the program writes there
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
        if number:
            os.waitpid(self.program, 0)
        return int(number or 0)

    def watch(self, grace_s: float) -> int:
        """Wait for the end of the program or the order to end it; how many processes are left."""
        while self.code is None and not self.stopping:
            self._wait(None)
            self._reap()
        if self.code is None:
            end = time.monotonic() + grace_s
            self._signal(signal.SIGTERM)
            while self._reap() and time.monotonic() < end:
                self._wait(min(_TICK_S, grace_s))
        if not _IS_LINUX:  # orphans do not come here, but their group is known
            _kill(-self.program, signal.SIGKILL)
        end = time.monotonic() + _KILL_S
        while self._reap():
            if time.monotonic() > end:
                return max(1, len(_descendants()))
            self._signal(signal.SIGKILL)
            self._wait(_TICK_S)
        return 0

    def _wait(self, seconds: float | None) -> None:
        """Wait until a child ends, or something else happens."""
        for ready, _ in self._poll.poll(None if seconds is None else seconds * 1000):
            if ready == _CONTROL:  # an order, or the end of who could give one
                self.stopping = True
                self._poll.unregister(_CONTROL)
            elif any(number in _STOPS for number in os.read(self._woken, 4096)):
                self.stopping = True

    def _reap(self) -> bool:
        """Take note of children that have ended; whether there are others."""
        while True:
            try:
                ended, status = os.waitpid(-1, os.WNOHANG)
            except ChildProcessError:
                return False
            if ended == 0:
                return True
            if ended == self.program:
                self.code = os.waitstatus_to_exitcode(status)

    def _signal(self, number: int) -> None:
        """Send a signal to every descendant.

        To their process groups as a whole: that no process can outrun by starting another one.
        The program leads a session of its own, so none of these groups is that of the supervisor.
        """
        groups = {self.program} if self.code is None else set()
        for descendant, group in _descendants().items():
            groups.add(group)
            _kill(descendant, number)
        for group in groups - {os.getpgrp(), 0}:
            _kill(-group, number)


def _kill(target: int, number: int) -> None:
    with suppress(ProcessLookupError, PermissionError):  # it has ended, or is somebody else's now
        os.kill(target, number)


def _descendants() -> dict[int, int]:
    """The processes below this one, each with its group. Empty where there is no /proc."""
    children: dict[int, list[tuple[int, int]]] = {}
    try:
        names = [entry.name for entry in os.scandir("/proc")]
    except OSError:
        return {}
    for name in names:
        if not name.isdigit():
            continue
        with suppress(OSError, ValueError):  # it has just ended
            with open(f"/proc/{name}/stat", "rb") as file:  # noqa: PTH123
                _, parent, its_group = file.read().rpartition(b")")[2].split()[:3]
            children.setdefault(int(parent), []).append((int(name), int(its_group)))
    parents: dict[int, int] = {}
    pending = [os.getpid()]
    while pending:
        for process, group in children.get(pending.pop(), ()):
            if process not in parents:
                parents[process] = group
                pending.append(process)
    return parents


def _become(
    command: list[str], environment: dict[bytes, bytes], *, reports: int, parent: int
) -> None:
    """Turn the child into the program. Never returns."""
    try:
        os.setsid()
        signal.set_wakeup_fd(-1)
        for number in (signal.SIGPIPE, signal.SIGXFSZ):  # Python ignores these
            signal.signal(number, signal.SIG_DFL)
        if _IS_LINUX:
            _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() == parent:
            os.dup2(os.open(os.devnull, os.O_RDONLY), _CONTROL)
            os.execvpe(command[0], command, environment)  # noqa: S606  (no shell is meant)
    except OSError as error:
        os.write(reports, str(error.errno).encode())
    finally:
        os._exit(127)


def _prctl(option: int, value: int) -> None:
    ctypes.CDLL(None).prctl(option, ctypes.c_ulong(value), 0, 0, 0)


def _report(text: str) -> None:
    with suppress(OSError):  # nobody listens any more
        os.write(_CONTROL, f"{text}\n".encode())


def main(arguments: list[str]) -> None:
    """Start the program as soon as that is asked for, and stay until nothing is left of it."""
    grace_s, names, *command = arguments
    if _IS_LINUX:
        _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    supervisor = _Supervisor()
    if not os.read(_CONTROL, 1):
        return
    wanted = [os.fsencode(name) for name in names.split("=") if name]
    environment = {name: os.environb[name] for name in wanted if name in os.environb}
    number = supervisor.begin(command, environment)
    if number:
        _report(f"error {number}")
        return
    _report(f"started {supervisor.program}")
    left = supervisor.watch(float(grace_s))
    _report(f"ended {-signal.SIGKILL if supervisor.code is None else supervisor.code} {left}")


if __name__ == "__main__":
    main(sys.argv[1:])
