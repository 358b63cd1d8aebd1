"""Random behaviour trees over all nodes that BehaviorTree.CPP 4 has, as XML.

Each leaf has a name of its own: ``A0``, ``A1`` … are actions, ``C0`` … are conditions. Values and
scripts are constants, so that every engine knows them; the automaton of a tree does not. With
``keys`` scripts write two keys, and conditions read them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from random import Random

CONTROLS = (
    *("Sequence", "Fallback", "AsyncSequence", "AsyncFallback", "SequenceWithMemory"),
    *("ReactiveSequence", "ReactiveFallback", "IfThenElse", "WhileDoElse", "Parallel"),
    *("ParallelAll", "Switch2"),
)
DECORATORS = (
    *("Inverter", "ForceSuccess", "ForceFailure", "RetryUntilSuccessful", "Repeat"),
    *("KeepRunningUntilFailure", "RunOnce", "Precondition", "LoopInt"),
)
REACTIVE = ("ReactiveSequence", "ReactiveFallback", "WhileDoElse")
_GUARDS = ("_skipIf", "_failureIf", "_successIf", "_while")
_AFTERWARDS = ("_onSuccess", "_onFailure", "_post", "_onHalted")


class RandomTree:
    """A tree that is drawn from a source of chance; ``text`` is its file."""

    def __init__(self, chance: Random, *, most: int = 7, keys: bool = False) -> None:
        self.chance, self.left, self.actions, self.conditions = chance, most, 0, 0
        self.keys = keys
        self.lines: list[str] = []
        self._node(2, condition=False)
        body = "\n".join(self.lines)
        if keys:
            body = f'<Sequence><Script code="x := 0; y := 1"/>\n{body}\n</Sequence>'
        self.text = (
            '<root BTCPP_format="4" main_tree_to_execute="Main">\n  <BehaviorTree ID="Main">\n'
            f"{body}\n  </BehaviorTree>\n  <TreeNodesModel>{self._models()}</TreeNodesModel>\n"
            "</root>\n"
        )

    @property
    def leaves(self) -> tuple[str, ...]:
        """The names of all leaves."""
        actions = tuple(f"A{number}" for number in range(self.actions))
        return actions + tuple(f"C{number}" for number in range(self.conditions))

    def _models(self) -> str:
        return "".join(
            f'<{"Action" if name.startswith("A") else "Condition"} ID="{name}"/>'
            for name in self.leaves
        )

    def _leaf(self, depth: int, *, condition: bool) -> None:
        self.left -= 1
        pad = "  " * depth
        if self.keys and self.chance.random() < 0.15:
            self.lines.append(f'{pad}<Script code="{self._write()}"/>')
        elif self.chance.random() < 0.08:
            name = self.chance.choice(("AlwaysSuccess", "AlwaysFailure"))
            self.lines.append(f"{pad}<{name}/>")
        elif condition or self.chance.random() < 0.2:
            self.lines.append(f"{pad}<C{self.conditions}{self._guard()}/>")
            self.conditions += 1
        else:
            self.lines.append(f"{pad}<A{self.actions}{self._guard()}/>")
            self.actions += 1

    def _guard(self) -> str:
        after = ""
        if self.keys and self.chance.random() < 0.08:
            after = f' {self.chance.choice(_AFTERWARDS)}="{self._write()}"'
        if self.chance.random() < (0.75 if self.keys else 0.93):
            return after
        return f' {self.chance.choice(_GUARDS)}="{self._condition()}"{after}'

    def _condition(self) -> str:
        """A script that holds or does not."""
        own = ("x == 1", "x == 0", "y == 1", "x == y") if self.keys else ("1 == 1", "1 == 2")
        return self.chance.choice(own)

    def _write(self) -> str:
        return self.chance.choice(("x := 1", "x := 0", "y := 0", "y := 1 - x"))

    def _node(self, depth: int, *, condition: bool) -> None:
        if self.left <= 1 or depth > 6 or self.chance.random() < 0.22 * (depth - 2):
            self._leaf(depth, condition=condition)
        elif self.chance.random() < 0.3:
            self._decorator(depth, condition=condition)
        else:
            self._control(depth, condition=condition)

    def _control(self, depth: int, *, condition: bool) -> None:
        name = self.chance.choice(CONTROLS)
        count = self.chance.randint(2, 3)
        ports = ""
        if name == "Parallel":
            ports = (
                f' success_count="{self.chance.choice((-1, -2, 1, 2, count))}"'
                f' failure_count="{self.chance.choice((1, 1, 2, count))}"'
            )
        elif name == "ParallelAll":
            ports = f' max_failures="{self.chance.randint(1, count)}"'
        elif name == "Switch2":
            count = 3
            ports = f' variable="{self.chance.choice("abc")}" case_1="a" case_2="b"'
        elif name in ("IfThenElse", "WhileDoElse"):
            count = self.chance.randint(2, 3)
        pad = "  " * depth
        self.lines.append(f"{pad}<{name}{ports}{self._guard()}>")
        for position in range(count):
            reactive = name in REACTIVE and position < count - 1 and self.chance.random() < 0.8
            asks = reactive and (name != "WhileDoElse" or position == 0)
            self._node(depth + 1, condition=condition or asks)
        self.lines.append(f"{pad}</{name}>")

    def _decorator(self, depth: int, *, condition: bool) -> None:
        name = self.chance.choice(DECORATORS)
        ports = ""
        if name == "RetryUntilSuccessful":
            ports = f' num_attempts="{self.chance.choice((1, 2, 3, 12, -1))}"'
        elif name == "Repeat":
            ports = f' num_cycles="{self.chance.choice((1, 2, 3, 12, -1))}"'
        elif name == "RunOnce":
            ports = f' then_skip="{self.chance.choice(("true", "false"))}"'
        elif name == "Precondition":
            status = self.chance.choice(("SUCCESS", "FAILURE", "SKIPPED", "RUNNING"))
            ports = f' if="{self._condition()}" else="{status}"'
        elif name == "LoopInt":
            status = self.chance.choice(("SUCCESS", "FAILURE", "SKIPPED"))
            ports = f' queue="{self.chance.choice(("1", "1;2"))}" if_empty="{status}"'
        pad = "  " * depth
        self.lines.append(f"{pad}<{name}{ports}{self._guard()}>")
        self._node(depth + 1, condition=condition)
        self.lines.append(f"{pad}</{name}>")
