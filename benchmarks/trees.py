"""Time of ``gpsfsm check`` as behaviour trees grow, below nodes of every kind.

Every figure is one whole process; its answers are compared with what is known of the family.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.common import GPSFSM, circumstances, run, seconds, table
from benchmarks.scale import growth

SIZES = (10, 100, 1_000, 10_000)
TIMEOUT_S = 300.0


@dataclass(frozen=True, slots=True)
class Family:
    """``body`` of a number of parts; ``leaves`` are those of a part.

    ``fewest`` failures make a tree of so many parts fail.
    """

    name: str
    leaves: int
    body: Callable[[int], str]
    fewest: Callable[[int], int]


def _sequence(part: str) -> Callable[[int], str]:
    def body(parts: int) -> str:
        return f"<Sequence>{''.join(part.format(number) for number in range(parts))}</Sequence>"

    return body


def _counted(parts: int) -> str:
    leaves = "".join(f"<A{number}/><Inverter><B{number}/></Inverter>" for number in range(parts))
    ports = f'success_count="{parts}" failure_count="{parts + 1}"'
    return f"<Parallel {ports}>{leaves}</Parallel>"


def _retried(parts: int) -> str:
    return f'<RetryUntilSuccessful num_attempts="{parts}"><A/></RetryUntilSuccessful>'


FAMILIES = (
    Family(
        "Inverters",
        2,
        _sequence("<Inverter><Sequence><A{0}/><B{0}/></Sequence></Inverter>"),
        lambda _: 0,
    ),
    Family(
        "IfThenElse",
        3,
        _sequence("<IfThenElse><A{0}/><B{0}/><Inverter><C{0}/></Inverter></IfThenElse>"),
        lambda _: 1,
    ),
    Family(
        "Parallel, 2 of 3",
        3,
        _sequence('<Parallel success_count="2" failure_count="2"><A{0}/><B{0}/><C{0}/></Parallel>'),
        lambda _: 2,
    ),
    Family("one Parallel, half of all", 2, _counted, lambda _: 1),
    Family("Retry", 1, _retried, lambda parts: parts),
)


def row_of(family: Family, runners: int, before: float | None) -> tuple[list[str], float]:
    """A line of the table, and the time."""
    parts = max(1, runners // family.leaves)
    tree = (
        '<root BTCPP_format="4" main_tree_to_execute="Main">'
        f'<BehaviorTree ID="Main">{family.body(parts)}</BehaviorTree></root>\n'
    )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "tree.xml"
        file.write_text(tree, encoding="utf-8")
        command = (*GPSFSM, "check", "--isolated", "--format", "json", str(file))
        completed = run(command, timeout_s=TIMEOUT_S, cwd=Path(folder))
    leaves = f"{parts * family.leaves:,}"
    if completed.timed_out or completed.code not in (0, 1):
        return [family.name, leaves, "no answer", "", ""], completed.seconds
    facts: dict[str, Any] = json.loads(completed.out)["plans"][0]["facts"]
    right = (
        facts["runners"] == parts * family.leaves
        and facts["completes"] == facts["gives_up"] == "sometimes"
        and facts["fewest_failures_to_give_up"] == family.fewest(parts)
        and facts["unreachable"] == []
    )
    time = seconds(completed.seconds) if right else "WRONG ANSWER"
    rate = growth(completed.seconds, before)
    return [family.name, leaves, time, rate, f"{completed.peak_mb:.0f}"], completed.seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--largest", type=int, default=SIZES[-1])
    chosen = parser.parse_args()
    where = circumstances()
    rows: list[list[str]] = []
    for family in FAMILIES:
        before: float | None = None
        for runners in (size for size in SIZES if size <= chosen.largest):
            row, before = row_of(family, runners, before)
            rows.append(row)
    print(where)
    print()
    print(table(["tree", "leaves", "time, s", "growth", "peak memory, MB"], rows))


if __name__ == "__main__":
    main()
