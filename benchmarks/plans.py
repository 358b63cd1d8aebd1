"""How long does one real plan take, in a process that is already running?

The plans are the Fabric plans of a published experiment with language models. Each is checked
several times in turn with the others; the time of a plan is the median of its times.
"""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import gpsfsm
from benchmarks.common import ROOT, circumstances, median, percentile, table

if TYPE_CHECKING:
    from collections.abc import Sequence

Choice = Literal["auto", "structural"]
PLANS = Path(os.environ.get("GPSFSM_PLANS", ROOT.parent / "shared/corpus/experiment1/fabric"))
TARGET_MS = 6.0


def measure(
    texts: Sequence[bytes], solver: Choice, rounds: int, *, capabilities: bool = True
) -> list[float]:
    """Milliseconds per text."""
    gpsfsm.check(texts[0], solver=solver)  # imports are not what is asked here
    times: list[list[float]] = [[] for _ in texts]
    for _ in range(rounds):
        for number, text in enumerate(texts):
            started = time.perf_counter()
            gpsfsm.check(text, solver=solver, builtin_capabilities=capabilities)
            times[number].append(1000 * (time.perf_counter() - started))
    return [median(each) for each in times]


def row(name: str, solver: Choice, seconds: Sequence[float]) -> list[str]:
    """One line of the table."""
    figures = (median(seconds), percentile(seconds, 0.95), max(seconds))
    return [name, f"`{solver}`", str(len(seconds)), *(f"{figure:.2f}" for figure in figures)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plans", type=Path, default=PLANS, help="folder of plans")
    parser.add_argument("--rounds", type=int, default=5)
    chosen = parser.parse_args()
    files = sorted(chosen.plans.rglob("*.xml")) if chosen.plans.is_dir() else []
    if not files:
        print("Not measured: the plans of the experiment are not here. Say where they are with")
        print("`GPSFSM_PLANS=folder` or `--plans folder`.")
        return
    where = circumstances()
    texts = [file.read_bytes() for file in files]
    distinct = list(dict.fromkeys(texts))
    analysed = [text for text in distinct if gpsfsm.check(text).plans[0].facts is not None]
    rows: list[list[str]] = []
    medians: dict[str, float] = {}
    choices: tuple[Choice, ...] = ("auto", "structural")
    for solver in choices:
        seconds = measure(texts, solver, chosen.rounds)
        medians[solver] = median(seconds)
        rows.append(row("all plans", solver, seconds))
        by_text = dict(zip(texts, seconds, strict=True))
        for name, kind in (("distinct texts", distinct), ("distinct texts with facts", analysed)):
            rows.append(row(name, solver, [by_text[text] for text in kind]))
    bare = measure(texts, "auto", chosen.rounds, capabilities=False)
    rows.append(row("all plans, no capabilities", "auto", bare))
    print(where)
    print()
    head = ["plans", "`--solver`", "number", "median, ms", "95th percentile, ms", "slowest, ms"]
    print(table(head, rows))
    print()
    print(
        f"`auto` puts every question to z3 as well. Median per plan: {medians['auto']:.2f} ms "
        f"with z3, {medians['structural']:.2f} ms without (target: under {TARGET_MS:.0f} ms with "
        "all analyses). The last line leaves out what capabilities add: GP2xx, GP4xx and GP5xx."
    )


if __name__ == "__main__":
    main()
