"""The process that runs the plans of the service: ``python -m gpsfsm.cli._serving``.

It holds the journal and the queue. What the service asks for is done between two events of a run,
so a plan is submitted or cancelled while another one runs.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from gpsfsm.cli._served import Served, Stopping
from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.execution.journal_errors import JournalBusyError
from gpsfsm.execution.queue import PlanState, QueueFullError
from gpsfsm.service.child import Line
from gpsfsm.workers.memory import limit_memory

if TYPE_CHECKING:
    from gpsfsm.execution.journal import Journal

__all__ = ["main"]

_BUSY_S = 15.0
_STOP_S = 5.0
_MOST_LISTED = 200


def main() -> int:
    """Run plans until the service ends."""
    line = Line(lambda: _stop_soon(line))
    head, _ = line.messages.get()
    if head.get("op") == "stop":
        return 0
    limit_memory(head["memory_mb"])
    try:
        with ExitStack() as stack:
            served = Served(head, _journal(head, stack), stack)
            served.tell = line.say
            served.poll = lambda: _poll(line, served)
            served.restore()
            line.say({"ready": True})
            _serve(line, served)
    except Stopping:
        return 0
    except GpsfsmError as error:
        line.say({"failed": str(error)})
        return 2
    return 0


def _journal(head: dict[str, Any], stack: ExitStack) -> Journal:
    """The journal; one that an earlier service has just left may be busy for a moment."""
    from gpsfsm.execution.journal import Journal  # noqa: PLC0415

    until_s = time.monotonic() + _BUSY_S
    while True:
        try:
            return stack.enter_context(Journal(head["journal"], head.get("durability", "power")))
        except JournalBusyError:
            if time.monotonic() > until_s:
                raise
        time.sleep(0.1)


def _stop_soon(line: Line) -> None:
    """The service has gone: stop between two events, or at once if none comes for a while."""
    line.messages.put(({"op": "stop"}, b""))
    timer = threading.Timer(_STOP_S, os._exit, (0,))
    timer.daemon = True
    timer.start()


def _serve(line: Line, served: Served) -> None:
    while True:
        served.queue.run_all()
        _answer(line, served, *line.messages.get())


def _poll(line: Line, served: Served) -> None:
    """Do what the service has asked for meanwhile."""
    while not line.messages.empty():
        _answer(line, served, *line.messages.get())


def _answer(line: Line, served: Served, head: dict[str, Any], body: bytes) -> None:
    if head["op"] == "stop":
        raise Stopping
    try:
        found = _OPS[head["op"]](served, head, body)
    except QueueFullError as error:
        found = {"problem": 507, "detail": f"{error}; start with a new journal"}
    except UsageError as error:
        found = {"problem": 404, "detail": str(error)}
    line.say({"id": head["id"], **found})


def _submit(served: Served, head: dict[str, Any], body: bytes) -> dict[str, Any]:
    known = served.keys.get(head["key"])
    if known is None:
        if why := served.full():
            return {"problem": 429, "detail": why, "retry_s": 5}
        known = served.submit(body, head["name"], head["key"])
    return _told(served, served.queue.state(known))


def _cancel(served: Served, head: dict[str, Any], _: bytes) -> dict[str, Any]:
    done = served.queue.cancel(head["plan"], head["reason"])
    return {**_told(served, served.queue.state(head["plan"])), "done": done}


def _state(served: Served, head: dict[str, Any], _: bytes) -> dict[str, Any]:
    return _told(served, served.queue.state(head["plan"]))


def _list(served: Served, head: dict[str, Any], _: bytes) -> dict[str, Any]:
    most, first = min(head["most"], _MOST_LISTED), max(1, head["after"] + 1)
    last = min(served.queue.submitted_ever, first + most - 1)
    found = [_told(served, served.queue.state(plan)) for plan in range(first, last + 1)]
    return {"plans": found, "total": served.queue.submitted_ever}


def _told(served: Served, state: PlanState) -> dict[str, Any]:
    return {
        "plan": state.plan,
        "status": state.status.value,
        "name": state.name,
        "sha256": state.sha256,
        "by": state.by,
        "continues": state.continues,
        "findings": list(state.findings),
        "reason": state.reason,
        "attempts": state.attempts,
        "run": served.numbers.get(state.plan),
    }


_OPS = {"submit": _submit, "cancel": _cancel, "state": _state, "list": _list}


if __name__ == "__main__":
    sys.exit(main())
