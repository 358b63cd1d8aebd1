"""What the benchmarks share: processes under limits, plans of the scale families, tables."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

ROOT = Path(__file__).resolve().parents[1]
GPSFSM = (sys.executable, "-c", "from gpsfsm.cli import main; main()")
"""The command ``gpsfsm`` without a look at where it is installed."""


@dataclass(frozen=True, slots=True)
class Measured:
    """A finished process. ``peak_mb`` is the most memory that it held at once."""

    code: int
    out: str
    err: str
    seconds: float
    peak_mb: float
    timed_out: bool


def environment() -> dict[str, str]:
    """Let child processes import gpsfsm from this checkout, and without colours."""
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    return {**os.environ, "PYTHONPATH": path, "NO_COLOR": "1"}


def run(
    command: Sequence[str | Path],
    *,
    timeout_s: float = 600.0,
    memory_mb: int | None = None,
    cwd: Path | None = None,
) -> Measured:
    """Run a command and measure it; after ``timeout_s`` it and its children are killed.

    Linux counts the memory of the process that starts a command as the command's own until it
    begins, so the callers must stay small (plans are made by a process of their own).
    """

    def limit() -> None:
        if memory_mb is not None:
            size = memory_mb * 1024 * 1024
            resource.setrlimit(resource.RLIMIT_AS, (size, size))

    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        started = time.perf_counter()
        process = subprocess.Popen(
            [str(word) for word in command],
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=err,
            cwd=cwd,
            env=environment(),
            start_new_session=True,
            preexec_fn=limit,  # noqa: PLW1509  (no threads are running yet)
        )
        killed = threading.Event()

        def kill() -> None:
            killed.set()
            os.killpg(process.pid, signal.SIGKILL)

        timer = threading.Timer(timeout_s, kill)
        timer.start()
        _, status, usage = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - started
        timer.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        err.seek(0)
        return Measured(
            code=process.returncode,
            out=out.read().decode(errors="replace"),
            err=err.read().decode(errors="replace"),
            seconds=seconds,
            peak_mb=usage.ru_maxrss / 1024,
            timed_out=killed.is_set(),
        )


def write_plan(file: Path, family: str, *arguments: int | str) -> None:
    """Write a plan of a scale family to ``file``, made by a process of its own."""
    script = ROOT / "corpus" / "generate.py"
    command = [sys.executable, str(script), family, *map(str, arguments)]
    with file.open("wb") as target:
        subprocess.run(command, stdout=target, check=True)


def percentile(values: Iterable[float], share: float) -> float:
    """The smallest value that is at least as large as ``share`` of all values."""
    ordered = sorted(values)
    return ordered[max(0, -(-len(ordered) * round(share * 1000) // 1000) - 1)]


def median(values: Iterable[float]) -> float:
    """The middle value; of an even number of values the mean of the two in the middle."""
    ordered = sorted(values)
    middle = len(ordered) // 2
    if len(ordered) % 2:
        return ordered[middle]
    return (ordered[middle - 1] + ordered[middle]) / 2


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; columns after the first are aligned to the right."""
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def seconds(value: float) -> str:
    """A duration with as many digits as it deserves."""
    return f"{value:.0f}" if value >= 100 else f"{value:.1f}" if value >= 10 else f"{value:.2f}"


def circumstances() -> str:
    """The machine in neutral words, and whether something else kept it busy."""
    system = "an unknown system"
    release = Path("/etc/os-release")
    if release.exists():
        for line in release.read_text(encoding="utf-8").splitlines():
            if line.startswith("PRETTY_NAME="):
                system = line.partition("=")[2].strip('"')
    cores = os.cpu_count() or 1
    version = ".".join(map(str, sys.version_info[:3]))
    load = os.getloadavg()[0]
    state = f"load {load:.1f} at the start"
    if load > 0.3 * cores:
        state += ": the machine was busy with other work, so the times are too high"
    return f"Measured with {cores} cores, {system}, Python {version}; {state}."
