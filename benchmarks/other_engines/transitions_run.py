"""Run a chain as a flat state machine. Needs transitions, and nothing of gpsfsm.

``python benchmarks/other_engines/transitions_run.py spec.json TIMES`` prints JSON. One state for
each runner, the events ``succeeded`` and ``failed``; no time passes. Plans with parallel controls
have no such machine of reasonable size.
"""

from __future__ import annotations

import gc
import json
import statistics
import sys
import time
from pathlib import Path
from typing import Any

import transitions


def ways(spec: dict[str, Any]) -> tuple[list[str], list[list[str]]]:
    """States and transitions of a plan of sequences and guards of runners."""
    states: list[str] = []
    paths: list[list[str]] = []

    def place(unit: int, success: str, failure: str) -> str:
        """Compile a unit from behind; the state that begins it."""
        kind, children = spec["kinds"][unit], spec["children"][unit]
        if kind == "runner":
            states.append(str(unit))
            paths.append(["succeeded", str(unit), success])
            paths.append(["failed", str(unit), failure])
            return str(unit)
        first = success if kind == "sequence" else failure
        for child in reversed(children):
            if kind == "sequence":
                first = place(child, first, failure)
            elif kind == "guard":
                first = place(child, success, first)
            else:
                raise SystemExit("parallel controls have no flat machine")
        return first

    begin = place(0, "complete", "give_up")
    return [begin, *(state for state in states if state != begin), "complete", "give_up"], paths


def measure(spec: dict[str, Any]) -> dict[str, Any]:
    """Build the machine and fire events until it is in one of its last states."""
    gc.collect()
    began = time.perf_counter()
    states, paths = ways(spec)
    machine = transitions.Machine(
        states=states, transitions=paths, initial=states[0], auto_transitions=False
    )
    built = time.perf_counter()
    events = 0
    while machine.state not in ("complete", "give_up"):
        events += 1
        succeeds = spec["leaves"][machine.state][1]
        machine.trigger("succeeded" if succeeds else "failed")
    ended = time.perf_counter()
    return {
        "build_s": built - began,
        "run_s": ended - built,
        "visits": events,
        "complete": True,
        "status": {"complete": "COMPLETED", "give_up": "GAVE_UP"}[machine.state],
        "version": transitions.__version__,
    }


def main() -> None:
    spec = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    measureds = [measure(spec) for _ in range(int(sys.argv[2]))]
    for name in ("build_s", "run_s"):
        measureds[0][name] = statistics.median(one[name] for one in measureds)
    print(json.dumps(measureds[0]))


if __name__ == "__main__":
    main()
