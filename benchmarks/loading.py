"""How many runners must be loaded at once, against loading all of them before the first trigger?

The paper claims that loading runners as they are needed saves resources. Here both numbers are
decided for every plan: the different runners of the plan, which the original engine loads at the
start, and the greatest number of them that is needed at one instant of any run.
"""

from __future__ import annotations

import argparse
import os
from collections import Counter
from pathlib import Path

import gpsfsm
from benchmarks.common import ROOT, table

REAL = Path(os.environ.get("GPSFSM_CORPUS", ROOT.parent / "shared/corpus"))
FOLDERS = {
    "plans of a published experiment (navigation only)": REAL / "experiment1/fabric",
    "plans that a robot ran, and the plans that asked for them": REAL / "experiment2",
    "hand-written plans of the original stack": REAL / "plans",
    "our own plans": ROOT / "corpus/plans",
}


def loads(folder: Path) -> Counter[tuple[int, int]]:
    """How many plans have which (all, peak); plans without facts are left out."""
    counts: Counter[tuple[int, int]] = Counter()
    for plan in gpsfsm.check(folder).plans:
        loaded = plan.facts.loaded if plan.facts is not None else None
        if loaded is not None and loaded.peak is not None and loaded.all:
            counts[loaded.all, loaded.peak] += 1
    return counts


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    rows: list[list[str]] = []
    for name, folder in FOLDERS.items():
        if not folder.is_dir():
            rows.append([name, "not here", "", "", ""])
            continue
        counts = loads(folder)
        plans = sum(counts.values())
        everything = sum(all_ * count for (all_, _), count in counts.items())
        needed = sum(peak * count for (_, peak), count in counts.items())
        saved = sum(count for (all_, peak), count in counts.items() if peak < all_)
        rows.append(
            [
                name,
                str(plans),
                f"{everything / plans:.2f}",
                f"{needed / plans:.2f}",
                f"{100 * saved / plans:.0f} %",
            ]
        )
    head = ["plans", "number", "all, mean", "needed at once, mean", "plans with a saving"]
    print(table(head, rows))


if __name__ == "__main__":
    main()
