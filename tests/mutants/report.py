"""What came of the planted defects, as Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.mutants.runner import KILLED, SURVIVED, TIMED_OUT

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from tests.mutants.operators import Mutant

__all__ = ["report"]


def report(
    results: Mapping[str, str],
    of_rules: Sequence[tuple[str, Mutant]],
    drawn: Sequence[Mutant],
    mutants: int,
) -> str:
    """The two samples, each with its counts, and the survivors of both.

    ``of_rules`` are the defects with the rule they harm, ``drawn`` those of all ``mutants``.
    """
    judged = [(code, str(each)) for code, each in of_rules if str(each) in results]
    others = [str(each) for each in drawn if str(each) in results]
    noticed = {code for code, name in judged if results[name] != SURVIVED}
    rules = {code for code, _ in judged}
    lines = [
        "| sample | defects | killed | by the time limit | survived | noticed |",
        "|---|---:|---:|---:|---:|---:|",
        _row(f"of each of {len(rules)} rules", (results[name] for _, name in judged)),
        _row(f"of all {mutants:,} in `analysis/`", (results[name] for name in others)),
        _row("both", (results[name] for name in {*others, *(name for _, name in judged)})),
        "",
        f"At least one defect was noticed of {len(noticed)} of the {len(rules)} rules.",
    ]
    survivors = sorted({*others, *(name for _, name in judged)})
    survivors = [name for name in survivors if results[name] == SURVIVED]
    if survivors:
        lines += ["", "| survivor | change |", "|---|---|"]
    for name in survivors:
        place, _, change = name.partition(" ")
        lines.append(f"| `{place}` | {change} |")
    return "\n".join(lines)


def _row(name: str, ends: Iterable[str]) -> str:
    result = list(ends)
    killed, limit, left = (result.count(end) for end in (KILLED, TIMED_OUT, SURVIVED))
    share = 100 * (killed + limit) / max(len(result), 1)
    return f"| {name} | {len(result)} | {killed} | {limit} | {left} | {share:.1f} % |"
