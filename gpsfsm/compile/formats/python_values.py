"""Values in Python that is read and not executed: operators, functions, instances of states."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from gpsfsm.compile.formats.outcomes import State

LONGEST: Final = 1_000
_MOST: Final = 1_000_000
_ACTION = ("succeeded", "aborted", "preempted")
LIBRARY: Final[Mapping[str, tuple[str, ...]]] = {
    "SimpleActionState": _ACTION,
    "ServiceState": ("succeeded", "aborted", "preempted"),
    "MonitorState": ("valid", "invalid", "preempted"),
}
"""The outcomes of states of the library, where the source names none."""


class _Unknown:
    """A value that the source does not say."""


UNKNOWN: Final = _Unknown()


@dataclass(slots=True)
class Instance:
    """A state of a class: its name, and its outcomes as far as the source says them."""

    kind: str
    outcomes: tuple[str, ...] = ()
    parameters: dict[str, Any] = field(default_factory=dict)


def text_row(value: Any) -> tuple[str, ...]:
    """The texts in a list; nothing for what is none."""
    rows = value if isinstance(value, list | tuple) else ()
    return tuple(each for each in rows if isinstance(each, str))


def row_list(value: Any) -> bool:
    """True for a list."""
    return isinstance(value, list)


def dotted(node: ast.AST) -> str:
    """A name with dots, "" for what is none."""
    parts: list[str] = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    if isinstance(node, ast.Call) and dotted(node.func) == "super":
        parts.append("super")
    elif isinstance(node, ast.Name):
        parts.append(node.id)
    else:
        return ""
    return ".".join(reversed(parts))


def joined_text(parts: Sequence[Any]) -> Any:
    """One text of texts and numbers, unless it is longer than a name can be."""
    if not all(isinstance(each, str | int | float) for each in parts):
        return UNKNOWN
    if sum(len(each) for each in parts if isinstance(each, str)) > LONGEST:
        return UNKNOWN
    return "".join(map(str, parts))


def operated(operator: ast.operator, left: Any, right: Any) -> Any:
    """A result of an operator; unknown for all but whole numbers, texts and lists."""
    if isinstance(left, int) and isinstance(right, int):
        return _counted(operator, left, right)
    rows = isinstance(left, list) and isinstance(right, list)
    if isinstance(operator, ast.Add) and (
        rows or (isinstance(left, str) and isinstance(right, str))
    ):
        result = left + right
        return result if len(result) <= LONGEST else UNKNOWN
    if isinstance(operator, ast.Mod) and isinstance(left, str) and right is not UNKNOWN:
        values = right if isinstance(right, list) else [right]
        plain = all(isinstance(each, str | int | float) for each in values)
        if len(left) > LONGEST or re.search(r"\d{4}|\*", left) or not plain:
            return UNKNOWN  # a width could fill the memory
        try:
            return left % (tuple(right) if isinstance(right, list) else right)
        except (TypeError, ValueError, KeyError):
            return UNKNOWN
    return UNKNOWN


def compared(operator: ast.cmpop, left: Any, right: Any) -> Any:
    """The result of a comparison of numbers or texts; unknown for all others."""
    numbers = isinstance(left, int | float) and isinstance(right, int | float)
    if not numbers and not (isinstance(left, str) and isinstance(right, str)):
        return UNKNOWN
    if isinstance(operator, ast.Eq | ast.NotEq):
        return (left == right) is isinstance(operator, ast.Eq)
    if isinstance(operator, ast.Lt | ast.GtE):
        return (left < right) is isinstance(operator, ast.Lt)
    if isinstance(operator, ast.Gt | ast.LtE):
        return (left > right) is isinstance(operator, ast.Gt)
    return UNKNOWN


def _counted(operator: ast.operator, left: int, right: int) -> Any:
    if max(abs(left), abs(right)) > _MOST:
        return UNKNOWN
    if isinstance(operator, ast.Add | ast.Sub):
        return left + right if isinstance(operator, ast.Add) else left - right
    if isinstance(operator, ast.Mult):
        return left * right
    if isinstance(operator, ast.Mod | ast.FloorDiv) and right:
        return left % right if isinstance(operator, ast.Mod) else left // right
    return UNKNOWN


def called(
    last: str, name: str, owner: Any, arguments: list[Any], keywords: Mapping[str, Any]
) -> Any:
    """A few functions and methods of Python, with arguments that are known; else a state."""
    written = all(each is not UNKNOWN for each in arguments)
    if name == "str" and written and len(arguments) == 1 and isinstance(arguments[0], str | int):
        return str(arguments[0])
    if name == "len" and written and arguments and isinstance(arguments[0], list | dict | str):
        return len(arguments[0])
    if name == "range" and written and all(isinstance(each, int) for each in arguments):
        return list(range(*arguments)) if _small(arguments) else UNKNOWN
    if name == "enumerate" and written and arguments and isinstance(arguments[0], list):
        return [[number, each] for number, each in enumerate(arguments[0])]
    if isinstance(owner, list) and last == "append" and len(owner) < LONGEST:
        owner.extend(arguments)
        return None
    if isinstance(owner, dict) and last in ("keys", "items", "values", "iteritems"):
        rows: Iterable[Any] = owner.items() if "items" in last else owner
        return [list(each) if isinstance(each, tuple) else each for each in rows]
    if name in ("dict", "list", "tuple") and not arguments:
        return dict(keywords) if name == "dict" else []
    outcomes = text_row(keywords.get("outcomes"))
    if last[:1].isupper() or last == "use_behavior":
        shown = {key: each for key, each in keywords.items() if isinstance(each, str | int | float)}
        shown.pop("outcomes", None)
        return Instance(name.removeprefix("self."), outcomes or LIBRARY.get(last, ()), shown)
    return UNKNOWN


def _small(arguments: list[Any]) -> bool:
    return (
        1 <= len(arguments) <= 3
        and all(abs(each) <= 10_000 for each in arguments)
        and (len(arguments) < 3 or arguments[2] != 0)
    )


_CONCURRENCE = (
    *("outcomes", "default_outcome", "input_keys", "output_keys"),
    *("outcome_map", "outcome_cb", "child_termination_cb"),
)


def described(
    made: State, kind: str, arguments: Sequence[Any], keywords: Mapping[str, Any]
) -> Iterator[str]:
    """The outcomes of a container, and how a concurrence ends; what of it is not written."""
    if kind == "Concurrence":
        keywords = {**dict(zip(_CONCURRENCE, arguments, strict=False)), **keywords}
    if kind == "ConcurrencyContainer" and arguments:
        keywords, arguments = {"conditions": arguments[0], **keywords}, arguments[1:]
    outcomes = keywords.get("outcomes", arguments[0] if arguments else [])
    made.outcomes = text_row(outcomes)
    if not isinstance(outcomes, list) or len(made.outcomes) < len(outcomes):
        yield "the outcomes of this container are not written in the source"
    if kind == "Sequence":
        connector = keywords.get("connector_outcome", arguments[1] if len(arguments) > 1 else "")
        made.default = connector if isinstance(connector, str) else ""
        if not made.default:
            yield "the outcome that connects this sequence is not written in the source"
    if kind == "Concurrence":
        default, rules = keywords.get("default_outcome", ""), keywords.get("outcome_map", {})
        made.default = default if isinstance(default, str) else ""
        literal = isinstance(rules, dict) and all(
            isinstance(each, dict) and len(text_row(list(each.values()))) == len(each)
            for each in rules.values()
        )
        # Of several rules that hold SMACH takes the last one, State.rules the first one.
        made.rules = [(str(key), rules[key]) for key in reversed(rules)] if literal else []
        made.open_end = (
            not literal
            or not isinstance(default, str)
            or any(keywords.get(each) is not None for each in _CONCURRENCE[-2:])
        )
    if kind == "ConcurrencyContainer":
        rows = keywords.get("conditions", [])
        for row in rows if isinstance(rows, list) else [None]:
            if not (
                isinstance(row, list)
                and len(row) == 2
                and isinstance(row[0], str)
                and isinstance(row[1], list)
                and all(len(each) == len(text_row(each)) == 2 for each in row[1] if row_list(each))
                and all(map(row_list, row[1]))
            ):
                yield "the conditions of this container are not written in the source"
                return
            made.rules.append((row[0], dict(row[1])))


def imports(text: str, word: str) -> bool:
    """True if a line that imports something names ``word``, whatever stands before it.

    >>> imports("# smach", "smach"), imports("from smach_ros import X", "smach")
    (False, True)
    """
    return re.search(rf"(?im)(?:^|\r)[ \t]*+(?:from|import)\b.*{word}", text) is not None
