"""Do SPIN and NuSMV agree with gpsfsm about random plans?

``python -m benchmarks.other_tools.agree --plans 20 --runners 5`` puts to both tools, in both ways
of writing models, whether each plan can complete, can fail to, can give up, and whether each of its
joins can wait for ever. Every second plan has some runner instances that never fail. A difference
ends with exit code 1 and leaves the model where it says.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING

import gpsfsm
from benchmarks.other_tools import tools
from benchmarks.other_tools.promela import promela_of
from benchmarks.other_tools.questions import (
    CanMiss,
    Question,
    Style,
    completes,
    gives_up,
    join_waits,
)
from benchmarks.other_tools.smv import smv_of
from corpus import generate

if TYPE_CHECKING:
    from collections.abc import Iterator, Set

    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.report import Facts

TIMEOUT_S = 120.0
STYLES: tuple[Style, ...] = ("natural", "expert")


def questions(automaton: Automaton, facts: Facts) -> Iterator[tuple[Question, bool]]:
    """The questions about a plan, each with what gpsfsm says."""
    yield completes(automaton), facts.completes != "never"
    yield CanMiss(automaton.complete), facts.completes != "always"
    yield gives_up(automaton), facts.gives_up != "never"
    waiting = {join_deadlock.control for join_deadlock in facts.join_deadlocks}
    for number, block in enumerate(automaton.blocks):
        if block.trigger is not None:
            yield join_waits(automaton, number), automaton.plan.path(block.element) in waiting


def answers(
    automaton: Automaton, question: Question, never_fails: Set[int], style: Style, folder: Path
) -> dict[str, tools.Answer]:
    """What the tools that are here say."""
    misses = isinstance(question, CanMiss)
    here = tools.versions()
    results: dict[str, tools.Answer] = {}
    if "spin" in here:
        file = folder / "model.pml"
        text = promela_of(automaton, question, style=style, never_fails=never_fails)
        file.write_text(text, encoding="utf-8")
        size = len(automaton.nodes)
        results["SPIN"] = tools.spin(file, size=size, misses=misses, timeout_s=TIMEOUT_S)
    if "nusmv" in here:
        file = folder / "model.smv"
        text = smv_of(automaton, question, style=style, never_fails=never_fails)
        file.write_text(text, encoding="utf-8")
        results["NuSMV"] = tools.nusmv(file, misses=misses, timeout_s=TIMEOUT_S)
    return results


def compare(seed: int, runners: int, counts: Counter[str]) -> None:
    """Put all questions about one plan to all tools."""
    text = generate.random(seed, runners)
    plan = gpsfsm.parse(text).plan
    assert plan is not None
    automaton = gpsfsm.compile_plan(plan).automaton
    rng = Random(seed)  # noqa: S311  (reproducible, not secret)
    share = 0.6 if seed % 2 else 0.0
    spared = frozenset(node.index for node in automaton.runners if rng.random() < share)
    assume = [f"never fails: {automaton.name(node)}" for node in sorted(spared)]
    facts = gpsfsm.check(text, assume=assume).plans[0].facts
    assert facts is not None
    for question, expected in questions(automaton, facts):
        for style in STYLES:
            folder = Path(tempfile.mkdtemp())
            for name, answer in answers(automaton, question, spared, style, folder).items():
                if answer.possible is None:
                    counts["no verdict"] += 1
                elif answer.possible is expected:
                    counts["yes" if expected else "no"] += 1
                else:
                    raise SystemExit(
                        f"seed {seed}: {name} says {answer.possible} to {question}, gpsfsm says "
                        f"{expected}; {style} model in {folder}"
                    )
            for file in folder.iterdir():
                file.unlink()
            folder.rmdir()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plans", type=int, default=20)
    parser.add_argument("--runners", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0, help="of the first plan")
    chosen = parser.parse_args()
    if not tools.versions().keys() & {"spin", "nusmv"}:
        print("Nothing compared: neither SPIN nor NuSMV is installed.", file=sys.stderr)
        raise SystemExit(2)
    counts: Counter[str] = Counter()
    for seed in range(chosen.seed, chosen.seed + chosen.plans):
        compare(seed, chosen.runners, counts)
    print(f"{chosen.plans} plans, agreed answers: {counts['yes']} yes, {counts['no']} no;", end=" ")
    print(f"no verdict: {counts['no verdict']}")


if __name__ == "__main__":
    main()
