"""What does the proof of every plan cost, and which encoding is it that z3 refutes fastest?

The first table compares checks with the last commit that asked z3 up to 154 questions about a plan
of up to 200 runners and none about larger ones; processes of both take turns. The second has the
time to read and to refute one problem, the least of three, with 20 million steps at most:

- ``equations``: the ends alone, in the equations that z3 gets where it decides by itself;
- ``whole``: all that never happens, in one problem (``analysis/proof/refutation.py``);
- ``by units``: the same for large plans (``analysis/proof/parts.py``).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.common import ROOT, circumstances, table, write_plan
from benchmarks.graph import WARM, checkout, command_of, in_turn, medians

if TYPE_CHECKING:
    from collections.abc import Callable

LARGE: tuple[tuple[str, tuple[object, ...]], ...] = (
    ("chain", (5_000,)),
    ("nested", (4, 10)),
    ("fanout", (5_000, "--variant", "safe")),
)
PROBLEMS: tuple[tuple[str, tuple[object, ...]], ...] = (
    ("chain", (5,)),
    ("chain", (50,)),
    ("chain", (500,)),
    ("chain", (5_000,)),
    ("nested", (1, 10)),
    ("nested", (3, 10)),
    ("nested", (4, 10)),
    ("fanout", (5_000, "--variant", "safe")),
)
STEPS = 20_000_000


def problems_of(text: str) -> dict[str, str]:
    """The problems for z3 about a plan, by encoding."""
    from gpsfsm.analysis.constraints import constraints_of
    from gpsfsm.analysis.decide import Deciders
    from gpsfsm.analysis.decisions import analyses
    from gpsfsm.analysis.encode import Encoding, conjunction, disjunction, symbols_of
    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.analysis.proof.parts import Parts
    from gpsfsm.analysis.proof.refutation import Refutation
    from gpsfsm.compile import compile_plan
    from gpsfsm.model.event import End
    from gpsfsm.syntax import parse

    plan = parse(text).plan
    assert plan is not None
    compiled, constraints = compile_plan(plan), constraints_of(plan)
    structure = Deciders(compiled, constraints, AnalysisOptions()).structure
    assert structure is not None
    encoding = Encoding(compiled.automaton, constraints)
    ends = encoding.ending(End.COMPLETED), encoding.ending(End.GAVE_UP)
    wrong = disjunction((encoding.ending(End.STUCK), conjunction(ends)))
    equations = [*encoding.scenarios(), *encoding.definitions(), wrong]
    lines = "\n".join(f"(assert {each})" for each in equations)
    declared = "".join(f"(declare-const {name} Bool)" for name in symbols_of(lines))
    whole, by_units = Refutation(structure), Refutation(structure)
    answers = {each.name: each.by_structure(structure) for each in analyses()}
    for each in analyses():
        if each.refute is not None:
            each.refute(answers[each.name], whole)
    Parts(structure, answers["completion"], answers["fewest"]).hand_in(by_units)
    return {"equations": declared + lines, "whole": whole.text(), "by units": by_units.text()}


def refuted(text: str, make: Callable[[], Any]) -> str:
    """The milliseconds that a solver needs to read and to refute a problem."""
    import z3

    best = float("inf")
    for _ in range(3):
        solver = make()
        solver.set("rlimit", STEPS)
        started = time.perf_counter()
        solver.from_string(text)
        answer = solver.check()
        best = min(best, time.perf_counter() - started)
        if answer != z3.unsat:
            return "over the limit"
        if best > 1:
            break
    return f"{1000 * best:,.1f}"


def encodings(folder: Path) -> list[list[str]]:
    import z3

    rows = []
    for family, arguments in PROBLEMS:
        file = folder / "problem.xml"
        write_plan(file, family, *arguments)
        text = file.read_text()
        problems = problems_of(text)
        row = [family, f"{text.count('<Runner'):,}"]
        for name in ("equations", "whole", "by units"):
            for make in (z3.Solver, lambda: z3.SolverFor("QF_FD")):
                row.append(refuted(problems[name], make))
        rows.append(row)
    return rows


def checks(folder: Path, rounds: int) -> list[list[str]]:
    roots = (folder, ROOT)
    plan = folder / "plan.xml"
    rows = []
    for family, arguments in (("chain", (5,)), ("nested", (1, 10)), ("chain", (50,))):
        write_plan(plan, family, *arguments)
        commands = [(sys.executable, "-c", WARM, str(root), str(plan), "auto") for root in roots]
        before, now = medians(in_turn(commands, rounds), lambda done: float(done.out))
        name = f"warm, {family}, {plan.read_text().count('<Runner')} runners, ms"
        rows.append([name, f"{before:.2f}", f"{now:.2f}", f"{now / before:.2f}"])
    for family, arguments in LARGE:
        write_plan(plan, family, *arguments)
        options = ("check", "--isolated", "--format", "json", str(plan))
        commands = [(*command_of(root), *options) for root in roots]
        before, now = medians(in_turn(commands, 2), lambda done: done.seconds)
        name = f"the command, {family}, {plan.read_text().count('<Runner'):,} runners, s"
        rows.append([name, f"{before:.2f}", f"{now:.2f}", f"{now / before:.2f}"])
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    chosen = parser.parse_args()
    where = circumstances()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        checkout(folder)
        print(where)
        print()
        head = ["check", "before", "now, with the proof", "ratio"]
        print(table(head, checks(folder, chosen.rounds)))
        print()
        print("Milliseconds to read and to refute one problem:")
        print()
        columns = [
            f"{name}, `{solver}`"
            for name in ("equations", "whole", "by units")
            for solver in ("Solver()", "QF_FD")
        ]
        print(table(["family", "runners", *columns], encodings(folder)))


if __name__ == "__main__":
    main()
