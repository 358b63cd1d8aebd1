"""The engine in virtual time, against a behaviour tree that ticks and flat state machines.

The other engines need an interpreter that has them: this one, or the one that
``GPSFSM_ENGINES_PYTHON`` names. Without it their columns are left out.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.common import ROOT, circumstances, run, table

if TYPE_CHECKING:
    from collections.abc import Sequence

SIZES = (10, 1_000, 100_000)
FAMILIES = ("chain", "fan-out", "nested")
FACTORS = {0: "no time", 1: "10", 10: "100"}
LIMIT_S = 30.0
FOLDER = ROOT / "benchmarks" / "other_engines"
OURS = (sys.executable, "-m", "benchmarks.other_engines.ours")


def answer_of(command: Sequence[str | Path], *, timeout_s: float = 600.0) -> dict[str, Any]:
    """What a measurement prints, as JSON."""
    done = run(command, cwd=ROOT, timeout_s=timeout_s)
    if done.code != 0:
        raise SystemExit(f"{' '.join(map(str, command))}:\n{done.err}")
    document: dict[str, Any] = json.loads(done.out)
    if document["status"] != "COMPLETED":
        raise SystemExit(f"{' '.join(map(str, command))}: the plan ended {document['status']}")
    return document


def times(size: int) -> str:
    """How often a measurement is repeated."""
    return "51" if size <= 100 else "5" if size <= 10_000 else "1"


def engines() -> str:
    """An interpreter that has the other engines; "" if there is none."""
    python = os.environ.get("GPSFSM_ENGINES_PYTHON", sys.executable)
    done = run((python, "-c", "import py_trees, statemachine, transitions"))
    return python if done.code == 0 else ""


def duration(value: float) -> str:
    """Milliseconds below a second, else seconds."""
    return f"{value * 1000:,.2f} ms" if value < 0.1 else f"{value:.2f} s"


def ratio(theirs: float, ours: float, complete: bool) -> str:
    """How many times as much."""
    return f"{'' if complete else '> '}{theirs / ours:,.1f}"


def py_trees(python: str, spec: Path, size: int, factor: int) -> dict[str, Any]:
    """Tick the equivalent tree; one that is not done in time is reported as far as it came."""
    script = FOLDER / "py_trees_run.py"
    command = (python, script, spec, str(LIMIT_S), times(size), str(factor))
    done = run(command, cwd=ROOT, timeout_s=10 * LIMIT_S)
    if done.code != 0:
        raise SystemExit(f"py_trees: {done.err}")
    document: dict[str, Any] = json.loads(done.out)
    if document["complete"] and document["status"] != "COMPLETED":
        raise SystemExit(f"py_trees ended {document['status']}: this is not the same plan")
    return document


def against_trees(
    python: str, sizes: Sequence[int]
) -> tuple[list[list[str]], list[list[str]], str]:
    """The lines for gpsfsm alone and for both, and the version of py_trees."""
    own, both, version = [], [], ""
    for family in FAMILIES:
        for size in sizes:
            with tempfile.TemporaryDirectory() as folder:
                spec = Path(folder) / "spec.json"
                ours = answer_of((*OURS, family, str(size), "--times", times(size), "--spec", spec))
                name = [family, f"{ours['runners']:,}"]
                own.append(
                    [
                        *name,
                        f"{ours['events']:,}",
                        f"{ours['visits']:,}",
                        f"{ours['pruned']:,}",
                        duration(ours["build_s"]),
                        duration(ours["run_s"]),
                        f"{ours['events'] / ours['run_s']:,.0f}",
                        f"{ours['mission_s']:,.0f}",
                    ]
                )
                for factor, shown in FACTORS.items() if python else ():
                    theirs = py_trees(python, spec, size, factor)
                    version = theirs["version"]
                    complete = theirs["complete"]
                    both.append(
                        [
                            *name,
                            shown,
                            ("" if complete else "> ") + f"{theirs['visits']:,}",
                            ratio(theirs["visits"], ours["visits"], complete),
                            duration(theirs["build_s"]),
                            duration(theirs["run_s"]) if complete else f"over {LIMIT_S:.0f} s",
                            ratio(theirs["run_s"], ours["run_s"], complete),
                        ]
                    )
    return own, both, version


def against_machines(python: str, sizes: Sequence[int]) -> tuple[list[list[str]], str, str]:
    """Chains in the kernel alone and in flat state machines of two libraries."""
    rows, version, other = [], "", ""
    for size in sizes:
        with tempfile.TemporaryDirectory() as folder:
            spec = Path(folder) / "spec.json"
            command = (*OURS, "chain", str(size), "--alone", "--times", times(size), "--spec", spec)
            ours = answer_of(command)
            theirs = answer_of((python, FOLDER / "transitions_run.py", spec, times(size)))
            third = statemachine(python, spec, size)
        version, other = theirs["version"], third["version"]
        rows.append(
            [
                f"{size:,}",
                f"{ours['outcomes']:,}",
                duration(ours["build_s"]),
                duration(ours["run_s"]),
                duration(theirs["build_s"]),
                duration(theirs["run_s"]),
                ratio(theirs["run_s"], ours["run_s"], True),
                *shown(third, ours),
            ]
        )
    return rows, version, other


def statemachine(python: str, spec: Path, size: int) -> dict[str, Any]:
    """Run the chain in python-statemachine; one that is not done in time is cut off."""
    script = FOLDER / "statemachine_run.py"
    command = (python, script, spec, str(LIMIT_S), "5" if size < 10_000 else "1")
    done = run(command, cwd=ROOT, timeout_s=10 * LIMIT_S)
    if done.code != 0:
        raise SystemExit(f"python-statemachine: {done.err}")
    document: dict[str, Any] = json.loads(done.out)
    if document["complete"] and document["status"] != "COMPLETED":
        raise SystemExit(
            f"python-statemachine ended {document['status']}: this is not the same plan"
        )
    return document


def shown(measurement: dict[str, Any], ours: dict[str, Any]) -> list[str]:
    """Three cells: to build, to run, and how many times as long as ours."""
    late = f"over {LIMIT_S:.0f} s"
    if measurement["complete"]:
        times_as_long = ratio(measurement["run_s"], ours["run_s"], True)
        return [duration(measurement["build_s"]), duration(measurement["run_s"]), times_as_long]
    return [duration(measurement["build_s"]), late, ""] if measurement["built"] else [late, "", ""]


def journal_rows() -> list[list[str]]:
    """What the journal costs."""
    command = (*OURS, "chain", "1000", "--times", "5")
    off = answer_of(command)
    rows = [["off", duration(off["run_s"]), f"{off['events'] / off['run_s']:,.0f}", "", "", ""]]
    for mode in ("none", "process", "power"):
        answer = answer_of((*command, "--journal", mode))
        rows.append(
            [
                f"`{mode}`",
                duration(answer["run_s"]),
                f"{answer['events'] / answer['run_s']:,.0f}",
                f"{answer['inputs'] / answer['run_s']:,.0f}",
                f"{1e6 * (answer['run_s'] - off['run_s']) / answer['inputs']:.0f}",
                f"{answer['size_mb']:.2f}",
            ]
        )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--largest", type=int, default=SIZES[-1])
    chosen = parser.parse_args()
    sizes = tuple(size for size in SIZES if size <= chosen.largest)
    where, python = circumstances(), engines()
    own, both, trees = against_trees(python, sizes)
    machines, flat, other = against_machines(python, sizes) if python else ([], "", "")
    journal = journal_rows()
    many = answer_of((*OURS, "chain", "10", "--together", "1000", "--times", "3"))
    print(where)
    print("\n**gpsfsm in virtual time**\n")
    head = ["plan", "runners", "events", "node visits", "of these, pruning", "compile", "run"]
    print(table([*head, "events/s", "mission, s"], own))
    if python:
        print(f"\n**py_trees {trees}**\n")
        head = ["plan", "runners", "ticks of an action", "node visits", "ratio", "build", "run"]
        print(table([*head, "ratio"], both))
        print(
            f"\n**The kernel alone, transitions {flat} and python-statemachine {other}: chains, no "
            "clock, nothing acts**\n"
        )
        head = ["runners", "outcomes", "compile", "run", "transitions: build", "run", "ratio"]
        head += ["python-statemachine: build", "run", "ratio"]
        print(table(head, machines))
    print("\n**The journal, for the chain of 1,000 runners**\n")
    head = ["durability", "run", "events/s", "transactions/s", "µs for each", "file, MB"]
    print(table(head, journal))
    print(
        "\n**1,000 plans at once**: chains of 10 runners, interleaved on one clock in one process: "
        f"{duration(many['build_s'])} to compile, {duration(many['run_s'])} to run, "
        f"{many['events'] / many['run_s']:,.0f} events/s."
    )


if __name__ == "__main__":
    main()
