"""Trees that are ticked: Nav2's nodes and TryCatch, written from their documentation.

The wheel with BehaviorTree.CPP lacks these. The interpreter shares nothing with the compiler: it
reads the XML by itself, ticks from the root, and halts. What a clock or a goal of the robot decides
is drawn. Its runs have the form of those of the real engine (``btcpp.Run``), so the same judge
follows them.
"""

from __future__ import annotations

import random
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET  # our own texts, so no defence is needed

from tests.oracle.btcpp import Run, Tick, compared

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.oracle.btcpp import Answer

IDLE, RUNNING, SUCCESS, FAILURE = "IDLE", "RUNNING", "SUCCESS", "FAILURE"
CONTROLS = ("Sequence", "Fallback", "PipelineSequence", "RecoveryNode", "RoundRobin")
MORE = ("NonblockingSequence", "TryCatch", "ReactiveSequence")
DECORATORS = ("RateController", "GoalUpdater", "PathLongerOnApproach", "SingleTrigger", "Inverter")


class Node:
    """A node that is ticked and halted. ``status`` is what it has answered last."""

    def __init__(self, element: ET.Element, world: World) -> None:
        self.world, self.name, self.ports = world, element.tag, element.attrib
        self.children = [Node(child, world) for child in element]
        self.status = IDLE
        self.at, self.count, self.first = 0, 0, True

    def tick(self) -> str:
        if not self.children:
            self.status = self.world.leaf(self.name, self.status)
            return self.status
        fresh = self.status != RUNNING
        self.status = getattr(self, f"_{self.name}")(fresh=fresh)
        return self.status

    def halt(self) -> None:
        """Halts what runs; what has ended is idle again, and a RoundRobin keeps its place."""
        if self.status == RUNNING and not self.children:
            self.world.left.pop(self.name, None)
        for child in self.children:
            child.halt()
        kept = self.name == "RoundRobin" and self.status != RUNNING
        if self.name in ("RoundRobin", "RecoveryNode", "PipelineSequence", "TryCatch") and not kept:
            self.at = self.count = 0
        if self.status == RUNNING and self.name in ("Sequence", "Fallback"):
            self.at = 0
        self.status = IDLE

    def _reset(self) -> None:
        """Halt all children."""
        for child in self.children:
            child.halt()

    def _row(self, on: str) -> str:
        while self.at < len(self.children):
            answer = self.children[self.at].tick()
            if answer == RUNNING:
                return RUNNING
            if answer != on:
                self._reset()
                self.at = 0
                return answer
            self.at += 1
        self._reset()
        self.at = 0
        return on

    def _Sequence(self, *, fresh: bool) -> str:  # noqa: N802
        self.at = 0 if fresh else self.at
        return self._row(SUCCESS)

    def _Fallback(self, *, fresh: bool) -> str:  # noqa: N802
        self.at = 0 if fresh else self.at
        return self._row(FAILURE)

    def _ReactiveSequence(self, *, fresh: bool) -> str:  # noqa: N802
        del fresh
        for child in self.children:
            answer = child.tick()
            if answer == RUNNING:
                for other in self.children:
                    if other is not child:
                        other.halt()
                return RUNNING
            if answer == FAILURE:
                self._reset()
                return FAILURE
        self._reset()
        return SUCCESS

    def _PipelineSequence(self, *, fresh: bool) -> str:  # noqa: N802
        del fresh
        for number, child in enumerate(self.children):
            answer = child.tick()
            if answer == FAILURE:
                self._reset()
                self.at = 0
                return FAILURE
            if answer == RUNNING and number >= self.at:
                self.at = number
                return RUNNING
        self._reset()
        self.at = 0
        return SUCCESS

    def _NonblockingSequence(self, *, fresh: bool) -> str:  # noqa: N802
        del fresh
        every = True
        for child in self.children:
            answer = child.tick()
            if answer == FAILURE:
                self._reset()
                return FAILURE
            every = every and answer == SUCCESS
        if every:
            self._reset()
            return SUCCESS
        return RUNNING

    def _RecoveryNode(self, *, fresh: bool) -> str:  # noqa: N802
        del fresh
        retries = int(self.ports.get("number_of_retries", "1"))
        while self.count <= retries:
            answer = self.children[self.at].tick()
            if answer == RUNNING:
                return RUNNING
            if self.at == 0 and answer == SUCCESS:
                self._end()
                return SUCCESS
            if self.at == 0 and self.count < retries:
                self.children[0].halt()
                self.at = 1
            elif self.at == 0 or answer == FAILURE:
                break
            else:
                self.children[1].halt()
                self.at, self.count = 0, self.count + 1
        self._end()
        return FAILURE

    def _end(self) -> None:
        self._reset()
        self.at = self.count = 0

    def _RoundRobin(self, *, fresh: bool) -> str:  # noqa: N802
        del fresh
        while self.count < len(self.children):
            answer = self.children[self.at].tick()
            if answer == RUNNING:
                return RUNNING
            self.at = (self.at + 1) % len(self.children)
            if answer == SUCCESS:
                self.count = 0
                self._reset()
                return SUCCESS
            self.count += 1
        self._end()
        return FAILURE

    def _TryCatch(self, *, fresh: bool) -> str:  # noqa: N802
        if fresh:
            self.at = self.count = 0
        while self.count == 0 and self.at < len(self.children) - 1:
            answer = self.children[self.at].tick()
            if answer == RUNNING:
                return RUNNING
            if answer == FAILURE:
                self._reset()
                self.count = 1
            self.at += 1
        if self.count == 0:
            self._end()
            return SUCCESS
        if self.children[-1].tick() == RUNNING:
            return RUNNING
        self._end()
        return FAILURE

    def _Inverter(self, *, fresh: bool) -> str:  # noqa: N802
        del fresh
        answer = self.children[0].tick()
        if answer == RUNNING:
            return RUNNING
        self._reset()
        return FAILURE if answer == SUCCESS else SUCCESS

    def _RateController(self, *, fresh: bool) -> str:  # noqa: N802
        """Ticks its child at first, while it runs, and when the time has come again."""
        del fresh
        self.first = self.first or self.status == IDLE
        if self.first or self.children[0].status == RUNNING or self.world.chance.random() < 0.4:
            self.first = False
            return self.children[0].tick()
        return RUNNING

    def _GoalUpdater(self, *, fresh: bool) -> str:  # noqa: N802
        del fresh
        return self.children[0].tick()

    def _PathLongerOnApproach(self, *, fresh: bool) -> str:  # noqa: N802
        del fresh
        if self.children[0].status == RUNNING or self.world.chance.random() < 0.5:
            return self.children[0].tick()
        return SUCCESS

    def _SingleTrigger(self, *, fresh: bool) -> str:  # noqa: N802
        self.first = self.first or self.status == IDLE
        del fresh
        if not self.first:
            return FAILURE
        answer = self.children[0].tick()
        self.first = answer == RUNNING
        return answer


class World:
    """What leaves do, and what is drawn."""

    def __init__(
        self, chance: random.Random, answer: Callable[[str, int], tuple[int, Answer]]
    ) -> None:
        self.chance, self.answer = chance, answer
        self.visits: dict[str, int] = {}
        self.left: dict[str, tuple[int, Answer]] = {}
        self.ticks: list[Tick] = []
        self.started: list[str] = []

    def leaf(self, name: str, status: str) -> str:
        """An action starts anew if it does not run; a condition answers at once."""
        if status != RUNNING or name.startswith("C"):
            self.visits[name] = self.visits.get(name, 0) + 1
            self.left[name] = self.answer(name, self.visits[name])
            if not name.startswith("C"):
                self.started.append(name)
            if self.left[name][0] > 0 and not name.startswith("C"):
                return RUNNING
        else:
            runs, outcome = self.left[name]
            if runs > 1:
                self.left[name] = runs - 1, outcome
                return RUNNING
        outcome = self.left.pop(name)[1]
        self.ticks[-1].ended.append((name, outcome))
        return outcome


def play(
    text: str,
    chance: random.Random,
    answer: Callable[[str, int], tuple[int, Answer]],
    *,
    most_ticks: int = 40,
) -> Run:
    """A run of a tree, in the form of those of the real engine."""
    root = ET.fromstring(text)  # noqa: S314
    world = World(chance, answer)
    top = Node(root.find("BehaviorTree")[0], world)  # type: ignore[index]
    status = RUNNING
    while status == RUNNING and len(world.ticks) < most_ticks:
        world.ticks.append(Tick())
        status = top.tick()
        world.ticks[-1].running = {name for name in world.left if not name.startswith("C")}
    if status != RUNNING:
        world.ticks[-1].running = set()
    return Run(world.ticks, status, world.started)


def disagreement(seed: int, *, runs: int = 6) -> tuple[str, list[str]]:
    """Where the interpreter and gpsfsm part about a random tree, and labels of what came."""
    text = random_tree(random.Random(seed))  # noqa: S311  (no secrets here)
    return compared(text, seed, runs, lambda chance, answer: play(text, chance, answer))


def random_tree(chance: random.Random, *, most: int = 6) -> str:
    """A tree over the nodes above, with leaves of names of their own."""
    names = {"A": 0, "C": 0}

    def node(depth: int) -> str:
        if depth > 3 or sum(names.values()) >= most or chance.random() < 0.2 * depth:
            kind = "C" if chance.random() < 0.25 else "A"
            names[kind] += 1
            return f"<{kind}{names[kind] - 1}/>"
        if chance.random() < 0.35:
            name = chance.choice(DECORATORS)
            return f"<{name}>{node(depth + 1)}</{name}>"
        name = chance.choice((*CONTROLS, *MORE))
        count = 2 if name == "RecoveryNode" else chance.randint(2, 3)
        ports = f' number_of_retries="{chance.randint(0, 2)}"' if name == "RecoveryNode" else ""
        return f"<{name}{ports}>{''.join(node(depth + 1) for _ in range(count))}</{name}>"

    body = node(0)
    models = "".join(
        f'<{"Condition" if kind == "C" else "Action"} ID="{kind}{number}"/>'
        for kind, count in names.items()
        for number in range(count)
    )
    return (
        '<root BTCPP_format="4" main_tree_to_execute="Main">\n<BehaviorTree ID="Main">\n'
        f"{body}\n</BehaviorTree>\n<TreeNodesModel>{models}</TreeNodesModel></root>\n"
    )
