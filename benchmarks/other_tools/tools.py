"""The tools: how a model is put to them, and what of their output counts as an answer.

An abort is never an answer. SPIN's verifier, for instance, says ``errors: 1`` when its state
vector is too small, and ``errors: 0`` when its memory or its stack ran out before the end.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from benchmarks.common import Measured, run

MEMORY_MB = 8_000
WOFLAN_PYTHON = os.environ.get("GPSFSM_PM4PY_PYTHON", sys.executable)
NUSMV = os.environ.get("GPSFSM_NUSMV", "NuSMV")

_ABORTS = (
    "VECTORSZ",
    "too many",
    "max search depth too small",
    "out of memory",
    "reached -DMEMLIM bound",
    "aborting",
    "transition failed",
)


@dataclass(frozen=True, slots=True)
class Answer:
    """``possible`` is the tool's answer to "can it be?", None for no verdict (``why`` says)."""

    possible: bool | None
    seconds: float
    peak_mb: float = 0.0
    why: str = ""
    detail: str = ""


def spin(
    model: Path, *, size: int, misses: bool, timeout_s: float, optimise: str = "-O2"
) -> Answer:
    """Generate, compile and run SPIN's verifier. ``size`` is the number of the model's nodes.

    The time is that of all three, the memory that of the last. ``optimise`` goes to the compiler:
    where the search is short, most of the time would be spent on optimising it.
    """
    folder = model.parent
    vector = 2_048 + 64 * size
    compile_ = ["gcc", optimise, "-w", "-DSAFETY", f"-DVECTORSZ={vector}", f"-DMEMLIM={MEMORY_MB}"]
    # -E: an invalid end state is not what is asked; -A: nor is an assertion.
    search = ["./pan", "-A" if misses else "-E", f"-m{20_000 + 40 * size}"]
    spent = 0.0
    done: Measured | None = None
    for command in (["spin", "-a", model.name], [*compile_, "-o", "pan", "pan.c"], search):
        left = timeout_s - spent
        done = run(command, timeout_s=max(left, 0.01), memory_mb=MEMORY_MB, cwd=folder)
        spent += done.seconds
        if done.timed_out:
            return Answer(None, spent, done.peak_mb, f"over {timeout_s:.0f} s in {command[0]}")
        if done.code != 0 and command is not search:
            said = re.sub(r"^.*Error: ", "", _first_line(done.out + done.err))
            return Answer(None, spent, done.peak_mb, f"{command[0]}: {said}")
    assert done is not None
    verdict, why = read_pan(done.out + done.err, misses=misses)
    states = re.search(r"(\d+) states, stored", done.out)
    detail = f"{int(states[1]):,} states, {done.seconds:.1f} s" if states else ""
    return Answer(verdict, spent, done.peak_mb, why, detail)


def read_pan(output: str, *, misses: bool) -> tuple[bool | None, str]:
    """The verdict in the output of SPIN's verifier, or why there is none."""
    for line in output.splitlines():
        if any(abort in line for abort in _ABORTS):
            return None, line.strip()[:100]
    errors = re.search(r"errors: (\d+)", output)
    if errors is None:
        return None, "pan: no result"
    expected = "invalid end state" if misses else "assertion violated"
    if int(errors[1]) > 0:
        return (True, "") if expected in output else (None, "pan: another error than asked for")
    if "Search not completed" in output:
        return None, "pan: search not completed"
    return False, ""


def read_pan_formula(output: str) -> tuple[bool | None, str]:
    """True if SPIN's verifier shows a run that breaks the formula; or why there is no verdict."""
    for line in output.splitlines():
        if any(abort in line for abort in _ABORTS):
            return None, line.strip()[:100]
    errors = re.search(r"errors: (\d+)", output)
    if errors is None:
        return None, "pan: no result"
    if int(errors[1]) > 0:
        # Shown by a run that goes on for ever, or by its beginning, which is an assertion of the
        # formula's automaton: the models have none of their own.
        shown = "acceptance cycle" in output or "assertion violated" in output
        return (True, "") if shown else (None, "pan: another error than asked for")
    if "Search not completed" in output:
        return None, "pan: search not completed"
    return False, ""


def nusmv(model: Path, *, misses: bool, timeout_s: float, options: tuple[str, ...] = ()) -> Answer:
    """Check the one formula of an SMV model."""
    command = [NUSMV, *options, "-dcx", str(model)]
    done = run(command, timeout_s=timeout_s, memory_mb=MEMORY_MB, cwd=model.parent)
    if done.timed_out:
        return Answer(None, done.seconds, done.peak_mb, f"over {timeout_s:.0f} s")
    verdicts = re.findall(r"^-- specification .* is (true|false)$", done.out, re.MULTILINE)
    if done.code != 0 or len(verdicts) != 1:
        reason = _first_line(done.err) or f"exit {done.code}"
        return Answer(None, done.seconds, done.peak_mb, reason)
    holds = (verdicts[0] == "true") is not misses
    return Answer(holds, done.seconds, done.peak_mb)


def woflan(model: Path, *, timeout_s: float) -> Answer:
    """Ask whether the net is unsound."""
    command = [WOFLAN_PYTHON, str(Path(__file__).with_name("woflan.py")), str(model)]
    done = run(command, timeout_s=timeout_s, memory_mb=MEMORY_MB, cwd=model.parent)
    if done.timed_out:
        return Answer(None, done.seconds, done.peak_mb, f"over {timeout_s:.0f} s")
    lines = done.out.split()
    if done.code != 0 or not lines or lines[-1] not in ("sound", "unsound"):
        reason = (done.err.strip().splitlines() or ["no answer"])[-1]
        return Answer(None, done.seconds, done.peak_mb, reason)
    return Answer(lines[-1] == "unsound", done.seconds, done.peak_mb)


@cache
def versions() -> dict[str, str]:
    """The tools that are here, with their versions."""
    lines: dict[str, str] = {}
    if shutil.which("spin") and shutil.which("gcc"):
        said = run(["spin", "-V"]).out
        lines["spin"] = (re.search(r"\d+(\.\d+)+", said) or [""])[0]
    if shutil.which(NUSMV):
        help_ = run([NUSMV, "-h"])
        lines["nusmv"] = (re.search(r"\d+(\.\d+)+", help_.out + help_.err) or [""])[0]
    command = [WOFLAN_PYTHON, "-c", "import importlib.metadata as m; print(m.version('pm4py'))"]
    pm4py = run(command)
    if pm4py.code == 0:
        lines["woflan"] = pm4py.out.strip()
    return lines


def _first_line(text: str) -> str:
    return (text.strip().splitlines() or [""])[0][:100]
