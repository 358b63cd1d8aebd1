"""Kills a process that runs a journaled plan, again and again, and looks at what is left."""

from __future__ import annotations

import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING

from corpus import generate
from gpsfsm.execution.journal_errors import JournalError
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.journal_rows import line
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.replay import replay
from tests.cli.support import environment
from tests.execution.crash_child import WAYS
from tests.execution.journaling import compiled, exported
from tests.forked import Forked, can_fork

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.execution.journal_rows import Row

ROOT = Path(__file__).resolve().parents[2]


@dataclass(slots=True)
class Campaign:
    """Kills by how they were done, and how many plans have been run to their end."""

    kills: dict[str, int]
    plans: int = 0
    events: int = 0

    @property
    def total(self) -> int:
        return sum(self.kills.values())


def campaign(folder: Path, kills: int, *, seed: int, size: int = 200) -> Campaign:
    """Kill ``kills`` times; raises AssertionError if anything is lost, doubled or different."""
    rng = Random(seed)  # noqa: S311
    done = Campaign(dict.fromkeys((*WAYS, "any time"), 0))
    while done.total < kills:
        done.plans += 1
        number = rng.randrange(10**6)
        plan = folder / f"{number}.xml"
        plan.write_text(generate.random(number, size), encoding="utf-8")
        _one_plan(plan, number, rng, done=done, kills=kills)
    return done


def _one_plan(plan: Path, number: int, rng: Random, *, done: Campaign, kills: int) -> None:
    whole, broken = plan.with_suffix(".whole.db"), plan.with_suffix(".db")
    assert _child([str(whole), str(plan), str(number), "none"])[-1] == "ended"
    expected = exported(whole)
    lines = expected.splitlines()[1:]
    done.events += len(lines)
    reached = 0
    while done.total < kills and reached < len(lines):
        arguments = [str(broken), str(plan), str(number), "power"]
        how = rng.choice([*WAYS, "any time"])
        if how == "any time":
            out = _child(arguments, kill_after=rng.uniform(0.05, 0.6))
        else:
            out = _child([*arguments, how, str(rng.randrange(1, 30))])
        if "ended" in out:
            break
        done.kills[how] += 1
        reached = _look(broken, lines, out)
    assert _child([str(broken), str(plan), str(number), "power"])[-1] == "ended"
    assert exported(broken) == expected


def _look(broken: Path, lines: list[str], out: list[str]) -> int:
    """How many events are in the journal of a process that was killed; all are as they must be."""
    acknowledged = [int(text) for text in out if text.isdecimal()]
    results: list[str] = []
    with suppress(JournalError), JournalReader(str(broken)) as reader:
        if reader.runs():
            results = [line(row) for row in reader.events(1)]
            assert reader.verify(1) == len(results)
    assert results == lines[: len(results)]
    assert len(results) >= max(acknowledged, default=0)
    return len(results)


def _child(
    arguments: Sequence[str], *, kill_after: float | None = None, module: str = "crash_child"
) -> list[str]:
    """What the child has printed. With ``kill_after`` seconds it is killed by then."""
    with begun(arguments, module) as process:
        if kill_after is not None:
            time.sleep(kill_after)
            process.kill()
        printed, errors = process.communicate()
    sys.stderr.write(errors.decode(errors="replace"))
    out = printed.decode()
    return out[: out.rfind("\n") + 1].splitlines()  # the last line may be cut off


def begun(arguments: Sequence[str], module: str = "crash_child") -> subprocess.Popen[bytes]:
    """A process of a module beside this one, with pipes for what it writes."""
    around, name = environment(), f"tests.execution.{module}"
    if can_fork(around):
        return Forked(arguments, cwd=ROOT, environment=around, module=name)
    return subprocess.Popen(
        [sys.executable, "-m", name, *arguments],
        cwd=ROOT,
        env=around,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def real_campaign(folder: Path, kills: int, *, seed: int) -> int:
    """Kill a run in real time until it ends, and ``kills`` times in all; how often it was.

    Raises AssertionError if anything acts that is not journaled, or acts again though its outcome
    is, or though it is not idempotent.
    """
    rng = Random(seed)  # noqa: S311
    killed = plans = 0
    while killed < kills:
        plans += 1
        plan = folder / f"real-{plans}.xml"
        plan.write_text(_real_plan(rng), encoding="utf-8")
        killed += _one_real_plan(plan, rng, kills - killed)
    return killed


def _real_plan(rng: Random) -> str:
    steps = []
    for _ in range(12):
        units = []
        for _ in range(rng.randrange(1, 5)):
            if rng.random() < 0.5:
                units.append('<Runner interface="again" provider="p"/>')
            else:  # it fails after a crash, and then something else is done
                units.append(
                    '<Runner interface="once" provider="p"/><Control name="or" type="recovery">'
                    '<Runner interface="again" provider="p"/></Control>'
                )
        steps.append(f'<Control name="all" type="parallel_all">{"".join(units)}</Control>')
    return f"<Plan>{''.join(steps)}</Plan>"


def _one_real_plan(plan: Path, rng: Random, kills: int) -> int:
    broken, effects = plan.with_suffix(".db"), plan.with_suffix(".effects")
    command = [str(broken), str(plan), str(effects)]
    killed, over, acted = 0, set[int](), list[tuple[int, str]]()
    while True:
        when = [str(rng.randrange(1, 12)), str(rng.randrange(60_000))] if killed < kills else []
        out = _child([*command, *when], module="crash_child_real")
        lines_now = effects.read_text(encoding="utf-8").splitlines() if effects.exists() else []
        pairs = [(int(text.split()[0]), text.split()[1]) for text in lines_now]
        new, acted = pairs[len(acted) :], pairs
        assert not over & {number for number, _ in new}, "it acted again"
        over = _over(broken, acted)
        if "ended" in out:
            break
        killed += 1
    once = _once(plan)
    numbers = [number for number, _ in acted if number in once]
    assert len(numbers) == len(set(numbers)), "it acted twice"
    assert len({key for _, key in acted}) == len({number for number, _ in acted}), "a new key"
    return killed


def _over(broken: Path, acted: list[tuple[int, str]]) -> set[int]:
    """The instances whose outcome is journaled; whatever acted was journaled first."""
    rows: list[Row] = []
    with suppress(JournalError), JournalReader(str(broken)) as reader:
        if reader.runs():
            rows = list(reader.events(1))
            assert reader.verify(1) == len(rows)
            plan = reader.content(reader.run(1), "plan").decode()
            replay(Kernel(compiled(plan)), rows)
    started = {row.node - 1 for row in rows if row.kind == "STARTED"}
    assert {number for number, _ in acted} <= started, "it acted before it was journaled"
    return {row.node - 1 for row in rows if row.record and row.kind in ("SUCCEEDED", "FAILED")}


def _once(plan: Path) -> set[int]:
    runners = compiled(plan.read_text(encoding="utf-8")).automaton.plan.runners
    return {number for number, runner in enumerate(runners) if runner.interface == "once"}
