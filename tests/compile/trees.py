"""Random behaviour trees, as XML and for two other engines: py_trees, and one of our own.

The engine below is written from the definition of the nodes of BehaviorTree.CPP: it ticks. It knows
nothing of automata.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from random import Random

Status = Literal["RUNNING", "SUCCESS", "FAILURE"]
Use = tuple[str, int]
"""A leaf, and which of its uses in the unfolded tree."""

PY_TREES = ("Sequence", "Fallback", "All", "Inverter", "ForceSuccess", "ForceFailure")
LOOPS = ("RetryUntilSuccessful", "Repeat")
ALL = (
    *PY_TREES,
    *LOOPS,
    "Parallel",
    "ParallelAll",
    "IfThenElse",
    "AlwaysSuccess",
    "AlwaysFailure",
    "SubTree",
)


@dataclass(frozen=True)
class T:
    """A node. ``number`` are rounds, or the successes that a Parallel or ParallelAll needs."""

    kind: str
    children: tuple[T, ...] = ()
    number: int = 0
    leaf: str = ""

    def leaves(self) -> Iterator[T]:
        if self.kind == "leaf":
            yield self
        for child in self.children:
            yield from child.leaves()

    def uses(self) -> int:
        own = 1 if self.kind == "leaf" else sum(child.uses() for child in self.children)
        return own * (self.number if self.kind in LOOPS else 1)

    def kinds(self) -> set[str]:
        return {self.kind}.union(*(child.kinds() for child in self.children))


def random_tree(random: Random, kinds: tuple[str, ...], *, most: int = 7) -> T:
    """A tree whose leaves are used at most ``most`` times, and at least three times."""
    while True:
        names = iter(range(100))
        tree = _random(random, kinds, 3, names)
        if 3 <= tree.uses() <= most and not ends_at_once_in_parallel(tree):
            return tree


def _random(random: Random, kinds: tuple[str, ...], depth: int, names: Iterator[int]) -> T:
    if depth == 0 or (depth < 3 and random.random() < 0.3):
        return T("leaf", leaf=f"L{next(names)}")
    kind = random.choice(kinds)
    if kind.startswith("Always"):
        return T(kind)
    size = 1
    if kind in ("Sequence", "Fallback", "All", "Parallel", "ParallelAll"):
        size = random.choice((1, 2, 3, 3, 4))
    elif kind == "IfThenElse":
        size = random.randint(2, 3)
    children = tuple(_random(random, kinds, depth - 1, names) for _ in range(size))
    number = random.randint(1, 3 if kind in LOOPS else size)
    return T(kind, children, size if kind == "All" else number)


def at_once(tree: T) -> bool | None:
    """How a node ends in its first tick, whatever the leaves do; None: that depends on them."""
    ends = [at_once(child) for child in tree.children]
    if tree.kind == "leaf":
        return None
    if tree.kind in ("AlwaysSuccess", "AlwaysFailure"):
        return tree.kind == "AlwaysSuccess"
    if tree.kind in ("All", "Parallel"):
        if ends.count(True) >= tree.number:
            return True
        return False if ends.count(False) > len(ends) - tree.number else None
    if tree.kind == "ParallelAll":
        return None if None in ends else ends.count(True) >= tree.number
    if tree.kind == "IfThenElse":
        if ends[0] is None:
            return None
        return ends[1] if ends[0] else ends[2] if len(ends) > 2 else False
    if tree.kind in ("Sequence", "Fallback"):
        going_on = tree.kind == "Sequence"
        return next((end for end in ends if end is not going_on), going_on)
    if ends[0] is None or tree.kind in ("SubTree", *LOOPS):
        return ends[0]
    return {"Inverter": not ends[0], "ForceSuccess": True, "ForceFailure": False}[tree.kind]


def ends_at_once_in_parallel(tree: T) -> bool:
    """Whether gpsfsm says of the tree that it cannot express it."""
    parallel = tree.kind in ("All", "Parallel") and len(tree.children) > 1
    return (parallel and at_once(tree) is not None) or any(
        map(ends_at_once_in_parallel, tree.children)
    )


def to_xml(tree: T) -> str:
    trees: list[str] = []
    main = _xml(tree, trees)
    named = "".join(
        f'<BehaviorTree ID="S{number}">{body}</BehaviorTree>\n' for number, body in enumerate(trees)
    )
    return (
        '<root BTCPP_format="4" main_tree_to_execute="Main">\n'
        f'<BehaviorTree ID="Main">\n{main}\n</BehaviorTree>\n{named}</root>\n'
    )


def _xml(tree: T, trees: list[str]) -> str:
    inner = "".join(_xml(child, trees) for child in tree.children)
    if tree.kind == "leaf":
        return f'<Action ID="{tree.leaf}"/>'
    if tree.kind == "SubTree":
        trees.append(inner)
        return f'<SubTree ID="S{len(trees) - 1}"/>'
    words = {
        "RetryUntilSuccessful": f' num_attempts="{tree.number}"',
        "Repeat": f' num_cycles="{tree.number}"',
        "Parallel": f' success_count="{tree.number}"'
        f' failure_count="{len(tree.children) - tree.number + 1}"',
        "ParallelAll": f' max_failures="{len(tree.children) - tree.number + 1}"',
    }
    tag = "Parallel" if tree.kind == "All" else tree.kind
    return f"<{tag}{words.get(tree.kind, '')}>{inner}</{tag}>\n"


# --- an engine that ticks -------------------------------------------------------------------------


@dataclass
class Ticked:
    """A node of the engine; ``at`` is the child that runs, or the round."""

    tree: T
    world: World
    parent: Ticked | None = None
    at: int = 0
    successes: set[int] = field(default_factory=set)
    failures: set[int] = field(default_factory=set)
    left: int = -1  # ticks until a leaf ends; -1: it is not active

    def __post_init__(self) -> None:
        self.children = [Ticked(child, self.world, self) for child in self.tree.children]

    def halt(self) -> None:
        self.at, self.left = 0, -1
        self.successes.clear()
        self.failures.clear()
        for child in self.children:
            child.halt()

    def ended(self, status: Status) -> Status:
        self.halt()
        return status

    def tick(self) -> Status:
        return {
            "leaf": self.tick_leaf,
            "Sequence": self.tick_row,
            "Fallback": self.tick_row,
            "All": self.tick_parallel,
            "Parallel": self.tick_parallel,
            "ParallelAll": self.tick_parallel,
            "IfThenElse": self.tick_branch,
            "RetryUntilSuccessful": self.tick_loop,
            "Repeat": self.tick_loop,
        }.get(self.tree.kind, self.tick_other)()

    def use(self) -> int:
        """Which use of the leaf this is: the rounds of the loops around it tell."""
        number, size = 0, 1
        node = self.parent
        while node is not None:
            if node.tree.kind in LOOPS:
                number += node.at * size
                size *= node.tree.number
            node = node.parent
        return number + 1

    def tick_leaf(self) -> Status:
        use = (self.tree.leaf, self.use())
        if self.left < 0:
            self.world.started.append(use)
            self.left = self.world.ticks(use)
        if self.left:
            self.left -= 1
            return "RUNNING"
        return self.ended("SUCCESS" if self.world.outcomes[use] else "FAILURE")

    def tick_row(self) -> Status:
        going_on: Status = "SUCCESS" if self.tree.kind == "Sequence" else "FAILURE"
        while self.at < len(self.children):
            status = self.children[self.at].tick()
            if status == "RUNNING":
                return status
            if status != going_on:
                return self.ended(status)
            self.at += 1
        return self.ended(going_on)

    def tick_loop(self) -> Status:
        going_on: Status = "SUCCESS" if self.tree.kind == "Repeat" else "FAILURE"
        while self.at < self.tree.number:
            status = self.children[0].tick()
            if status == "RUNNING":
                return status
            if status != going_on:
                return self.ended(status)
            self.at += 1
            self.children[0].halt()
        return self.ended(going_on)

    def tick_parallel(self) -> Status:
        size, need = len(self.children), self.tree.number
        for place, child in enumerate(self.children):
            if place not in self.successes | self.failures:
                status = child.tick()
                if status == "SUCCESS":
                    self.successes.add(place)
                elif status == "FAILURE":
                    self.failures.add(place)
            if self.tree.kind == "ParallelAll":
                continue
            if len(self.successes) >= need:
                return self.ended("SUCCESS")
            if size - len(self.failures) < need:
                return self.ended("FAILURE")
        if len(self.successes) + len(self.failures) < size:
            return "RUNNING"
        return self.ended("SUCCESS" if len(self.successes) >= need else "FAILURE")

    def tick_branch(self) -> Status:
        if self.at == 0:
            status = self.children[0].tick()
            if status == "RUNNING":
                return status
            self.at = 1 if status == "SUCCESS" else 2
            if self.at == len(self.children):
                return self.ended("FAILURE")
        status = self.children[self.at].tick()
        return status if status == "RUNNING" else self.ended(status)

    def tick_other(self) -> Status:
        kind = self.tree.kind
        if kind.startswith("Always"):
            return "SUCCESS" if kind == "AlwaysSuccess" else "FAILURE"
        status = self.children[0].tick()
        if status == "RUNNING" or kind == "SubTree":
            return status
        if kind == "Inverter":
            return "FAILURE" if status == "SUCCESS" else "SUCCESS"
        return "SUCCESS" if kind == "ForceSuccess" else "FAILURE"


@dataclass
class World:
    """What the leaves do; ``started`` is what was started, in its order."""

    outcomes: Mapping[Use, bool]
    ticks: Callable[[Use], int] = lambda _: 1
    started: list[Use] = field(default_factory=list)


def run_ticking(tree: T, world: World) -> bool:
    """Tick until the tree ends; whether it succeeds."""
    root = Ticked(tree, world)
    for _ in range(1000):
        status = root.tick()
        if status != "RUNNING":
            return status == "SUCCESS"
    raise AssertionError("the tree does not end")
