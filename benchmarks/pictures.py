"""Time to lay out and to draw automata of up to 10,000 runners, without reading and compiling.

Every figure is the shortest of several rounds in one process, as processor time; what was drawn is
counted.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from benchmarks.common import circumstances, table
from gpsfsm.compile import compile_plan
from gpsfsm.picture import automaton_to_svg, layout
from gpsfsm.syntax import parse

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Automaton

SIZES = (100, 1_000, 10_000)
ROUNDS = 3
RUNNER = '<Runner interface="nav/WaypointRunner" provider="nav/Nav" x="1.5" y="2"/>'
Result = TypeVar("Result")


def _mixed(runners: int) -> str:
    """Ten runners in a sequence, a parallel_all, a recovery and a parallel_any, again and again."""
    part = (
        RUNNER * 3
        + f'<Control type="recovery">{RUNNER * 2}</Control>'
        + f'<Control type="parallel_all">{RUNNER * 3}</Control>'
        + f'<Control type="parallel_any">{RUNNER * 2}</Control>'
    )
    return part * (runners // 10)


def _nested(runners: int) -> str:
    """Sequences inside each other, a hundred deep, ten runners in each."""
    inner = ""
    for _ in range(min(100, runners // 10)):
        inner = f'<Control type="sequential">{RUNNER * 10}{inner}</Control>'
    return inner * max(1, runners // 1_000)


FAMILIES: dict[str, Callable[[int], str]] = {
    "one sequence": lambda runners: RUNNER * runners,
    "all kinds of controls": _mixed,
    "nested sequences": _nested,
}


def automaton_of(body: str) -> Automaton:
    plan = parse(f"<Plan>{body}</Plan>").plan
    assert plan is not None
    automaton = compile_plan(plan).automaton
    assert automaton.inputs
    assert automaton.outputs
    return automaton


def measured(work: Callable[[], Result]) -> tuple[float, Result]:
    """The shortest time of several, and the result."""
    best, result = float("inf"), None
    for _ in range(ROUNDS):
        before = time.process_time()
        result = work()
        best = min(best, time.process_time() - before)
    assert result is not None
    return best, result


def row_of(name: str, runners: int) -> list[str]:
    automaton = automaton_of(FAMILIES[name](runners))
    laying, arranged = measured(lambda: layout(automaton))
    drawing, svg = measured(lambda: automaton_to_svg(automaton))
    drawn = svg.count('<g class="runner">')
    if drawn != runners or len(arranged.nodes) != len(automaton.nodes):
        return [name, f"{runners:,}", "WRONG PICTURE", "", "", ""]
    width, height = arranged.size
    return [
        name,
        f"{runners:,}",
        f"{laying * 1_000:,.0f}",
        f"{drawing * 1_000:,.0f}",
        f"{len(svg) / 1_000:,.0f}",
        f"{width:,.0f} by {height:,.0f}",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--largest", type=int, default=SIZES[-1])
    chosen = parser.parse_args()
    where = circumstances()
    rows = [row_of(name, size) for name in FAMILIES for size in SIZES if size <= chosen.largest]
    print(where)
    print()
    print(table(["plan", "runners", "layout, ms", "with SVG, ms", "SVG, kB", "size, px"], rows))


if __name__ == "__main__":
    main()
