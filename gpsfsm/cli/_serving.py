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

from gpsfsm.cli._drive import FAIL
from gpsfsm.cli._served import Served, Stopping
from gpsfsm.cli._served_pace import PacedDriver, note
from gpsfsm.cli._served_start import Start
from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.execution.journal_errors import JournalBusyError
from gpsfsm.execution.queue import PlanState, QueueFullError
from gpsfsm.workers.line import Line
from gpsfsm.workers.memory import limit_memory

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.execution.journal import Journal

__all__ = ["main"]

_BUSY_S = 15.0
_STOP_S = 5.0
_MOST_LISTED = 200


def main() -> int:
    """Run plans until the service ends."""
    line = Line(_stop_soon)
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

    def say(found: dict[str, Any]) -> None:
        line.say({"id": head["id"], **found})

    try:
        if head["op"] == "control":
            _control(served, head, say)
        else:
            say(_OPS[head["op"]](served, head, body))
    except QueueFullError as error:
        say({"problem": 507, "detail": f"{error}; start with a new journal"})
    except UsageError as error:
        say({"problem": 404, "detail": str(error)})


def _submit(served: Served, head: dict[str, Any], body: bytes) -> dict[str, Any]:
    known = served.keys.get(head["key"])
    if known is None:
        if why := served.full():
            return {"problem": 429, "detail": why, "retry_s": 5}
        start = Start.of(head.get("start") or {}, "")
        if start is not None and start.world and start.world not in served.worlds.known:
            return {"problem": 422, "detail": f"start: there is no world '{start.world:.60}'"}
        known = served.submit(body, head["name"], head["key"], start)
    return _told(served, served.queue.state(known))


def _cancel(served: Served, head: dict[str, Any], _: bytes) -> dict[str, Any]:
    done = served.cancel(head["plan"], head["reason"])
    return {**_told(served, served.queue.state(head["plan"])), "done": done}


def _state(served: Served, head: dict[str, Any], _: bytes) -> dict[str, Any]:
    return _told(served, served.queue.state(head["plan"]))


def _list(served: Served, head: dict[str, Any], _: bytes) -> dict[str, Any]:
    most, first = min(head["most"], _MOST_LISTED), max(1, head["after"] + 1)
    last = min(served.queue.submitted_ever, first + most - 1)
    found = [_told(served, served.queue.state(plan)) for plan in range(first, last + 1)]
    return {"plans": found, "total": served.queue.submitted_ever}


def _control(served: Served, head: dict[str, Any], say: Callable[[dict[str, Any]], None]) -> None:
    """Do something to the run of a plan. It is in the journal when that is said."""

    def tell(why: str) -> None:
        told = _told(served, served.queue.state(head["plan"]))
        say({**told, "done": not why, "why": why})

    if served.driver is None or served.driver[0] != head["plan"]:
        tell("the plan is not running")
    elif why := _wished(served.driver[1], head, tell):
        tell(why)


def _wished(driver: PacedDriver, head: dict[str, Any], done: Callable[[str], None]) -> str:
    what, number, message = head["what"], -1, ""
    if what == FAIL:
        number = _instance(driver, head)
        if number < 0:
            return "the plan has no such runner"
        message = head.get("message") or "a client has let it fail"
    speed, events = head.get("speed") or 0.0, head.get("events", 1)
    return driver.wish(note(what, number=number, speed=speed, events=events, message=message), done)


def _instance(driver: PacedDriver, head: dict[str, Any]) -> int:
    """The number of the runner that a node or an element stands for; -1 for none."""
    automaton = driver.kernel.automaton
    for node in automaton.runners:
        if node.index == head.get("node") or automaton.name(node.index) == head.get("element"):
            return automaton.runner_number(node.index)
    return -1


def _plans_of(served: Served, head: dict[str, Any], _: bytes) -> dict[str, Any]:
    """The plans of runs, and what has become of them."""
    plans = {run: plan for plan, run in served.numbers.items()}
    follows = {state.continues: state.plan for state in served.queue.states() if state.continues}
    found = {}
    for run in head["runs"]:
        if run in plans:
            state = served.queue.state(plans[run])
            after = follows.get(state.plan, 0)
            links = {"continued_by": after, "continued_by_run": served.numbers.get(after)}
            links["continues_run"] = served.numbers.get(state.continues)
            found[str(run)] = {**_told(served, state), **links}
    return {"plans": found}


def _worlds(served: Served, _head: dict[str, Any], _: bytes) -> dict[str, Any]:
    known = [each.told() for each in served.worlds.known.values()]
    return {"worlds": [{**each, "default": not place} for place, each in enumerate(known)]}


def _world(served: Served, head: dict[str, Any], _: bytes) -> dict[str, Any]:
    """What a map shows of a world."""
    found = served.worlds.known.get(head["world"])
    if found is None or not found.content:
        return {"problem": 404, "detail": "there is no such world"}
    from gpsfsm.simulation.load import read_world  # noqa: PLC0415  (YAML and pydantic)
    from gpsfsm.simulation.outline import outline  # noqa: PLC0415

    return {"outline": {"world": found.name, **outline(read_world(found.content))}}


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
        **_pace(served, state),
    }


def _pace(served: Served, state: PlanState) -> dict[str, Any]:
    """In which world a plan runs, and how fast."""
    found = {
        "world": served.starts.of(state.plan).world or served.worlds.own.name,
        "speed": served.speed(state.plan),
        "paused": served.starts.of(state.plan).paused and not state.status.ended,
        "clock_us": max(0, state.ended_us - state.began_us) if state.began_us >= 0 else 0,
    }
    if served.driver is not None and served.driver[0] == state.plan:
        driver = served.driver[1]
        found |= {"speed": driver.pace.speed, "paused": driver.pace.paused}
        found["clock_us"] = driver.clock_us()
    return found


_OPS = {
    "submit": _submit,
    "cancel": _cancel,
    "state": _state,
    "list": _list,
    "plans_of": _plans_of,
    "worlds": _worlds,
    "world": _world,
}


if __name__ == "__main__":
    sys.exit(main())
