"""Abstract plans for tests: nested frozen data, their XML text and their element paths."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Iterator

Type = Literal["sequential", "recovery", "parallel_any", "parallel_all"]

COMPLETION = "fabric_capabilities/FabricCompletionRunner"


@dataclass(frozen=True, slots=True)
class R:
    """A runner. ``action`` is the interface and its parameters: ``demo/GoRunner x=1 y=true``.

    Values hold no blanks and are spelled plainly (no ``1_0``, ``nan`` or ``True``), since how
    odd spellings are typed is for the tests of the front end to say.
    """

    action: str
    label: str = ""
    ident: str = ""
    provider: str = "demo_runners/Demo"

    @property
    def interface(self) -> str:
        return self.action.split()[0]

    @property
    def parameters(self) -> tuple[tuple[str, str], ...]:
        pairs = (word.partition("=") for word in self.action.split()[1:])
        return tuple((name, value) for name, _, value in pairs)


@dataclass(frozen=True, slots=True)
class C:
    """A control."""

    type: Type
    children: tuple[Node, ...] = ()


@dataclass(frozen=True, slots=True)
class P:
    """A plan: the children of ``<Plan>``."""

    children: tuple[Node, ...] = ()


Node = R | C


def plan(*children: Node | str) -> P:
    """A plan; a text is short for a runner with that action."""
    return P(_nodes(children))


def seq(*children: Node | str) -> C:
    return C("sequential", _nodes(children))


def rec(*children: Node | str) -> C:
    return C("recovery", _nodes(children))


def par_any(*children: Node | str) -> C:
    return C("parallel_any", _nodes(children))


def par_all(*children: Node | str) -> C:
    return C("parallel_all", _nodes(children))


def _nodes(children: tuple[Node | str, ...]) -> tuple[Node, ...]:
    return tuple(R(child) if isinstance(child, str) else child for child in children)


@dataclass(frozen=True, slots=True)
class Placed:
    """A node of the plan as it counts (completion dropped), with its element path."""

    node: Node | P
    path: str
    children: tuple[Placed, ...] = ()

    def walk(self) -> Iterator[Placed]:
        """This element and all below it, in document order."""
        yield self
        for child in self.children:
            yield from child.walk()


def place(whole: P) -> Placed:
    """The plan with element paths, without the completion runner that may end it."""
    children = whole.children
    if children and isinstance(children[-1], R) and children[-1].interface == COMPLETION:
        children = children[:-1]
    return Placed(whole, "/Plan", _place_all(children, "/Plan"))


def _place_all(children: tuple[Node, ...], parent: str) -> tuple[Placed, ...]:
    counts = {"Runner": 0, "Control": 0}
    placed = []
    for child in children:
        tag = "Runner" if isinstance(child, R) else "Control"
        counts[tag] += 1
        path = f"{parent}/{tag}[{counts[tag]}]"
        below = _place_all(child.children, path) if isinstance(child, C) else ()
        placed.append(Placed(child, path, below))
    return tuple(placed)


def runner_paths(whole: P) -> tuple[str, ...]:
    """The element paths of all runner instances, in document order."""
    return tuple(placed.path for placed in place(whole).walk() if isinstance(placed.node, R))


def control_paths(whole: P) -> tuple[str, ...]:
    """The element paths of all controls, in document order."""
    return tuple(placed.path for placed in place(whole).walk() if isinstance(placed.node, C))


def action_key(runner: R) -> tuple[str, frozenset[tuple[str, str, object]]]:
    """Equal exactly for equal actions: by interface and typed parameters."""
    return runner.interface, frozenset((name, *_typed(text)) for name, text in runner.parameters)


def _typed(text: str) -> tuple[str, object]:
    # The first part keeps 1 and true apart, which Python holds to be equal.
    if text in ("true", "false"):
        return "flag", text == "true"
    for number in (int, float):
        try:
            return "number", number(text)
        except ValueError:
            continue
    return "text", text


def to_xml(whole: P) -> str:
    """The plan as text, one element per line."""
    lines = ["<Plan>"]
    for child in whole.children:
        lines += _lines(child, 1)
    return "\n".join([*lines, "</Plan>", ""])


def _lines(node: Node, depth: int) -> list[str]:
    indent = "  " * depth
    if isinstance(node, R):
        attributes = [("interface", node.interface), ("provider", node.provider), *node.parameters]
        attributes += [(k, v) for k, v in (("name", node.label), ("id", node.ident)) if v]
        text = " ".join(f'{name}="{escape(value)}"' for name, value in attributes)
        return [f"{indent}<Runner {text}/>"]
    if not node.children:
        return [f'{indent}<Control type="{node.type}"/>']
    below = [line for child in node.children for line in _lines(child, depth + 1)]
    return [f'{indent}<Control type="{node.type}">', *below, f"{indent}</Control>"]
