"""The command line: ``python -m tests.mutants --help``."""

from __future__ import annotations

import argparse
import json
import re
import sys
import tempfile
import time
from functools import cache
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING

from tests.campaigns.marks import PAGE, replaced
from tests.mutants.operators import Mutant, mutants_of
from tests.mutants.runner import KILLED, ROOT, SURVIVED, TIMED_OUT, Judge, copied

if TYPE_CHECKING:
    from collections.abc import Sequence

_TEXTS = re.compile(r"words|examples|messages|__init__|/limits|explain_")


@cache
def _everything() -> tuple[Mutant, ...]:
    found: list[Mutant] = []
    for file in sorted((ROOT / "analysis").rglob("*.py")):
        name = str(file.relative_to(ROOT))
        if not _TEXTS.search(name):
            found += mutants_of(name, file.read_text(encoding="utf-8"))
    return tuple(found)


def sample(seed: int) -> list[Mutant]:
    """All mutants of analysis/ in an order drawn by a seed; modules of texts are left out."""
    found = list(_everything())
    Random(seed).shuffle(found)  # noqa: S311  (a sample, no secret)
    return found


def report(results: dict[str, str], mutants: int, seed: int) -> str:
    """What came of it, as Markdown."""
    counts = {end: list(results.values()).count(end) for end in (KILLED, TIMED_OUT, SURVIVED)}
    noticed = counts[KILLED] + counts[TIMED_OUT]
    summary = (
        f"{len(results)} of {mutants:,} mutants, drawn with seed {seed}: {counts[KILLED]} killed, "
        f"{counts[TIMED_OUT]} killed by the time limit, {counts[SURVIVED]} survived; "
        f"{100 * noticed / max(len(results), 1):.0f} % noticed."
    )
    if not counts[SURVIVED]:
        return summary
    lines = [summary, "", "| survivor | change |", "|---|---|"]
    for name in sorted(name for name, end in results.items() if end == SURVIVED):
        place, _, change = name.partition(" ")
        lines.append(f"| `{place}` | {change} |")
    return "\n".join(lines)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("--mutants", type=int, default=200, help="how many of the sample")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop after this time")
    parser.add_argument("--results", type=Path, help="a file of results: go on from it, and add")
    parser.add_argument("--write", action="store_true", help="write docs/reliability.md")
    return parser


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line."""
    chosen = _parser().parse_args(words)
    until_s = time.monotonic() + chosen.seconds
    results: dict[str, str] = {}
    if chosen.results is not None and chosen.results.exists():
        results = json.loads(chosen.results.read_text(encoding="utf-8"))
    everything = sample(chosen.seed)
    drawn = everything[: chosen.mutants]
    with tempfile.TemporaryDirectory() as folder:
        copy = copied(Path(folder))
        judge = Judge(copy)
        for mutant in drawn:
            if str(mutant) in results:
                continue
            if time.monotonic() > until_s:
                break
            began_s = time.monotonic()
            results[str(mutant)] = found = judge.judge(mutant)
            print(f"{found:9} {time.monotonic() - began_s:6.1f} s  {mutant}", flush=True)
            if chosen.results is not None:
                chosen.results.write_text(json.dumps(results, indent=1), encoding="utf-8")
    text = report(results, len(everything), chosen.seed)
    print(text)
    if chosen.write:
        page = PAGE.read_text(encoding="utf-8")
        PAGE.write_text(replaced(page, "mutants", text), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
