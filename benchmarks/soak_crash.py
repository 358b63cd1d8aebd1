"""The long crash campaign: ``python benchmarks/soak_crash.py [KILLS [SEED]]``.

Kills processes that run journaled plans, 200 times unless told otherwise, and writes what came of
it into docs/execution.md. It fails at the first event that is lost, doubled or different.
"""

from __future__ import annotations

import re
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from tests.execution.crashing import Campaign, campaign, real_campaign  # noqa: E402

PAGE = ROOT / "docs" / "execution.md"
BLOCK = re.compile(r"(<!-- soak:crash -->\n).*?(<!-- /soak:crash -->)", re.DOTALL)
WORDS = {
    "before": "before a write",
    "insert": "between the steps of its SQL statements",
    "inside": "between these and the commit",
    "after": "after it, before anything was done",
    "any time": "at any time",
}


def summary(done: Campaign, real: int) -> str:
    """What came of it, as Markdown."""
    rows = [f"| {WORDS[how]} | {count} |" for how, count in done.kills.items()]
    return "\n".join(
        [
            f"{done.total} kills over {done.plans} plans with {done.events} events: "
            "nothing lost, nothing doubled, all ends the same.",
            "",
            "| killed | times |",
            "|---|---:|",
            *rows,
            "",
            f"In real time {real} kills: nothing acted that was not journaled, nothing acted again "
            "whose outcome was, and what is not idempotent acted at most once.",
            "",
        ]
    )


def main() -> None:
    kills = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 4
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        done = campaign(Path(folder), kills, seed=seed)
        real = real_campaign(Path(folder), kills // 2, seed=seed)
    text = summary(done, real)
    print(text + f"{time.monotonic() - began:.0f} s")
    if kills >= 200:
        page = PAGE.read_text(encoding="utf-8")
        PAGE.write_text(BLOCK.sub(lambda match: match[1] + text + match[2], page), encoding="utf-8")


if __name__ == "__main__":
    main()
