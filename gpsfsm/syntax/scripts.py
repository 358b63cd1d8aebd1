"""Scripts of BehaviorTree.CPP 4: what is wrong with one, and which keys it reads and writes.

Arithmetic, operators of bits (``!`` is one of them) and the joining of texts do not mix in one
expression; each pair of parentheses, and what is between ``?`` and ``:``, is an expression of its
own. The engine takes ``(a + b) | c`` and refuses ``a + b | c``, and ``!a && b == c + 1`` too.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from lark import Lark

SCRIPTS = ("_skipIf", "_successIf", "_failureIf", "_while", "_onSuccess", "_onFailure")
"""Attributes of any node that hold a script; there are ``_onHalted`` and ``_post`` besides."""

PORTS = {"Script": "code", "ScriptCondition": "code", "Precondition": "if"}
"""The ports that hold a script, by node."""

MOST = 10_000
"""Characters of a script that is read."""

_ALL = frozenset({*SCRIPTS, "_onHalted", "_post"})
SPECIAL = frozenset({*_ALL, "_autoremap", "_description", "_fullpath", "_uid"})
"""Attributes of nodes that are no ports; the last three are written by tools."""
_FAMILIES = {"ARITHMETIC": "sum", "MINUS": "sum", "BITS": "bits", "NOT": "bits", "JOIN": "text"}
"""Families of operators; two families do not mix in one expression."""


class Script(NamedTuple):
    """A script: the keys that it reads and writes, in order; or where it is wrong (``fault``).

    ``mixed``: parentheses would mend it.
    """

    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()
    fault: int = -1
    mixed: bool = False


def is_script(node: str, attribute: str) -> bool:
    """True for an attribute of a node that holds a script."""
    return attribute in _ALL or PORTS.get(node) == attribute


@cache
def read_script(text: str) -> Script:
    """The script in a text; ``fault`` is the offset at which it is none.

    >>> read_script("count := count + 1; door != 'open'")
    Script(reads=('count', 'door'), writes=('count',), fault=-1, mixed=False)
    >>> read_script("a := ").fault
    5
    """
    from lark.exceptions import UnexpectedEOF, UnexpectedInput

    if len(text) > MOST:
        return Script(fault=MOST)
    try:
        tree = _parser().parse(text)
    except UnexpectedEOF:
        return Script(fault=len(text))
    except UnexpectedInput as error:
        ended = getattr(getattr(error, "token", None), "type", "") == "$END"
        at = len(text) if ended else error.pos_in_stream
        return Script(fault=0 if at is None else at)
    except RecursionError:
        return Script(fault=0)
    fault = _mixed(tree)
    return Script(fault=fault, mixed=True) if fault >= 0 else _keys(tree)


def _keys(tree: Any) -> Script:
    reads: dict[str, None] = {}
    writes: dict[str, None] = {}
    pending: list[tuple[Any, str]] = [(tree, "")]
    while pending:
        node, assigned = pending.pop()
        if node.data == "name":
            name = str(node.children[0])
            if assigned:
                writes[name] = None
            if assigned not in (":=", "="):
                reads[name] = None
            continue
        if node.data == "assignment":
            target, operator, value = node.children
            rows = [(value, ""), (target, str(operator))]
        else:
            rows = [(each, "") for each in reversed(node.children)]
        pending += (row for row in rows if hasattr(row[0], "data"))  # others are tokens
    return Script(tuple(reads), tuple(writes))


def _mixed(tree: Any) -> int:
    """The offset of the first operator that does not mix with one before it, or -1."""
    operators: dict[int, list[Any]] = {}  # of each expression
    pending = [(each, number) for number, each in enumerate(tree.children)]
    expressions = len(pending)
    while pending:
        node, expression = pending.pop()
        if not hasattr(node, "data"):
            if node.type in _FAMILIES:
                operators.setdefault(expression, []).append(node)
            continue
        own = {"nested": 0, "choice": 1}.get(node.data, -1)
        for index, child in enumerate(node.children):
            pending.append((child, expressions if index == own else expression))
        expressions += own >= 0
    faults = []
    for tokens in operators.values():
        tokens.sort(key=lambda token: token.start_pos)
        family = _FAMILIES[tokens[0].type]
        other = (token.start_pos for token in tokens if _FAMILIES[token.type] != family)
        faults += [*other][:1]
    return min(faults, default=-1)


@cache
def _parser() -> Lark:
    from lark import Lark

    grammar = Path(__file__).with_name("script.lark").read_text(encoding="utf-8")
    return Lark(grammar, parser="lalr")
