"""Conditions on the blackboard that have one answer, because nothing writes what they ask for.

A condition is tied to all others of the same text in the same use of a tree. What the first one
answers the others answer, too, until one of its keys may have been written: by a leaf that has the
key at a port (while it runs, and when it ends), by SetBlackboard, UnsetBlackboard, Script or a
script that follows a node. Other writers have no place of their own (a queue, a node of one's own
with children, a script that runs when a node is halted): their keys are tied to nothing.

    <Precondition if="x > 1"> … <Look out="{y}"/> … <Precondition if="x > 1">      one answer
    <Precondition if="y > 1"> … <Look out="{y}"/> … <Precondition if="y > 1">      two answers

Nodes are ticked in the order in which they are compiled. So of what one event enters, a condition
that was compiled before a script may have been answered before it, and others have not.

A key has the names that SubTrees give it. Whoever writes one of them may write the key, so a name
that means two keys forgets too much, never too little.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.compile.tree_scripts import AFTERWARDS
from gpsfsm.model.automaton import Reset, Signal, Tie
from gpsfsm.model.event import Event
from gpsfsm.model.tree import BUILTINS, NAV2, Meaning, PortKind, is_reference
from gpsfsm.syntax.scripts import read_script

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from gpsfsm.compile.trees import Scope
    from gpsfsm.model.tree import NodeModel, TreeNode

_EVENTS = (Event.SUCCEEDED, Event.FAILED)


class Question(NamedTuple):
    """A condition: its text, the keys that it reads, and the use of a tree that it stands in."""

    text: str
    keys: tuple[str, ...]
    scope: Scope


def question(script: str, scope: Scope) -> Question | None:
    """The condition that a script is; None if it writes, too, or is none."""
    read = read_script(script)
    if read.fault >= 0 or read.writes:
        return None
    text = script.strip() if "'" in script or '"' in script else " ".join(script.split())
    return Question(text, read.reads, scope)  # in a text between quotes each blank counts


def ports_question(text: str, ports: Iterable[str], scope: Scope) -> Question:
    """The condition that compares the values of some ports."""
    return Question(text, tuple(_key(port) for port in ports if is_reference(port)), scope)


@dataclass(slots=True)
class _Condition:
    """The parts that ask for the same, and the names of the keys that they ask for."""

    scope: Scope  # kept, so that no other one has its identity
    keys: frozenset[str]
    parts: list[int] = field(default_factory=list)


@dataclass(slots=True)
class Ties:
    """The conditions of one machine, and what writes their keys; parts have their numbers."""

    models: Mapping[str, NodeModel]
    conditions: dict[tuple[int, str], _Condition] = field(default_factory=dict)
    writers: list[tuple[frozenset[str], int]] = field(default_factory=list)
    resets: list[tuple[frozenset[str], tuple[int, ...], int]] = field(default_factory=list)
    loose: set[str] = field(default_factory=set)

    def ask(self, part: int, about: Question | None) -> None:
        """A part has the answer of a condition."""
        if about is None:
            return
        key = id(about.scope), about.text
        if key not in self.conditions:
            names = frozenset(self._names(about.keys, about.scope))
            self.conditions[key] = _Condition(about.scope, names)
        self.conditions[key].parts.append(part)

    def leaf(self, part: int, node: TreeNode, scope: Scope) -> None:
        """A leaf runs, which may write the keys at its ports."""
        if node.identity == "ScriptCondition":
            self.ask(part, question(node.text("code"), scope))
        keys = frozenset(self._names(self._written(node), scope))
        if keys:
            self.writers.append((keys, part))

    def set(self, node: TreeNode, scope: Scope, enter: tuple[int, ...], part: int) -> None:
        """A node that writes at once when these events enter it; ``part``: the next one."""
        keys: list[str] = []
        if node.identity == "Script":
            keys += read_script(node.text("code")).writes
        keys += (_key(node.text(port)) for port in ("output_key", "key") if node.attribute(port))
        if keys:
            self.resets.append((frozenset(self._names(keys, scope)), enter, part))

    def around(self, node: TreeNode, scope: Scope) -> None:
        """A node may write: by its ports if it has children, by a script before or within it."""
        for attribute in node.attributes:
            if attribute.name.startswith("_") and attribute.name not in AFTERWARDS:
                self.loose.update(self._names(read_script(attribute.text).writes, scope))
        if node.identity in ("Precondition", "ScriptCondition"):
            for port in ("if", "code"):
                self.loose.update(self._names(read_script(node.text(port)).writes, scope))
        if node.children:
            self.loose.update(self._names(self._written(node), scope))

    def after(self, node: TreeNode, scope: Scope, ends: tuple[int, ...], part: int) -> None:
        """The scripts after a node write; ``part``: the next one."""
        for name in AFTERWARDS:
            writes = read_script(node.text(name)).writes if node.attribute(name) else ()
            if writes:
                self.resets.append((frozenset(self._names(writes, scope)), ends, part))

    def all(
        self, place: Mapping[int, int], meant: Callable[[tuple[int, ...]], Iterable[int]]
    ) -> Iterator[Tie]:
        """All ties. ``place``: the nodes of parts, ``meant``: the events of ports.

        The first node is the start, and then the runners come.
        """
        for row in self.conditions.values():
            if row.keys & self.loose:
                continue
            resets: dict[Signal, set[int]] = {}
            for keys, signals, part in self.resets:
                for each in meant(signals) if keys & row.keys else ():
                    signal = Signal(place[each // 4], _EVENTS[each % 4])
                    before = {place[other] - 1 for other in row.parts if other < part}
                    resets.setdefault(signal, set()).update(before)
            yield Tie(
                tuple(sorted(place[part] - 1 for part in row.parts)),
                tuple(sorted(place[part] - 1 for keys, part in self.writers if keys & row.keys)),
                tuple(Reset(each, tuple(sorted(resets[each]))) for each in sorted(resets)),
            )

    def _written(self, node: TreeNode) -> Iterator[str]:
        """The keys that a node may write by its ports."""
        name = node.identity
        builtin = BUILTINS.get(name) or NAV2.get(name)
        model = self.models.get(name)
        if builtin is not None and builtin.meaning is Meaning.SUBTREE:
            return
        for attribute in node.attributes:
            if attribute.name.startswith("_") or not is_reference(attribute.text):
                continue
            if builtin is not None:
                reads = (
                    not attribute.name.startswith("output") and builtin.meaning is not Meaning.LOOP
                )
            else:
                reads = model is not None and model.ports.get(attribute.name) is PortKind.INPUT
            if not reads:
                yield _key(attribute.text)

    def _names(self, keys: Iterable[str], scope: Scope) -> Iterator[str]:
        """The names of some keys here and in the trees around."""
        for key in keys:
            plain = key.removeprefix("@")
            yield plain
            outside = scope.text(f"{{{plain}}}")
            if is_reference(outside):
                yield _key(outside)


def _key(text: str) -> str:
    """The name of the key that a port is written with.

    >>> _key("{goal}"), _key("goal"), _key("{@goal}")
    ('goal', 'goal', 'goal')
    """
    return text.strip().removeprefix("{").removesuffix("}").strip().removeprefix("@")
