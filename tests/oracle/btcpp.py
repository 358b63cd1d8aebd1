"""The real BehaviorTree.CPP (the wheel behaviortreepy) as a judge of trees.

A run of it is a row of events of leaves, tick by tick. ``follows`` plays this row in the automaton
of a tree: what a leaf has ended with is its outcome there, and choices and ticks are free. The
automaton follows if some of its runs starts and halts the same actions and ends the same.
"""

from __future__ import annotations

import random
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import pytest

import gpsfsm
from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.checking.machine_check import tied
from gpsfsm.compile.instants import COMPLETED, FAILED, GAVE_UP, GOING, SUCCEEDED, Instants
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.compile.tree_machine import machine_of_tree
from gpsfsm.model.capability import CHOICE, TICK
from gpsfsm.model.finding import Severity
from gpsfsm.model.report import Frequency, Verdict
from gpsfsm.syntax.source import DEFAULT_LIMITS
from gpsfsm.syntax.trees import read_trees
from tests.oracle.random_trees import RandomTree

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from gpsfsm.compile.instants import Configuration
    from gpsfsm.compile.units import MachinePlan
    from gpsfsm.model.report import PlanReport

Answer = Literal["SUCCESS", "FAILURE"]
MOST_CONFIGURATIONS = 20_000


class TooManyError(Exception):
    """The automaton has too many configurations for one row of events."""


def engine() -> Any:
    """The module; skips the test where it is not installed."""
    return pytest.importorskip("behaviortreepy", reason="the wheel behaviortreepy is not installed")


@dataclass
class Tick:
    """A tick: what has ended in it, in order, and which actions run after it."""

    ended: list[tuple[str, Answer]] = field(default_factory=list)
    running: set[str] = field(default_factory=set)


@dataclass
class Run:
    """A run of the engine; ``status`` is RUNNING where it was cut off."""

    ticks: list[Tick]
    status: str
    started: list[str]


def play(
    text: str | Path,
    leaves: Iterable[str],
    answer: Callable[[str, int], tuple[int, Answer]],
    *,
    most_ticks: int = 40,
    watch: Callable[[Any], Callable[[], None]] = lambda _: lambda: None,
) -> Run:
    """A run of a tree. ``answer``: for a leaf and its visit, how many ticks it runs, and its end.

    ``watch`` gets the tree, and returns what is to be called after each tick.
    The tree is a text, or the absolute path of a file, which may include others. Raises
    RuntimeError as the engine does where it does not load the tree, or while it ticks.
    """
    module = engine()
    status = module.NodeStatus
    factory = module.BehaviorTreeFactory()
    visits: dict[str, int] = {}
    left: dict[str, tuple[int, Answer]] = {}
    ticks: list[Tick] = []
    started: list[str] = []

    def end(name: str, outcome: Answer) -> Any:
        ticks[-1].ended.append((name, outcome))
        left.pop(name, None)
        return status.SUCCESS if outcome == "SUCCESS" else status.FAILURE

    def begin(name: str) -> Any:
        visits[name] = visits.get(name, 0) + 1
        started.append(name)
        runs, outcome = answer(name, visits[name])
        if runs == 0:
            return end(name, outcome)
        left[name] = runs, outcome
        return status.RUNNING

    def go_on(name: str) -> Any:
        runs, outcome = left[name]
        if runs <= 1:
            return end(name, outcome)
        left[name] = runs - 1, outcome
        return status.RUNNING

    def ask(name: str) -> Any:
        visits[name] = visits.get(name, 0) + 1
        return end(name, answer(name, visits[name])[1])

    for leaf in leaves:
        if leaf.startswith("C"):
            factory.register_simple_condition(leaf, lambda _, name=leaf: ask(name))
        else:
            factory.register_simple_stateful_action(
                leaf,
                lambda _, name=leaf: begin(name),
                lambda _, name=leaf: go_on(name),
                lambda _, name=leaf: left.pop(name, None),
            )
    from_file = factory.create_tree_from_file
    tree = factory.create_tree_from_text(text) if isinstance(text, str) else from_file(str(text))
    after_tick = watch(tree)
    result = status.RUNNING
    while result == status.RUNNING and len(ticks) < most_ticks:
        ticks.append(Tick())
        result = tree.tick_exactly_once()
        ticks[-1].running = set(left)
        after_tick()
    tree.halt_tree()
    if ticks and result != status.RUNNING:
        ticks[-1].running = set()
    return Run(ticks, re.sub(r".*\.", "", str(result)), started)


class Follower:
    """The configurations of a machine in which it can be after what has happened."""

    def __init__(self, machine: MachinePlan, *, exact: bool, consistent: bool = False) -> None:
        _, ties = tied(machine.automaton, constraints_of(machine, consistent=consistent))
        self.instants = Instants(machine.automaton, ties)
        self.exact = exact
        names = [runner.interface for runner in machine.runners]
        self.names = names
        self.own = [number for number, name in enumerate(names) if name in (CHOICE, TICK)]
        self.ticks = {number for number in self.own if names[number] == TICK}
        self.actions = [number for number, name in enumerate(names) if name.startswith("A")]
        self.here = self._closed({self.instants.first().configuration})

    def _closed(self, begin: Iterable[Configuration]) -> set[Configuration]:
        """With all that choices and ticks may lead to."""
        reached = set(begin)
        pending = list(reached)
        while pending:
            at = pending.pop()
            for number in self.own:
                if not at.active >> number & 1:
                    continue
                for outcome in (SUCCEEDED,) if number in self.ticks else (SUCCEEDED, FAILED):
                    if self.instants.fixed(at, number) not in (None, outcome):
                        continue
                    after = self.instants.after(at, number, outcome).configuration
                    if after not in reached:
                        reached.add(after)
                        pending.append(after)
            if len(reached) > MOST_CONFIGURATIONS:
                raise TooManyError
        return reached

    def end(self, name: str, answer: Answer) -> None:
        """A leaf has ended."""
        outcome = SUCCEEDED if answer == "SUCCESS" else FAILED
        self.here = self._closed(self.here)
        after = {
            self.instants.after(at, number, outcome).configuration
            for at in self.here
            if at.ended == GOING
            for number, each in enumerate(self.names)
            if each == name and at.active >> number & 1
            if self.instants.fixed(at, number) in (None, outcome)
        }
        self.here = self._closed(after)

    def running(self, names: set[str]) -> None:
        """These actions run, and no others.

        Where none does, a node has answered RUNNING between two of its children. The machine may
        be ahead then, if nothing beside that node can halt it before.
        """
        kept = set()
        self.here = self._closed(self.here)
        for at in self.here:
            active = {self.names[each] for each in self.actions if at.active >> each & 1}
            same = not names or (active == names and at.ended == GOING)
            if same or (not self.exact and at.ended == GOING and active >= names):
                kept.add(at)
        self.here = kept

    def ended(self, status: str) -> bool:
        """The machine can have ended so."""
        end = COMPLETED if status == "SUCCESS" else GAVE_UP
        return any(at.ended == end for at in self._closed(self.here))


def follows(run: Run, machine: MachinePlan, *, exact: bool, consistent: bool = False) -> str:
    """Nothing if some run of the machine is that of the engine; else where they part."""
    follower = Follower(machine, exact=exact, consistent=consistent)
    for number, tick in enumerate(run.ticks):
        for name, answer in tick.ended:
            follower.end(name, answer)
            if not follower.here:
                return f"tick {number}: {name} does not run, or {answer} ends the machine before"
        if number + 1 < len(run.ticks) or run.status == "RUNNING":
            follower.running(tick.running)
            if not follower.here:
                return f"tick {number}: other actions than {sorted(tick.running)} run"
    if run.status != "RUNNING" and not follower.ended(run.status):
        return f"the machine does not end as the tree does: {run.status}"
    return ""


def disagreement(seed: int, *, runs: int = 6, consistent: bool = False) -> tuple[str, list[str]]:
    """Where the engine and gpsfsm part about a random tree, "" if nowhere; labels of what came.

    With ``consistent`` a leaf always ends the same, and conditions read what scripts write.
    """
    tree = RandomTree(random.Random(seed), keys=consistent)  # noqa: S311  (no secrets here)
    return compared(
        tree.text,
        seed,
        runs,
        lambda _, answer: play(tree.text, tree.leaves, answer),
        consistent=consistent,
    )


def compared(
    text: str,
    seed: int,
    runs: int,
    plays: Callable[[random.Random, Callable[[str, int], tuple[int, Answer]]], Run],
    *,
    consistent: bool = False,
) -> tuple[str, list[str]]:
    """Where an engine and gpsfsm part about a tree, "" if nowhere; labels of what came.

    Of facts, ``never`` and ``always`` are held against the engine, and what is never started. No
    tree is ever stuck.
    """
    forest = read_trees(text, "tree.xml", DEFAULT_LIMITS).forest
    machine = None if forest is None else machine_of_tree(forest)
    if machine is None:
        return "there is no machine", []
    (report,) = gpsfsm.check(text, consistent=consistent).plans
    labels = ["exact" if not machine.approximations else "approximated", report.verdict.value]
    if report.verdict is Verdict.REJECTED:
        labels += sorted({each.rule for each in report.findings if each.severity is Severity.ERROR})
    if report.facts is not None and report.facts.stuck is not Frequency.NEVER:
        return f"it is stuck\n{text}", labels
    for number in range(runs):
        chance = random.Random(seed * 1_000 + number)  # noqa: S311
        share = chance.choice((0.2, 0.5, 0.8))
        ends: dict[str, Answer] = {}

        def answer(
            name: str,
            _visit: int,
            chance: random.Random = chance,
            share: float = share,
            ends: dict[str, Answer] = ends,
        ) -> tuple[int, Answer]:
            runs = chance.choice((0, 1, 1, 2, 3))
            drawn: Answer = "SUCCESS" if chance.random() < share else "FAILURE"
            return runs, ends.setdefault(name, drawn) if consistent else drawn

        try:
            run = plays(chance, answer)
        except RuntimeError:  # IfThenElse and WhileDoElse throw where a child is skipped
            return "", [*labels, "the engine throws"]
        labels.append(run.status)
        try:
            exact = not machine.approximations
            parted = follows(run, machine, exact=exact, consistent=consistent)
        except TooManyError:
            labels.append("too many configurations")
            parted = ""
        parted = parted or against_facts(run, report, text)
        if parted:
            return f"{parted}\n{text}", labels
    return "", labels


def against_facts(run: Run, report: PlanReport, text: str) -> str:
    """What the facts rule out, and the engine does."""
    facts, plan = report.facts, read_plan(text).plan
    if facts is None or plan is None:
        return ""
    completes, gives_up = facts.completes.value, facts.gives_up.value
    if run.status == "SUCCESS" and (completes == "never" or gives_up == "always"):
        return "the tree succeeds, which it never does"
    if run.status in ("FAILURE", "SKIPPED") and (gives_up == "never" or completes == "always"):
        return "the tree fails, which it never does"
    uses: dict[str, list[str]] = {}
    for element in plan.runners:
        uses.setdefault(element.interface, []).append(plan.path(element))
    for name in set(run.started):
        started = [path for path in uses[name] if path not in facts.unreachable]
        if not started or (facts.machine is not None and len(started) < len(uses[name])):
            return f"{name} starts, which it never does"
    return ""
