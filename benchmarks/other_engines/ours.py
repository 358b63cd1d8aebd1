"""Run a plan of a scale family with gpsfsm, once, and write down the same work for other engines.

``python -m benchmarks.other_engines.ours FAMILY RUNNERS`` prints JSON. Every third action that has
a recovery fails; actions take 0.5 to 1.5 seconds, which at ten ticks a second are 5 to 15 ticks.
With ``--journal MODE`` the run is journaled, with ``--together N`` as many runs share one clock,
with ``--alone`` there is no clock and nothing acts.
"""

from __future__ import annotations

import argparse
import gc
import json
import tempfile
import time
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.common import median, write_plan
from gpsfsm.compile import UnitKind, compile_plan, group_units
from gpsfsm.execution.journal import Heading, Journal
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.queues import run_together
from gpsfsm.execution.records import Input, Kind, Load, Start, Stop
from gpsfsm.execution.runner import Runner, RunnerError
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.syntax import parse

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.execution.host import Sink
    from gpsfsm.execution.records import Record, RunValue
    from gpsfsm.execution.runner import RunContext
    from gpsfsm.model.plan import Plan

ARGUMENTS = {
    "chain": lambda runners: (runners // 2,),
    "fan-out": lambda runners: (runners // 2 - 1, "--variant", "safe"),
    "nested": lambda runners: (len(str(runners)) - 1, 10),
}
KINDS = {
    UnitKind.RUNNER: "runner",
    UnitKind.SEQUENCE: "sequence",
    UnitKind.GUARD: "guard",
    UnitKind.ALL: "all",
    UnitKind.ANY: "any",
}
TICKS_PER_SECOND = 10


def ticks(number: int) -> int:
    """How long the action of an instance takes."""
    return 5 + number * 7 % 11


def plan_of(family: str, runners: int) -> Plan:
    """A plan of about that many runners."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "plan.xml"
        write_plan(file, family.replace("-", ""), *ARGUMENTS[family](runners))
        plan = parse(file.read_bytes(), file=family).plan
    if plan is None:
        raise SystemExit(f"the {family} of {runners} runners is no plan")
    return plan


def failing(plan: Plan) -> frozenset[int]:
    """The instances that fail: every third of the runners that have a recovery of their own."""
    units = group_units(plan)
    number = {element.index: number for number, element in enumerate(plan.runners)}
    guarded = [
        number[units.elements[children[0]]]
        for kind, children in zip(units.kinds, units.children, strict=True)
        if kind is UnitKind.GUARD and units.kinds[children[0]] is UnitKind.RUNNER
    ]
    return frozenset(guarded[::3])


def specification(plan: Plan, fails: frozenset[int]) -> dict[str, Any]:
    """The same work as a tree of units, for other engines."""
    units = group_units(plan)
    number = {element.index: number for number, element in enumerate(plan.runners)}
    leaves = {}
    for unit, kind in enumerate(units.kinds):
        if kind is UnitKind.RUNNER:
            instance = number[units.elements[unit]]
            leaves[unit] = (ticks(instance), instance not in fails)
    return {
        "kinds": [KINDS[kind] for kind in units.kinds],
        "children": units.children,
        "leaves": leaves,
    }


class Counting:
    """A sink that counts, and hands on to another one."""

    def __init__(self, other: Sink | None = None) -> None:
        self.other = other
        self.inputs = self.records = 0

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        if self.other is not None:
            self.other.write(at_us, happened, records)
        self.inputs += 1
        self.records += len(records)


def acting(fails: frozenset[int]) -> Runner:
    """A runner that takes its time and then succeeds or fails as was decided before."""

    class Acting(Runner):
        async def run(self, _: Mapping[str, RunValue], context: RunContext) -> None:
            await context.sleep(ticks(context.number) / TICKS_PER_SECOND)
            if context.number in fails:
                raise RunnerError("it fails")

    return Acting()


def measure(plan: Plan, fails: frozenset[int]) -> dict[str, Any]:
    """Compile and run a plan."""
    sink = Counting()
    gc.collect()
    began = time.perf_counter()
    compiled = compile_plan(plan)
    kernel = Kernel(compiled)
    driver = VirtualDriver(kernel, sink, lambda *_: acting(fails))
    built = time.perf_counter()
    driver.run()
    ended = time.perf_counter()
    return {
        "runners": len(plan.runners),
        "build_s": built - began,
        "run_s": ended - built,
        # an input looks at a node too
        "visits": kernel.visits + kernel.pruned + sink.inputs,
        "pruned": kernel.pruned,
        "events": sink.records,
        "mission_s": driver.now_us() / 1e6,
        "status": kernel.status.value,
    }


def alone(plan: Plan, fails: frozenset[int]) -> dict[str, Any]:
    """The kernel without driver and runners: every instance answers as soon as it is asked."""
    gc.collect()
    began = time.perf_counter()
    kernel = Kernel(compile_plan(plan))
    built = time.perf_counter()
    pending = deque([Input(Kind.BEGIN)])
    outcomes = events = 0
    while pending:
        records, commands = kernel.step(pending.popleft())
        events += len(records)
        for command in commands:
            if isinstance(command, Start):
                outcomes += 1
                kind = Kind.FAILED if command.number in fails else Kind.SUCCEEDED
                pending.append(Input(kind, command.number))
            elif isinstance(command, Load):
                pending.append(Input(Kind.LOADED, runner=command.runner))
            elif isinstance(command, Stop):
                pending.append(Input(Kind.STOPPED, command.number))
    ended = time.perf_counter()
    return {
        "build_s": built - began,
        "run_s": ended - built,
        "outcomes": outcomes,
        "events": events,
        "status": kernel.status.value,
    }


def journaled(plan: Plan, fails: frozenset[int], mode: str) -> dict[str, Any]:
    """Run a compiled plan with a journal in the temporary folder."""
    kernel = Kernel(compile_plan(plan))
    with tempfile.TemporaryDirectory() as folder:
        with Journal(f"{folder}/run.db", mode) as journal:
            writer = journal.begin(kernel, Heading(plan=b"benchmark"))
            sink = Counting(writer)
            gc.collect()
            began = time.perf_counter()
            VirtualDriver(kernel, sink, lambda *_: acting(fails)).run()
            ended = time.perf_counter()
        size = Path(folder, "run.db").stat().st_size
    return {
        "run_s": ended - began,
        "events": sink.records,
        "inputs": sink.inputs,
        "size_mb": size / 1e6,
        "status": kernel.status.value,
    }


def together(plan: Plan, fails: frozenset[int], count: int) -> dict[str, Any]:
    """Run as many plans at once on one clock."""
    gc.collect()
    began = time.perf_counter()
    sinks = [Counting() for _ in range(count)]
    drivers = [
        VirtualDriver(Kernel(compile_plan(plan)), sink, lambda *_: acting(fails)) for sink in sinks
    ]
    built = time.perf_counter()
    run_together(drivers)
    ended = time.perf_counter()
    statuses = {driver.kernel.status.value for driver in drivers}
    return {
        "build_s": built - began,
        "run_s": ended - built,
        "events": sum(sink.records for sink in sinks),
        "status": ", ".join(sorted(statuses)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("family", choices=sorted(ARGUMENTS))
    parser.add_argument("runners", type=int)
    parser.add_argument("--spec", type=Path, help="write down the work for other engines")
    parser.add_argument("--times", type=int, default=1, help="the median counts")
    parser.add_argument("--journal", help="a durability")
    parser.add_argument("--alone", action="store_true", help="the kernel alone")
    parser.add_argument("--together", type=int, help="so many plans at once")
    chosen = parser.parse_args()
    plan = plan_of(chosen.family, chosen.runners)
    fails = failing(plan)
    if chosen.spec is not None:
        chosen.spec.write_text(json.dumps(specification(plan, fails)), encoding="utf-8")
    rows = []
    for _ in range(chosen.times):
        if chosen.journal:
            rows.append(journaled(plan, fails, chosen.journal))
        elif chosen.alone:
            rows.append(alone(plan, fails))
        elif chosen.together:
            rows.append(together(plan, fails, chosen.together))
        else:
            rows.append(measure(plan, fails))
    for name in ("build_s", "run_s"):
        if name in rows[0]:
            rows[0][name] = median(one[name] for one in rows)
    print(json.dumps(rows[0]))


if __name__ == "__main__":
    main()
