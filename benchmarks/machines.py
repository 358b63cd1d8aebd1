"""Ways to prove what a machine never does: z3 on what was explored, or z3's fixed points.

Prints a table: machines of runners in loops beside each other, and random ones of six runners. The
proof of an exploration (``analysis/machines/proof.py``) is one question; it is put to several of
z3's solvers. Spacer gets two: which configurations are never reached, and whether a run goes on
for ever. CPU time of this process, the middle of three.
"""

from __future__ import annotations

import time
from statistics import median
from typing import TYPE_CHECKING, Any

import z3
from hypothesis import HealthCheck, Phase, given, seed, settings

from benchmarks.common import table
from gpsfsm.analysis.machines.decide import Judge
from gpsfsm.analysis.machines.proof import Completeness, Formulas
from gpsfsm.analysis.machines.search import Exploration
from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.checking.machine_check import never
from tests.analysis.machines.fixpoint import Fixpoint
from tests.analysis.machines.random_machines import PLAIN, automaton_of, machine, machines

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.model.automaton import Automaton

LOOPS = (1, 2, 3, 4)
RANDOM = (10, 50, 100, 200)
"""Configurations of the random machines: the first one with at least so many."""
SPACER_STEPS = 20_000_000
SOLVERS: dict[str, Callable[[], Any]] = {
    "QF_FD": lambda: z3.SolverFor("QF_FD"),
    "QF_UF": lambda: z3.SolverFor("QF_UF"),
    "default": z3.Solver,
}


def loops(number: int) -> Automaton:
    """A machine of so many pairs that are tried until they succeed, and a join of all."""
    lines = ["all SUCCEEDED end"]
    for each in range(number):
        lines += [f"start SUCCEEDED a{each}", f"a{each} FAILED b{each}"]
        lines += [f"b{each} SUCCEEDED a{each}", f"a{each} SUCCEEDED all"]
    return automaton_of(machine(*lines, all=number))


def random_ones() -> list[Automaton]:
    """Random machines of six runners, of several sizes."""
    chosen: dict[int, Automaton] = {}

    @seed(1)
    @settings(
        max_examples=400,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(machines(most_runners=6))
    def draw(graph: Any) -> None:
        automaton = automaton_of(graph)
        if len(automaton.runners) == 6 and len(chosen) < len(RANDOM):
            try:
                size = Exploration(automaton, [PLAIN] * 6, limit=2 * RANDOM[-1]).reached
            except InconclusiveError:
                return
            for least in RANDOM:
                if least <= size < 2 * least:
                    chosen.setdefault(least, automaton)

    draw()
    return [chosen[least] for least in sorted(chosen)]


def milliseconds(work: Callable[[], object]) -> str:
    """The time that the work takes; "over the limit" if z3 gives up."""
    times = []
    for _ in range(3):
        begin = time.process_time()
        try:
            work()
        except InconclusiveError:
            return "over the limit"
        times.append(1000 * (time.process_time() - begin))
    return f"{median(times):,.1f}"


def row(name: str, automaton: Automaton) -> list[str]:
    """All times about one machine."""
    allowed = [PLAIN] * len(automaton.runners)
    exploration = Exploration(automaton, allowed)
    answers = Judge(exploration).facts()
    formulas = Formulas(automaton, allowed)
    claims = list(never(answers, formulas))
    text = Completeness(exploration, formulas).text(claims)
    cells = [name, f"{exploration.reached:,}"]
    cells.append(milliseconds(lambda: Judge(Exploration(automaton, allowed)).facts()))
    for make in SOLVERS.values():

        def prove(make: Callable[[], Any] = make) -> None:
            Completeness(exploration, Formulas(automaton, allowed)).text(claims)
            solver = make()
            solver.from_string(text)
            assert solver.check() == z3.unsat

        cells.append(milliseconds(prove))
    spacer = Fixpoint(automaton, allowed, rlimit=SPACER_STEPS)
    cells.append(milliseconds(lambda: spacer.ever(claims)) if claims else "nothing to refute")
    cells.append(milliseconds(spacer.endless))
    return cells


def main() -> None:
    """Print the table."""
    head = ("machine", "configurations", "search, ms")
    head += tuple(f"its proof, {name}" for name in SOLVERS)
    rows = [row(f"{number} in loops", loops(number)) for number in LOOPS]
    rows += [row("random, 6 runners", each) for each in random_ones()]
    print(table((*head, "Spacer: never reached", "Spacer: runs for ever"), rows))


if __name__ == "__main__":
    main()
