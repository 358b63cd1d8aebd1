"""How long does the gate take for one real plan, cold and warm?

Warm: a gate whose process is there already; counted is from the call to the verdict. Cold: a new
process ``gpsfsm gate plan.xml``, which starts another one to decide. The plans are the Fabric plans
of a published experiment with language models; cold starts take some of them in turn.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.common import GPSFSM, ROOT, circumstances, percentile, run, table

if TYPE_CHECKING:
    from collections.abc import Sequence

PLANS = Path(os.environ.get("GPSFSM_PLANS", ROOT.parent / "shared/corpus/experiment1/fabric"))


def warm(texts: Sequence[bytes], rounds: int, engine: str) -> tuple[list[float], int, int]:
    """Milliseconds per decision, how many plans are accepted, and how many were not decided."""
    from gpsfsm.api import check_options
    from gpsfsm.gating import Gate, GateOptions, Reason

    times, accepted, undecided = [], 0, 0
    with Gate(GateOptions(check=check_options(engine=engine)), budget_ms=60_000) as gate:
        for number in range(rounds):
            for text in texts:
                started = time.perf_counter()
                verdict = gate(text)
                times.append(1000 * (time.perf_counter() - started))
                if number == 0:
                    accepted += verdict.accepted
                    undecided += verdict.reason is Reason.INCONCLUSIVE
    return times, accepted, undecided


def cold(texts: Sequence[bytes], starts: int, engine: str) -> list[float]:
    """Milliseconds per process."""
    times = []
    with tempfile.TemporaryDirectory() as folder:
        plan = Path(folder) / "plan.xml"
        for number in range(starts + 2):  # the first two fill the caches
            plan.write_bytes(texts[number * 7 % len(texts)])
            done = run((*GPSFSM, "gate", "--engine", engine, plan), cwd=Path(folder))
            if number >= 2:
                times.append(1000 * done.seconds)
    return times


def row(name: str, seconds: Sequence[float]) -> list[str]:
    """One line of the table."""
    figures = (percentile(seconds, 0.5), percentile(seconds, 0.99), max(seconds))
    return [name, str(len(seconds)), *(f"{figure:,.1f}" for figure in figures)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plans", type=Path, default=PLANS, help="folder of plans")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--starts", type=int, default=25)
    chosen = parser.parse_args()
    files = sorted(chosen.plans.rglob("*.xml")) if chosen.plans.is_dir() else []
    if not files:
        print("Not measured: the plans of the experiment are not here. Say where they are with")
        print("`GPSFSM_PLANS=folder` or `--plans folder`.")
        return
    where = circumstances()
    texts = list(dict.fromkeys(file.read_bytes() for file in files))
    rows, notes = [], []
    for engine in ("paper", "fabric-v2"):
        starts = cold(texts, chosen.starts, engine)
        times, accepted, undecided = warm(texts, chosen.rounds, engine)
        rows += [row(f"warm, `{engine}`", times), row(f"cold, `{engine}`", starts)]
        notes.append(f"`{engine}` accepts {accepted} and leaves {undecided} undecided")
    print(where)
    print()
    print(table(["gate", "decisions", "p50, ms", "p99, ms", "greatest, ms"], rows))
    print()
    print(f"{len(texts)} different texts; {'; '.join(notes)}.")


if __name__ == "__main__":
    main()
