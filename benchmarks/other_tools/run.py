"""The same questions to SPIN, NuSMV and Woflan: how far does each get within 60 seconds?

Every tool climbs a ladder of n, a finer one if it is known to explode early, and stops at the
first n for which it has no answer within 60 s and 8 GB. An answer other than the known one ends
the benchmark: then a model is wrong.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Container, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.common import GPSFSM, ROOT, circumstances, run, seconds, table
from benchmarks.other_tools import tools
from benchmarks.other_tools.cases import ASSUMPTION, CASES, Case, Format
from benchmarks.other_tools.tools import Answer

if TYPE_CHECKING:
    from benchmarks.other_tools.questions import Style

TIMEOUT_S = 60.0
LADDER = (10, 100, 250, 500, 1_000, 10_000)
FINE = (2, 4, 5, 6, 8, 10, 12, 16, 20, 22, 24, 26, 32, 64, *LADDER[1:])

ALL_TOOLS = ("spin", "nusmv", "woflan")

Ask = Callable[[Case, int, Path], Answer]


@dataclass(frozen=True, slots=True)
class Contestant:
    """A tool with one way of writing models for it. ``cases``: those that it is asked."""

    name: str
    ask: Ask
    ladder: tuple[int, ...] = LADDER
    cases: tuple[str, ...] = tuple(case.key for case in CASES)


def _model(case: Case, n: int, form: Format, style: Style, file: Path) -> tuple[bool, int]:
    """Write a model: whether the question is a CanMiss, and the number of nodes."""
    module = "benchmarks.other_tools.cases"
    command = [sys.executable, "-m", module, case.key, str(n), form, style, str(file)]
    done = run(command, cwd=ROOT)
    if done.code != 0:
        raise SystemExit(f"no model for {case.key}, n = {n}:\n{done.err}")
    about = json.loads(done.out)
    return about["misses"], about["size"]


def _spin(style: Style) -> Ask:
    def ask(case: Case, n: int, folder: Path) -> Answer:
        file = folder / "model.pml"
        misses, size = _model(case, n, "promela", style, file)
        optimise = "-O2" if style == "natural" else "-O0"
        return tools.spin(file, size=size, misses=misses, timeout_s=TIMEOUT_S, optimise=optimise)

    return ask


def _nusmv(style: Style, *options: str) -> Ask:
    def ask(case: Case, n: int, folder: Path) -> Answer:
        file = folder / "model.smv"
        misses, _ = _model(case, n, "smv", style, file)
        return tools.nusmv(file, misses=misses, timeout_s=TIMEOUT_S, options=options)

    return ask


def _woflan(case: Case, n: int, folder: Path) -> Answer:
    file = folder / "net.json"
    _model(case, n, "petri", "natural", file)
    return tools.woflan(file, timeout_s=TIMEOUT_S)


def _gpsfsm(case: Case, n: int, folder: Path) -> Answer:
    """The whole command: it answers this question and all others, with findings and scenarios."""
    plan = folder / "plan.xml"
    plan.write_text(case.plan(n), encoding="utf-8")
    assume = ["--assume", ASSUMPTION] if case.reliable else []
    command = (*GPSFSM, "check", "--isolated", "--format", "json", *assume, str(plan))
    done = run(command, timeout_s=TIMEOUT_S, memory_mb=tools.MEMORY_MB, cwd=folder)
    if done.timed_out:
        return Answer(None, done.seconds, done.peak_mb, f"over {TIMEOUT_S:.0f} s")
    if done.code not in (0, 1):
        return Answer(None, done.seconds, done.peak_mb, (done.err or "no verdict")[:100])
    facts = json.loads(done.out)["plans"][0]["facts"]
    return Answer(case.in_facts(facts), done.seconds, done.peak_mb)


def contestants(here: Container[str]) -> Iterator[Contestant]:
    """Those whose tools are installed."""
    forks = ("safe", "needle", "unsafe")
    yield Contestant("gpsfsm", _gpsfsm)
    if "spin" in here:
        yield Contestant("SPIN, natural model", _spin("natural"), FINE, forks)
        yield Contestant("SPIN, expert's model", _spin("expert"))
    if "nusmv" in here:
        yield Contestant("NuSMV, natural model", _nusmv("natural"))
        yield Contestant("NuSMV, expert's model", _nusmv("expert"), cases=("safe",))
    if "woflan" in here:
        cases = tuple(case.key for case in CASES if case.unsound is not None)
        yield Contestant("Woflan", _woflan, FINE, cases)


def step(contestant: Contestant, case: Case, n: int) -> Answer:
    """Ask once, in a process of its own: reading plans and answers takes memory (common.run)."""
    worker = [sys.executable, "-m", "benchmarks.other_tools.run", "--step"]
    done = run([*worker, case.key, contestant.name, str(n)], cwd=ROOT)
    if done.code != 0:
        raise SystemExit(f"{contestant.name}, {case.key}, n = {n}:\n{done.err}")
    print(case.key, contestant.name, n, done.out.strip(), file=sys.stderr, flush=True)
    return Answer(**json.loads(done.out))


def climb(contestant: Contestant, case: Case) -> list[str]:
    """One line of the table: how far a tool gets."""
    last: tuple[int, Answer] | None = None
    beyond = "the end of the ladder"
    for n in contestant.ladder:
        step_ = step(contestant, case, n)
        if step_.possible is None:
            beyond = f"n = {n:,}: {step_.why}"
            break
        if step_.possible is not case.possible:
            raise SystemExit(f"{contestant.name} is wrong about {case.key}, n = {n}: {step_}")
        if step_.seconds > TIMEOUT_S:
            beyond = f"n = {n:,}: {seconds(step_.seconds)} s"
            break
        last = (n, step_)
    if last is None:
        return [contestant.name, "none", "", "", "", beyond]
    n, answer = last
    figures = [f"{n:,}", seconds(answer.seconds), f"{answer.peak_mb:.0f}", answer.detail]
    return [contestant.name, *figures, beyond]


def one_step(key: str, name: str, n: str) -> None:
    """Ask one tool once and print its answer as JSON."""
    (case,) = (case for case in CASES if case.key == key)
    (contestant,) = (each for each in contestants(ALL_TOOLS) if each.name == name)
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(asdict(contestant.ask(case, int(n), Path(folder)))))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--case", action="append", choices=[case.key for case in CASES])
    parser.add_argument("--tool", action="append", help="only tools whose names begin so")
    parser.add_argument("--step", nargs=3, metavar=("CASE", "TOOL", "N"), help="one, as JSON")
    chosen = parser.parse_args()
    if chosen.step:
        one_step(*chosen.step)
        return
    where = circumstances()
    here = tools.versions()
    names = {"spin": "SPIN", "nusmv": "NuSMV", "woflan": "pm4py (Woflan)"}
    print(where)
    print("Tools:", ", ".join(f"{names[key]} {here.get(key, 'not installed')}" for key in names))
    head = ["tool", "largest n", "time, s", "memory, MB", "of that, SPIN's search", "next"]
    for case in CASES:
        if chosen.case and case.key not in chosen.case:
            continue
        rows = [
            climb(contestant, case)
            for contestant in contestants(here)
            if case.key in contestant.cases
            and contestant.name.startswith(tuple(chosen.tool or [""]))
        ]
        print(f"\n**{case.title[0].upper()}{case.title[1:]}**\n\n{table(head, rows)}", flush=True)


if __name__ == "__main__":
    main()
