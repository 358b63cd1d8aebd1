"""Scripts of BehaviorTree.CPP 4: what is wrong with one, and which keys it reads and writes."""

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
_WORDS = frozenset({"true", "false"})


class Script(NamedTuple):
    """A script: the keys that it reads and writes, in order; or where it is wrong (``fault``)."""

    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()
    fault: int = -1


def is_script(node: str, attribute: str) -> bool:
    """True for an attribute of a node that holds a script."""
    return attribute in _ALL or PORTS.get(node) == attribute


@cache
def read_script(text: str) -> Script:
    """The script in a text; ``fault`` is the offset at which it is none.

    >>> read_script("count := count + 1; door != 'open'")
    Script(reads=('count', 'door'), writes=('count',), fault=-1)
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
    reads: dict[str, None] = {}
    writes: dict[str, None] = {}
    pending: list[tuple[Any, str]] = [(tree, "")]
    while pending:
        node, assigned = pending.pop()
        if node.data == "name":
            name = str(node.children[0])
            if name not in _WORDS and assigned:
                writes[name] = None
            if name not in _WORDS and assigned not in (":=", "="):
                reads[name] = None
            continue
        if node.data == "assignment":
            target, operator, value = node.children
            rows = [(value, ""), (target, str(operator))]
        else:
            rows = [(each, "") for each in reversed(node.children)]
        pending += (row for row in rows if hasattr(row[0], "data"))  # others are tokens
    return Script(tuple(reads), tuple(writes))


@cache
def _parser() -> Lark:
    from lark import Lark

    grammar = Path(__file__).with_name("script.lark").read_text(encoding="utf-8")
    return Lark(grammar, parser="lalr")
