"""Run a chain with python-statemachine. Needs that and transitions_run.py, nothing of gpsfsm.

``python benchmarks/other_engines/statemachine_run.py spec.json LIMIT_S TIMES`` prints JSON. The
machine is that of ``transitions_run.py``; its class is made as any class of that library is. One
that is not done in time is reported as incomplete: as far as it came, or not even built.
"""

from __future__ import annotations

import gc
import json
import signal
import statistics
import sys
import time
from importlib import metadata
from pathlib import Path
from typing import Any

from statemachine import State, StateMachine
from transitions_run import ways

ENDS = ("complete", "give_up")


class TooSlowError(Exception):
    """The time is up."""


def give_up(_signal: int, _frame: object) -> None:
    raise TooSlowError


def machine_of(spec: dict[str, Any]) -> tuple[Any, str]:
    """The machine, and the unit in which it begins."""
    names, paths = ways(spec)
    reached = {names[0]} | {target for _, _, target in paths}
    states = {
        name: State(name, initial=name == names[0], final=name in ENDS)
        for name in names
        if name in reached
    }
    body: dict[str, Any] = {f"s_{name}": state for name, state in states.items()}
    for event in ("succeeded", "failed"):
        body[event] = None
        for what, source, target in paths:
            if what == event:
                way = states[source].to(states[target])
                body[event] = way if body[event] is None else body[event] | way
    return type("Chain", (StateMachine,), body)(), names[0]


def measure(spec: dict[str, Any], limit_s: float) -> dict[str, Any]:
    """Build the machine and send events until it is in one of its last states."""
    gc.collect()
    began = built = time.perf_counter()
    events, name, complete = 0, "", True
    signal.setitimer(signal.ITIMER_REAL, limit_s)
    try:
        machine, name = machine_of(spec)
        built = time.perf_counter()
        while name not in ENDS:
            events += 1
            machine.send("succeeded" if spec["leaves"][name][1] else "failed")
            (state,) = machine.configuration
            name = state.name
    except TooSlowError:
        complete = False
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
    ended = time.perf_counter()
    return {
        "build_s": built - began,
        "run_s": ended - built,
        "visits": events,
        "built": events > 0,
        "complete": complete,
        "status": {"complete": "COMPLETED", "give_up": "GAVE_UP"}.get(name, ""),
        "version": metadata.version("python-statemachine"),
    }


def main() -> None:
    signal.signal(signal.SIGALRM, give_up)
    spec = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    limit_s, times = float(sys.argv[2]), int(sys.argv[3])
    measureds = [measure(spec, limit_s) for _ in range(times)]
    for name in ("build_s", "run_s"):
        measureds[0][name] = statistics.median(one[name] for one in measureds)
    print(json.dumps(measureds[0]))


if __name__ == "__main__":
    main()
