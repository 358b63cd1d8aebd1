"""The command line of campaigns: ``python -m tests.campaigns --help``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from tests.campaigns.batch import play
from tests.campaigns.campaign import Goal, campaign, reproducer
from tests.campaigns.counts import Counts
from tests.campaigns.page import table, write_page
from tests.campaigns.registry import all_pairs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tests.campaigns.base import Pair

ROOT = Path(__file__).resolve().parents[2]
FAILURES = ROOT / "build" / "campaigns"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m tests.campaigns",
        description="Compare independent answers on random cases.",
        epilog="Exit code: 0 all agree, 1 a disagreement, 2 nothing could be compared.",
    )
    parser.add_argument("--only", action="append", metavar="NAME", help="this comparison; again")
    parser.add_argument("--without", action="append", metavar="NAME", default=[], help="not this")
    parser.add_argument("--cases", type=int, help="of each; without it, those of a long campaign")
    parser.add_argument("--seconds", type=float, help="stop after this time, and a batch of each")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="processes at once")
    parser.add_argument("--batch", type=int, help="play this batch alone, to see a failure again")
    parser.add_argument("--counts", type=Path, help="a file of counts: go on from it, and add")
    parser.add_argument("--failures", type=Path, default=FAILURES, help="where failures are put")
    parser.add_argument("--write", action="store_true", help="write docs/reliability.md")
    parser.add_argument("--attacks", action="store_true", help="the attacks, not the comparisons")
    parser.add_argument("--list", action="store_true", help="name the comparisons and attacks")
    return parser


def _chosen(
    parser: argparse.ArgumentParser,
    only: Sequence[str] | None,
    without: Sequence[str],
    *,
    attacks: bool,
) -> dict[str, Pair]:
    """The comparisons, or attacks, asked for that can be made here; says which cannot."""
    pairs = all_pairs()
    for name in (*(only or ()), *without):
        if name not in pairs:
            parser.error(f"there is no comparison '{name}'; there are {', '.join(pairs)}")
    chosen = {}
    for name in only or [name for name, pair in pairs.items() if pair.attack is attacks]:
        why = pairs[name].missing()
        if why:
            print(f"{name}: left out, {why}", file=sys.stderr)
        elif name not in without:
            chosen[name] = pairs[name]
    return chosen


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line."""
    parser = _parser()
    chosen = parser.parse_args(words)
    if chosen.list:
        for pair in all_pairs().values():
            print(f"{pair.name:12} {pair.about} ({pair.full:,} cases)")
        return 0
    pairs = _chosen(parser, chosen.only, chosen.without, attacks=chosen.attacks)
    if not pairs:
        return 2
    if chosen.batch is not None:
        done = [play(each.name, chosen.seed, chosen.batch, each.batch) for each in pairs.values()]
        failed = [batch for batch in done if batch.failure is not None]
        for batch in failed:
            print(f"{batch.failure.said}\n{batch.failure.text}")  # type: ignore[union-attr]
        return int(bool(failed))
    try:
        counts = Counts.load(chosen.counts, chosen.seed)
    except ValueError as error:
        parser.error(str(error))
    goal = Goal(chosen.cases, chosen.seconds)
    failed = []
    for batch in campaign(pairs, counts, goal, jobs=chosen.jobs):
        if chosen.counts is not None:
            counts.save(chosen.counts)
        if batch.failure is not None:
            failed.append(batch)
            print(f"{batch.pair}: a disagreement, see {reproducer(batch, chosen.failures)}")
    print(table(counts))
    if chosen.write:
        write_page(counts, attacks=chosen.attacks)
    if not any(each.cases for each in counts.of.values()):
        return 2
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
