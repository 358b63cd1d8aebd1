"""The command line: ``python -m tests.mutants --help``."""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import TYPE_CHECKING

from tests.campaigns.marks import PAGE, replaced
from tests.mutants.processes import judged, start
from tests.mutants.report import report
from tests.mutants.samples import of_rules, over_analysis

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tests.mutants.operators import Mutant


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("--each-rule", type=int, default=2, help="how many for every rule")
    parser.add_argument("--rule", action="append", help="GP302, for example: of these rules only")
    parser.add_argument("--mutants", type=int, default=250, help="how many of all analysis/")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop after this time")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--results", type=Path, help="a file of results: go on from it, and add")
    parser.add_argument("--again", action="store_true", help="judge those that survived again")
    parser.add_argument("--write", action="store_true", help="write docs/reliability.md")
    return parser


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line."""
    chosen = _parser().parse_args(words)
    until = time.time() + chosen.seconds
    results: dict[str, str] = {}
    if chosen.results is not None and chosen.results.exists():
        results = json.loads(chosen.results.read_text(encoding="utf-8"))
    if chosen.again:
        results = {name: each for name, each in results.items() if each != "survived"}
    of_each = of_rules(chosen.seed, chosen.each_rule)
    if chosen.rule is not None:
        of_each = [(code, mutant) for code, mutant in of_each if code in chosen.rule]
    everything = over_analysis(chosen.seed)
    drawn = everything[: chosen.mutants]
    todo: dict[Mutant, str] = {}
    for code, mutant in (*of_each, *(("", mutant) for mutant in drawn)):
        if str(mutant) not in results:
            todo.setdefault(mutant, code)
    with (
        tempfile.TemporaryDirectory() as folder,
        ProcessPoolExecutor(
            chosen.jobs, multiprocessing.get_context("spawn"), start, (folder,)
        ) as pool,
    ):
        futures = [pool.submit(judged, code, mutant, until) for mutant, code in todo.items()]
        for answer in as_completed(futures):
            mutant, status, seconds = answer.result()
            if status:
                results[str(mutant)] = status
                print(f"{status:9} {seconds:6.1f} s  {mutant}", flush=True)
            if status and chosen.results is not None:
                chosen.results.write_text(json.dumps(results, indent=1), encoding="utf-8")
    text = report(results, of_each, drawn, len(everything))
    print(text)
    if chosen.write:
        page = PAGE.read_text(encoding="utf-8")
        PAGE.write_text(replaced(page, "mutants", text), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
