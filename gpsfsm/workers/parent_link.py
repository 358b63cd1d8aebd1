"""The link of a child process to its parent, whose side is ``child_process``.

Messages come on standard input, answers go to standard output (``frames``). Whatever else is
printed goes to standard error. When the parent ends, however it does, the pipe ends, and so does
the child, with all that it has started.

A process group is left with ``setsid``, and who started a process may end before it. On Linux a
child adopts the orphans below it, so that all that it has started is found in /proc. Elsewhere
nothing is found there; the process group is all there is.
"""

from __future__ import annotations

import importlib
import os
import queue
import signal
import sys
import threading
from contextlib import suppress
from typing import TYPE_CHECKING, Any, BinaryIO, TypeAlias

from gpsfsm.errors import GpsfsmError
from gpsfsm.workers.frames import Message, pack, read

if TYPE_CHECKING:
    from collections.abc import Callable

Answer: TypeAlias = "Callable[[dict[str, Any], bytes], Message]"

WARM_PLAN = b"""<Plan><Control type="parallel_all"><Runner interface="a/A" provider="a/A"/>
<Runner interface="a/B" provider="a/B"/></Control></Plan>"""
"""A plan whose check loads all that checks need, so that the first request does not wait for it."""


_PR_SET_CHILD_SUBREAPER = 36
_MOST_LOOKS = 100


def main(target: str) -> None:
    """Run a function of a module (``child_process.child_command``)."""
    _adopt_orphans()
    module, _, function = target.partition(":")
    getattr(importlib.import_module(module), function)()


def serve(
    prepare: Callable[[dict[str, Any], bytes], Answer],
    *,
    load: Callable[[], object] = lambda: None,
) -> None:
    """The life of a child that gives one answer to each message.

    The first message says what all others have in common: ``prepare`` makes of it what answers, or
    raises GpsfsmError. ``load`` is called before there is any: it loads what is going to be needed
    while the parent gets ready to ask.
    """
    link = ParentLink()
    load()
    try:
        answer = prepare(*link.messages.get())
    except GpsfsmError as error:
        link.send({"failed": str(error)})
        return
    link.send({"ready": True})
    while True:
        link.send(*answer(*link.messages.get()))


class ParentLink:
    """The link. A thread reads, so that the end of the parent is noticed at any time.

    ``ended`` is called with it then, in that thread, maybe before it is assigned to anything;
    without it this process ends, whatever it does.
    """

    def __init__(self, ended: Callable[[ParentLink], None] | None = None) -> None:
        self._in: BinaryIO = os.fdopen(os.dup(0), "rb")
        self._out: BinaryIO = os.fdopen(os.dup(1), "wb")
        nothing = os.open(os.devnull, os.O_RDONLY)
        os.dup2(nothing, 0)
        os.dup2(2, 1)
        os.close(nothing)
        sys.stdin, sys.stdout = os.fdopen(0, closefd=False), sys.stderr
        self._ended = ended or _end
        self._over = False
        self._writing = threading.Lock()
        self.messages: queue.SimpleQueue[Message] = queue.SimpleQueue()
        threading.Thread(target=self._listen, daemon=True).start()

    def send(self, head: dict[str, Any], body: bytes = b"") -> None:
        """Send a message; may be called from any thread."""
        packed = pack(head, body)
        try:
            with self._writing:
                self._out.write(packed)
                self._out.flush()
        except OSError:
            self._gone()

    def _gone(self) -> None:
        if not self._over:
            self._over = True
            self._ended(self)

    def _listen(self) -> None:
        try:
            while True:
                self.messages.put(read(self._in))
        except (EOFError, OSError, ValueError):
            self._gone()


def _end(_: ParentLink) -> None:
    kill_below(os.getpid(), itself=False)
    sys.stderr.flush()
    os._exit(0)


# -- processes below a child ----------------------------------------------------------------


def _adopt_orphans() -> None:
    """Let what this process has started stay below it when whoever started it ends."""
    if sys.platform != "linux":
        return
    with suppress(ImportError, OSError, AttributeError):  # an interpreter without ctypes
        import ctypes

        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, ctypes.c_ulong(1), 0, 0, 0)


def kill_below(process: int, *, itself: bool) -> None:
    """Kill what a process has started, and ``itself`` as well; it must not have been waited for.

    All below it are stopped before any is killed: so none of them starts another one meanwhile, and
    no number belongs to somebody else before it is used. A process that is just starting another
    one when it is stopped still does so, so that this looks until there is nobody new. The process
    itself is not stopped: if whoever calls this is killed meanwhile, it still notices that, and
    kills what is stopped below it.
    """
    stopped: set[int] = set()
    for _ in range(_MOST_LOOKS):
        new = _below(process) - stopped
        if not new:
            break
        for each in new:
            _send(each, signal.SIGSTOP)
        stopped |= new
    for each in (*stopped, process) if itself else stopped:
        _send(each, signal.SIGKILL)


def _send(process: int, number: int) -> None:
    with suppress(ProcessLookupError, PermissionError):  # it has ended, or is somebody else's
        os.kill(process, number)


def _below(process: int) -> set[int]:
    """All processes below one; none where there is no /proc."""
    children: dict[int, list[int]] = {}
    with suppress(OSError):
        for entry in os.scandir("/proc"):
            if entry.name.isdigit():
                children.setdefault(_parent_of(entry.name), []).append(int(entry.name))
    below: set[int] = set()
    pending = [process]
    while pending:
        new = [each for each in children.get(pending.pop(), ()) if each not in below]
        below.update(new)
        pending += new
    return below


def _parent_of(process: str) -> int:
    """The number of the parent; 0 where the process has just ended."""
    with suppress(OSError, ValueError, IndexError):
        descriptor = os.open(f"/proc/{process}/stat", os.O_RDONLY)
        try:
            return int(os.read(descriptor, 4096).rpartition(b")")[2].split(None, 2)[1])
        finally:
            os.close(descriptor)
    return 0
