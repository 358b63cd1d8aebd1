"""The kernel does what the original run-time was recorded to do."""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from gpsfsm.capabilities.library import Library
from gpsfsm.compile.engine_text import EngineReading, read_for_engine
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Load, Start, Stop

if TYPE_CHECKING:
    from gpsfsm.compile import Compiled

SHARED = Path(__file__).parents[3] / "shared" / "corpus"
TRACES = SHARED / "engine" / "runtime_traces.txt"
_ENDS = {"RESULT: COMPLETED": "COMPLETED", "RESULT: HANG (no completion)": "HANG"}
_STEP = re.compile(r"(\w+)\{([\w,]*)\}|(\w+)")


@dataclass(frozen=True)
class Recorded:
    """One recorded run; ``lines`` are what leaves do, without those of joins and completion."""

    engine: str
    shape: str
    failing: frozenset[str]
    emits_started: bool
    lines: tuple[str, ...]
    end: str


def recorded() -> list[Recorded]:
    if not TRACES.exists():
        return []
    traces = []
    for part in re.split(r"^### ", TRACES.read_text(), flags=re.MULTILINE)[1:]:
        head, *lines = part.splitlines()
        shape, *options = head.split(" | ")
        options_ = dict(option.split(": ") for option in options)
        started = options_.get("leaves emit STARTED")
        ends = [_ENDS.get(line.strip()) for line in lines if line.startswith("RESULT")]
        traces.append(
            Recorded(
                "fabric-v1" if started is None else "fabric-v2",
                shape.removesuffix(" only"),
                frozenset(options_["failing"].split(",")) - {"-"},
                started != "0",
                tuple(filter(None, map(_leaf, lines))),
                ends[0] or "" if ends else "ABORT",
            )
        )
    return traces


def _leaf(line: str) -> str:
    words = line.split()
    if not words or words[0] not in ("trigger", "SUCCEEDED", "FAILED"):
        return ""
    name = words[1]
    return "" if name == "DONE" or name.startswith("MUX") else f"{words[0]} {name}"


def text_of(shape: str) -> str:
    """``P;recovery{A,B};Z`` as a plan."""
    if shape == "seq":
        shape = "A;B"
    parts = []
    for kind, inside, name in _STEP.findall(shape):
        if name:
            parts.append(_runner(name))
        else:
            parts.append(
                f'<Control type="{kind}">{"".join(map(_runner, inside.split(",")))}</Control>'
            )
    return f"<Plan>{''.join(parts)}</Plan>"


def _runner(name: str) -> str:
    return f'<Runner interface="{name}" provider="{name}"/>'


def play(compiled: Compiled, failing: frozenset[str]) -> tuple[list[str], str]:
    """A run in which outcomes come in the order in which instances started."""
    kernel = Kernel(compiled)
    runners = compiled.automaton.plan.runners
    lines: list[str] = []
    waiting: deque[Input] = deque([Input(Kind.BEGIN)])
    stopping: list[Input] = []
    while waiting:
        records, commands = kernel.step(waiting.popleft())
        words = {Kind.TRIGGERED: "trigger", Kind.SUCCEEDED: "SUCCEEDED", Kind.FAILED: "FAILED"}
        for record in records:
            if record.kind in words and record.node > 0:
                lines.append(f"{words[record.kind]} {runners[record.node - 1].interface}")
        for command in commands:
            if isinstance(command, Load):
                waiting.appendleft(Input(Kind.LOADED, runner=command.runner))
            elif isinstance(command, Start):
                fails = runners[command.number].interface in failing
                waiting.append(Input(Kind.FAILED if fails else Kind.SUCCEEDED, command.number))
            elif isinstance(command, Stop):
                stopping.append(Input(Kind.STOPPED, command.number))
        if stopping:
            waiting, stopping = deque(stopping), []
    return lines, kernel.status.value


@pytest.mark.skipif(not TRACES.exists(), reason="../shared/corpus/engine is not here")
@pytest.mark.parametrize("run", recorded(), ids=lambda run: f"{run.engine} {run.shape}")
def test_recorded_runs(run: Recorded) -> None:
    reading = read_for_engine(text_of(run.shape), run.engine, "plan.xml", Library())
    assert isinstance(reading, EngineReading)
    compiled = reading.compiled
    if run.engine == "fabric-v2" and run.emits_started:
        automaton = compiled.automaton
        traits = replace(automaton.traits, silent=frozenset())
        compiled = replace(compiled, automaton=replace(automaton, traits=traits))
    lines, end = play(compiled, run.failing)
    assert end == run.end
    if run.engine == "fabric-v2" and not run.emits_started:
        assert lines == list(run.lines)  # one thing at a time
    else:
        assert sorted(lines) == sorted(run.lines)


def test_something_is_recorded() -> None:
    if not TRACES.exists():
        pytest.skip("../shared/corpus/engine is not here")
    assert {run.end for run in recorded()} == {"COMPLETED", "HANG", "ABORT"}
