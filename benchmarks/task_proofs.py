"""Which encoding and which solver of z3 prove that a plan keeps its task, and at what cost?

The plans are right ones of 10 to 10,000 steps, one after the other. Every encoding says that some
run of the plan does not do the steps in order, and z3 has to refute it. Measured are the text, and
for each solver the time of the processor to make it, to read the text and to check, the best of
three.

- ``states``: what gpsfsm asks. The state of the task goes along the automaton, so that unit
  propagation refutes it.
- ``states, if triggered``: the same, but a state is said of a node only if it is triggered. It is
  as right, but nothing can be concluded from the start on.
- ``cuts``: the moments at which the state changes, each with all that has begun and ended by then;
  what gpsfsm asks about plans of which the first one says nothing.
- ``held back``: for each step a second run of the plan in which it never ends; none of the later
  steps may be triggered in it.
- ``before``: a Boolean for each pair of steps, one is over before the other begins, and that this
  is transitive.
- ``time stamps``: an integer for each start and each outcome.

The last three leave out how runs end, and all but the first two the alternatives of steps.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from itertools import combinations, pairwise
from typing import TYPE_CHECKING, Any

import z3

from benchmarks.common import circumstances, table
from benchmarks.grading import NAME, long_right
from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.analysis.encode import FALSE, Encoding, conjunction, disjunction, symbols_of
from gpsfsm.compile import compile_plan
from gpsfsm.model.automaton import Signal
from gpsfsm.model.event import Event
from gpsfsm.syntax import parse
from gpsfsm.tasks.machine import machine_of
from gpsfsm.tasks.monitor import Matching
from gpsfsm.tasks.proof import problem_text
from gpsfsm.tasks.steps import StepsMonitor
from gpsfsm.tasks.task import Pattern, Step, Task
from gpsfsm.tasks.violation_encoding import Slots

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.compile import Compiled

SOLVERS: dict[str, Callable[[], Any]] = {
    "Solver()": z3.Solver,
    "SimpleSolver()": z3.SimpleSolver,
    "QF_FD": lambda: z3.SolverFor("QF_FD"),
    "QF_UF": lambda: z3.SolverFor("QF_UF"),
    "tactic sat": lambda: z3.Then("simplify", "propagate-values", "sat").solver(),
}
INTEGERS: dict[str, Callable[[], Any]] = {
    "Solver()": z3.Solver,
    "SimpleSolver()": z3.SimpleSolver,
    "QF_IDL": lambda: z3.SolverFor("QF_IDL"),
}
TIMEOUT_S = 20


def task_of(size: int) -> Task:
    """To drive to places in order; more of them than a task file may hold."""
    patterns = (Pattern(f"p{at}", (NAME,), (("x", at), ("y", 0.5))) for at in range(size))
    return Task(steps=tuple(Step((pattern,)) for pattern in patterns))


class Problem:
    """A right plan, and its task."""

    def __init__(self, size: int) -> None:
        _, text, _ = long_right(size)
        plan = parse(text).plan
        assert plan is not None
        self.size = size
        self.compiled: Compiled = compile_plan(plan)
        self.constraints: Constraints = constraints_of(plan)
        self.encoding = Encoding(self.compiled.automaton, self.constraints)
        matching = Matching(plan.runners, self.compiled.bindings)
        self.demand = StepsMonitor(task_of(size), matching)

    def run(self) -> list[str]:
        """The scenarios, and their runs."""
        return [*self.encoding.scenarios(), *self.encoding.definitions()]

    def triggered(self, number: int) -> str:
        """The instance is triggered."""
        return self.encoding.triggered(number + 1)


def states(problem: Problem) -> str:
    return problem_text(problem.compiled, problem.constraints, [problem.demand])[1]


def states_if_triggered(problem: Problem) -> str:
    single = re.compile(r"\(=> (m\d+_\d+) (m(\d+)_\d+)\)")
    several = re.compile(r"\(assert \(=> \(and (m\d+_\d+ ?)+\) m\d+_\d+\)\)\n")
    return several.sub("", single.sub(r"(=> (and t\3 \1) \2)", states(problem)))


def cuts(case: Problem) -> str:
    machine = machine_of(case.demand, case.constraints)
    assert machine.depth is not None
    slots = Slots(case.compiled.automaton, case.constraints, machine, machine.depth)
    return problem([*slots.problem(), disjunction(slots.keys.values())])


def held_back(case: Problem) -> str:
    lines, wrong = case.run(), []
    for number in range(case.size - 1):
        node = case.compiled.automaton.runner_node(number)
        changed = {Signal(node, event): FALSE for event in (Event.SUCCEEDED, Event.FAILED)}
        variant = case.encoding.variant(changed)
        lines += variant.definitions
        wrong.append(variant.triggered(case.compiled.automaton.runner_node(number + 1)))
    return problem([*lines, disjunction(wrong)])


def before(case: Problem) -> str:
    lines = case.run()
    for one, other in pairwise(range(case.size)):
        lines.append(f"(=> {case.triggered(other)} (and s{one} b{one}_{other}))")
    for one, other, third in combinations(range(case.size), 3):
        lines.append(f"(=> (and b{one}_{other} b{other}_{third}) b{one}_{third})")
    pairs = combinations(range(case.size), 2)
    wrong = [f"(and {case.triggered(other)} (not b{one}_{other}))" for one, other in pairs]
    return problem([*lines, disjunction(wrong)])


def time_stamps(case: Problem) -> str:
    lines = [*case.run(), *(f"(< c{one} e{one})" for one in range(case.size))]
    wrong = []
    for one, other in pairwise(range(case.size)):
        lines.append(f"(=> {case.triggered(other)} (= c{other} e{one}))")
        right = conjunction((case.triggered(one), f"s{one}", f"(<= e{one} c{other})"))
        wrong.append(conjunction((case.triggered(other), f"(not {right})")))
    wrong.append(f"(and {case.triggered(case.size - 1)} (< e{case.size - 1} e0))")
    return problem([*lines, disjunction(wrong)])


def problem(lines: list[str]) -> str:
    text = "\n".join(f"(assert {line})" for line in lines)
    sorts = {"c": "Int", "e": "Int"}
    integers = "(< c0 e0)" in text
    declared = "".join(
        f"(declare-const {name} {sorts.get(name[0], 'Bool') if integers else 'Bool'})"
        for name in symbols_of(text)
    )
    return f"{declared}\n{text}"


ENCODINGS: dict[str, tuple[Callable[[Problem], str], int]] = {
    "states": (states, 10_000),
    "states, if triggered": (states_if_triggered, 1_000),
    "cuts": (cuts, 10),
    "held back": (held_back, 100),
    "before": (before, 100),
    "time stamps": (time_stamps, 1_000),
}
"""Each with the greatest plan that it is tried on: above that the text has 10 MB and more."""


def refuted(make: Callable[[], Any], text: str, times: int) -> tuple[float, float, float]:
    """Milliseconds to make a solver, to read the text, and to check; the best of some."""
    best = (0.0, 0.0, 1e9)
    for _ in range(times):
        moments = [time.process_time()]
        solver = make()
        moments.append(time.process_time())
        solver.from_string(text)
        solver.set("timeout", 1000 * TIMEOUT_S)
        moments.append(time.process_time())
        answer = solver.check()
        moments.append(time.process_time())
        if answer == z3.sat:
            raise SystemExit("a plan that keeps its task is said to leave it")
        if answer == z3.unknown:
            continue
        steps = [1000 * (after - earlier) for earlier, after in pairwise(moments)]
        best = min(best, (steps[0], steps[1], steps[2]), key=sum)
    return best


def row(
    name: str, size: int, text: str, solver: str, took: tuple[float, float, float]
) -> list[str]:
    start = [name, f"{size:,}", f"{len(text) / 1000:,.0f}", solver]
    if sum(took) > 1000 * TIMEOUT_S:
        return [*start, "", "", "", f"over {1000 * TIMEOUT_S:,}"]
    return [*start, *(f"{one:,.1f}" for one in (*took, sum(took)))]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--largest", type=int, default=10_000)
    largest = parser.parse_args().largest
    where = circumstances()
    z3.Solver().check()  # its own start is not what is asked here
    rows = []
    for size in (10, 100, 1_000, 10_000):
        if size > largest:
            break
        request = Problem(size)
        for name, (encoding, most) in ENCODINGS.items():
            if size > most:
                continue
            text = encoding(request)
            for solver, make in (INTEGERS if name == "time stamps" else SOLVERS).items():
                took = refuted(make, text, 3 if size < 100 else 1)
                rows.append(row(name, size, text, solver, took))
                print(*rows[-1], sep=" | ", file=sys.stderr, flush=True)
    head = ["encoding", "steps", "text, kB", "solver", "made, ms", "read, ms", "checked, ms", "all"]
    print(where)
    print()
    print(table(head, rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
