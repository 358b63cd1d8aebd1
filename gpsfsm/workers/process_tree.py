"""The processes below another one, which end with it whatever they have done to get away.

A process group is left with ``setsid``, and the process that started another one may end before it.
On Linux a child adopts the orphans below it (``adopt_orphans``), so that all that it has started
is found by its parents in /proc. Elsewhere nothing is found here; the process group is all there
is.
"""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress

_PR_SET_CHILD_SUBREAPER = 36
_MOST_LOOKS = 100


def adopt_orphans() -> None:
    """Let what this process has started stay below it when whoever started it ends."""
    if sys.platform != "linux":
        return
    with suppress(ImportError, OSError, AttributeError):  # an interpreter without ctypes
        import ctypes

        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, ctypes.c_ulong(1), 0, 0, 0)


def kill_below(process: int, *, itself: bool) -> None:
    """Kill what a process has started, and ``itself`` as well; it must not have been waited for.

    All are stopped before any is killed: so none of them starts another one meanwhile, and no
    number belongs to somebody else before it is used. A process that is just starting another one
    when it is stopped still does so, so that this looks until there is nobody new.
    """
    stopped: set[int] = set()
    if itself:
        _send(process, signal.SIGSTOP)
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
    try:
        names = os.listdir("/proc")  # noqa: PTH208  (pathlib is slower)
    except OSError:
        return set()
    for name in names:
        if not name.isdigit():
            continue
        with suppress(OSError, ValueError):  # it has just ended
            with open(f"/proc/{name}/stat", "rb") as file:  # noqa: PTH123
                parent = int(file.read().rpartition(b")")[2].split(None, 2)[1])
            children.setdefault(parent, []).append(int(name))
    found: set[int] = set()
    pending = [process]
    while pending:
        new = [each for each in children.get(pending.pop(), ()) if each not in found]
        found.update(new)
        pending += new
    return found
