"""Tick the behaviour tree that is equivalent to a plan. Needs py_trees, and nothing of gpsfsm.

``python benchmarks/other_engines/py_trees_run.py spec.json LIMIT_S TIMES FACTOR`` prints JSON.
The specification comes from ``benchmarks.other_engines.ours``: units, and for each leaf the number
of ticks that it takes, to be multiplied by FACTOR (0: each leaf ends in its first tick), and
whether it succeeds. Of several times the median counts.
"""

from __future__ import annotations

import gc
import json
import statistics
import sys
import time
from importlib import metadata
from pathlib import Path
from typing import Any

import py_trees
from py_trees.common import ParallelPolicy, Status


class Leaf(py_trees.behaviour.Behaviour):
    """An action that takes some ticks."""

    def __init__(self, name: str, ticks: int, succeeds: bool) -> None:
        super().__init__(name)
        self.ticks = ticks
        self.result = Status.SUCCESS if succeeds else Status.FAILURE
        self.left = ticks

    def initialise(self) -> None:
        self.left = self.ticks

    def update(self) -> Status:
        self.left -= 1
        return Status.RUNNING if self.left > 0 else self.result


def composite(kind: str, name: str, children: list[Any]) -> Any:
    """What a unit is in py_trees, with memory, as a plan has it."""
    if kind == "sequence":
        return py_trees.composites.Sequence(name, memory=True, children=children)
    if kind == "guard":
        return py_trees.composites.Selector(name, memory=True, children=children)
    policy = ParallelPolicy.SuccessOnAll() if kind == "all" else ParallelPolicy.SuccessOnOne()
    return py_trees.composites.Parallel(name, policy=policy, children=children)


def build(spec: dict[str, Any], factor: int) -> Any:
    """The tree. Parents come before their children in the specification."""
    made: dict[int, Any] = {}
    for index in range(len(spec["kinds"]) - 1, -1, -1):
        kind = spec["kinds"][index]
        if kind == "runner":
            ticks, succeeds = spec["leaves"][str(index)]
            made[index] = Leaf(str(index), max(1, ticks * factor), succeeds)
        else:
            children = [made.pop(child) for child in spec["children"][index]]
            made[index] = composite(kind, str(index), children)
    return made[0]


def measure(spec: dict[str, Any], limit_s: float, factor: int) -> dict[str, Any]:
    """Build the tree and tick it until it has ended, or the time is up."""
    gc.collect()
    began = time.perf_counter()
    root = build(spec, factor)
    built = time.perf_counter()
    visits = ticks = 0
    complete = True
    while True:
        ticks += 1
        for _ in root.tick():
            visits += 1
        if root.status != Status.RUNNING:
            break
        if time.perf_counter() - built > limit_s:
            complete = False
            break
    ended = time.perf_counter()
    return {
        "build_s": built - began,
        "run_s": ended - built,
        "visits": visits,
        "ticks": ticks,
        "complete": complete,
        "status": {"SUCCESS": "COMPLETED", "FAILURE": "GAVE_UP"}.get(root.status.name, ""),
        "version": metadata.version("py_trees"),
    }


def main() -> None:
    spec = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    limit_s, times, factor = float(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    measureds = [measure(spec, limit_s, factor) for _ in range(times)]
    for name in ("build_s", "run_s"):
        measureds[0][name] = statistics.median(one[name] for one in measureds)
    print(json.dumps(measureds[0]))


if __name__ == "__main__":
    main()
