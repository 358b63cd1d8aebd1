"""Changes of plans: such as keep the behaviour, and such as may not."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from tests.oracle import COMPLETION, C, P, R
from tests.strategies import ACTIONS, TYPES

if TYPE_CHECKING:
    import random

    from tests.oracle.model import Node, Type

Children = tuple["Node", ...]


def is_recovery(node: Node) -> bool:
    return isinstance(node, C) and node.type == "recovery"


def units(children: Children) -> list[list[Node]]:
    """The children with the recoveries that guard them; leading recoveries by themselves."""
    variants: list[list[Node]] = []
    for child in children:
        if is_recovery(child) and variants:
            variants[-1].append(child)
        else:
            variants.append([child])
    return variants


def same(random: random.Random, whole: P) -> P:
    """A plan that does the same, written differently."""
    children = whole.children
    if children and isinstance(children[-1], R) and children[-1].interface == COMPLETION:
        children = children[:-1]
    return P((*_same(random, children, "sequential"), R(COMPLETION)))


def _same(random: random.Random, children: Children, kind: Type) -> Children:
    dead = is_recovery(children[0]) if children else False
    groups = [[_node(random, child) for child in group] for group in units(children)]
    if kind.startswith("parallel") and not dead:
        random.shuffle(groups)
    nodes: list[Node] = []
    for group in groups:
        nodes += group if is_recovery(group[0]) else _regrouped(random, group)
        if kind == "sequential" and random.random() < 0.15:
            nodes.append(C("sequential"))
    if not dead and random.random() < 0.2:  # guards nothing, so what is in it is never triggered
        nodes.insert(0, C("recovery", (R(random.choice(ACTIONS)),)))
    if kind == "sequential" and not dead and len(groups) > 1 and random.random() < 0.3:
        place = random.randrange(len(nodes))
        head = nodes[:place]
        if head and not is_recovery(nodes[place]) and not any(map(is_recovery, head[:1])):
            nodes = [C("sequential", tuple(head)), *nodes[place:]]
    return tuple(nodes)


def _regrouped(random: random.Random, group: list[Node]) -> list[Node]:
    """A unit, its recoveries split or merged, wrapped where one child is as good as itself."""
    base, guards = group[0], list(group[1:])
    if len(guards) > 1 and random.random() < 0.5:
        first, second = guards[:2]
        assert isinstance(first, C)
        assert isinstance(second, C)
        if not any(is_recovery(each.children[0]) for each in (first, second) if each.children):
            guards[:2] = [C("recovery", first.children + second.children)]
    wrap: Type = random.choice(("sequential", "parallel_all", "parallel_any"))
    if random.random() < 0.3:
        return [C(wrap, (base, *guards))]
    if random.random() < 0.3:
        return [C(wrap, (base,)), *guards]
    return [base, *guards]


def _node(random: random.Random, node: Node) -> Node:
    if isinstance(node, R):
        name = random.choice(("", "renamed"))
        return replace(node, label=name, provider=random.choice(("demo/One", "demo/Two")))
    kind = "sequential" if node.type == "recovery" else node.type
    if node.type == "recovery":
        children = tuple(_node(random, child) for child in node.children)
        return C("recovery", children)
    return C(node.type, _same(random, node.children, kind))


def mutated(random: random.Random, whole: P) -> P:
    """The plan with one change, wherever it is."""
    places = list(_places(whole.children, ()))
    if not places:
        return P((R(random.choice(ACTIONS)),))
    return P(_changed(random, whole.children, random.choice(places)))


def _places(children: Children, path: tuple[int, ...]) -> list[tuple[int, ...]]:
    places = []
    for place, child in enumerate(children):
        places.append((*path, place))
        if isinstance(child, C):
            places += _places(child.children, (*path, place))
    return places


def _changed(random: random.Random, children: Children, path: tuple[int, ...]) -> Children:
    here, *rest = path
    child = children[here]
    if rest:
        assert isinstance(child, C)
        new: Children = (C(child.type, _changed(random, child.children, tuple(rest))),)
        return (*children[:here], *new, *children[here + 1 :])
    kind = random.choice(("drop", "double", "swap", "wrap", "change", "unwrap"))
    if kind == "swap" and here + 1 < len(children):
        return (*children[:here], children[here + 1], child, *children[here + 2 :])
    return (*children[:here], *_instead(random, child, kind), *children[here + 1 :])


def _instead(random: random.Random, child: Node, kind: str) -> Children:
    if kind == "drop":
        return ()
    if kind == "double":
        return child, child
    if kind == "wrap":
        return (C(random.choice(TYPES), (child,)),)
    if isinstance(child, R):
        return (R(random.choice(ACTIONS)),)
    if kind == "unwrap":
        return child.children
    return (C(random.choice(TYPES), child.children),)
