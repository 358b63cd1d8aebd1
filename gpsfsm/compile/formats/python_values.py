"""Values in Python that is read and not executed: names, operators, functions, methods, instances.

A value that the source says is the value of Python itself, so aliases and what is done to them in
place mean the same as in a run. All else is the name of something imported, or UNKNOWN.
"""

from __future__ import annotations

import ast
import operator
import re
import warnings
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

LONGEST: Final = 1_000
_MOST: Final = 1_000_000
_WIDE: Final = re.compile(r"\d{4}|\*|:[^}]*\{")
"""Widths in formats, which could fill the memory."""


class FailsError(Exception):
    """An operation that raises an exception in a run, too."""


class _Unknown:
    """A value that the source does not say."""


UNKNOWN: Final = _Unknown()


@dataclass(frozen=True, slots=True)
class Library:
    """A name that is imported or built in; what a call of it returns ends in ``()``."""

    name: str


class Scope:
    """The names of a module, a function or a class, and the scope around it.

    ``passing``: it is that of a comprehension, in which ``:=`` assigns to a name of the one around.
    """

    def __init__(
        self, outer: Scope | None = None, owner: Class | None = None, *, passing: bool = False
    ) -> None:
        self.names: dict[str, Any] = {}
        self.outer, self.owner, self.passing = outer, owner, passing
        self.elsewhere: dict[str, Scope] = {}  # of global and nonlocal
        self.body: Scope | None = None  # of a class: the scope that its methods see

    def get(self, name: str) -> Any:
        """The value of a name in a tuple of one; None where there is no such name."""
        scope: Scope | None = self
        while scope is not None and name not in scope.names:
            scope = scope.elsewhere.get(name, scope.outer)
        return None if scope is None else (scope.names[name],)


@dataclass(slots=True, eq=False)
class Function:
    """A function of the file; ``defaults`` are evaluated once, where it is defined."""

    node: ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda
    scope: Scope
    defaults: dict[str, Any] = field(default_factory=dict)
    owner: Class | None = None
    static: bool = False


@dataclass(slots=True, eq=False)
class Class:
    """A class of the file."""

    name: str
    bases: list[Any]
    names: dict[str, Any]

    def line(self) -> Iterator[Any]:
        """The class and those it inherits from, in the order in which names are looked up."""
        yield self
        for base in self.bases:
            yield from base.line() if isinstance(base, Class) else (base,)

    def get(self, name: str, *, inherited: bool = False) -> Any:
        """The value of a name of the class; None where there is none, UNKNOWN if nobody knows."""
        for each in list(self.line())[inherited:]:
            if not isinstance(each, Class):
                return Library(f"{each.name}.{name}") if isinstance(each, Library) else UNKNOWN
            if name in each.names:
                return each.names[name]
        return None


@dataclass(slots=True, eq=False)
class Instance:
    """An object. As a state it has ``outcomes``, and perhaps others if it is ``open``."""

    kind: str
    of: Class | None = None
    outcomes: tuple[str, ...] = ()
    open: bool = True
    parameters: dict[str, Any] = field(default_factory=dict)
    attributes: dict[str, Any] = field(default_factory=dict)


_PRINT = re.compile(r"^([ \t]*)print\b(?!\s*\().*$", re.M)
_EXCEPT = re.compile(r"^([ \t]*except\s+[\w.()]+), ?(\w+)[ \t]*:", re.M)


def parsed(text: str) -> ast.Module | tuple[str, int, int]:
    """The syntax of a source, or what is wrong with it, in which line and column."""
    old = _EXCEPT.sub(r"\1 as \2:", _PRINT.sub(r"\1pass", text)).expandtabs(8)  # Python 2
    wrong = ("", 1, 1)
    for attempt in (text, old):
        try:
            with warnings.catch_warnings(action="ignore"):  # of escapes: the text is not ours
                return ast.parse(attempt.replace("\r\n", "\n"))
        except SyntaxError as error:
            message = f"this is neither Python 3 nor Python 2 that is like it: {error.msg}"
            wrong = message, max(error.lineno or 1, 1), max(error.offset or 1, 1)
        except (RecursionError, MemoryError, ValueError):
            return "this Python is nested too deeply, or no text", 1, 1
    return wrong


@dataclass(frozen=True, slots=True, eq=False)
class Bound:
    """A method of an object: a function of the file, or a name."""

    function: Any
    owner: Any


def dotted(node: ast.AST) -> str:
    """A name with dots, "" for what is none."""
    parts: list[str] = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    return ".".join((node.id, *reversed(parts))) if isinstance(node, ast.Name) else ""


def plain(value: Any, depth: int = 9) -> bool:
    """True for texts, numbers, Booleans, None, and rows and dictionaries of them."""
    if isinstance(value, list | tuple | dict):
        rows = value.values() if isinstance(value, dict) else value
        return depth > 0 and all(plain(each, depth - 1) for each in rows)
    return value is None or isinstance(value, str | int | float | range)


def truth(value: Any) -> Any:
    """True or False as ``if`` takes a value; UNKNOWN where the source does not say it."""
    return bool(value) if value is None or isinstance(value, (*_ROWS, int, float)) else UNKNOWN


def _short(value: Any) -> Any:
    """A value, unless it is longer than a name or a row of states can be."""
    big = isinstance(value, int | float) and abs(value) > _MOST
    return UNKNOWN if big or (isinstance(value, _ROWS) and len(value) > 10 * LONGEST) else value


def joined_text(parts: Sequence[Any]) -> Any:
    """One text of texts and numbers, unless it is longer than a name can be."""
    if not all(each is None or isinstance(each, str | int | float) for each in parts):
        return UNKNOWN
    length = sum(len(each) for each in parts if isinstance(each, str))
    return "".join(map(str, parts)) if length <= LONGEST else UNKNOWN


_OPERATORS: Final[Mapping[type[ast.AST], str]] = {
    **{ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.Mod: "mod"},
    **{ast.FloorDiv: "floordiv", ast.BitOr: "or_"},
}
_COMPARISONS: Final[Mapping[type[ast.AST], Callable[[Any, Any], Any]]] = {
    **{ast.Eq: operator.eq, ast.NotEq: operator.ne, ast.Lt: operator.lt, ast.LtE: operator.le},
    **{ast.Gt: operator.gt, ast.GtE: operator.ge},
    **{ast.Is: operator.is_, ast.IsNot: operator.is_not},
    **{ast.In: lambda one, row: one in row, ast.NotIn: lambda one, row: one not in row},
}


def operated(kind: ast.operator, left: Any, right: Any, *, in_place: bool = False) -> Any:
    """The result of an operator. Raises FailsError where it raises in Python."""
    name = _OPERATORS.get(type(kind))
    rows = type(left) is type(right) and isinstance(left, list | tuple | dict)
    if name is None or not (rows or (plain(left) and plain(right))):
        return UNKNOWN
    if name == "mod" and isinstance(left, str) and (len(left) > LONGEST or _WIDE.search(left)):
        return UNKNOWN
    if name == "mul" and not (isinstance(left, int | float) and isinstance(right, int | float)):
        return UNKNOWN
    function = getattr(operator, "i" + name.strip("_") if in_place else name)
    try:
        return _short(function(left, right))
    except (TypeError, ValueError, KeyError, ArithmeticError) as error:
        raise FailsError from error


def negated(kind: ast.unaryop, value: Any) -> Any:
    """The result of an operator with one operand."""
    if isinstance(kind, ast.Not):
        test = truth(value)
        return test if test is UNKNOWN else not test
    negative = isinstance(kind, ast.USub) and isinstance(value, int | float)
    return -value if negative else UNKNOWN


def compared(kind: ast.cmpop, left: Any, right: Any) -> Any:
    """The result of a comparison; UNKNOWN for all but plain values."""
    right = list(right) if isinstance(right, dict) else right
    identity = isinstance(kind, ast.Is | ast.IsNot)
    if not (plain(left) and plain(right)) or (identity and not (left is None or right is None)):
        return UNKNOWN  # identity of others depends on what the interpreter shares
    try:
        return _COMPARISONS[type(kind)](left, right)
    except TypeError as error:
        raise FailsError from error


_ROWS: Final[tuple[type[Any], ...]] = (list, tuple, dict, str, range)
_NONE: Final[dict[str, str]] = {}
_ITERATORS: Final[tuple[type[Any], ...]] = (
    *(enumerate, zip, reversed, type(iter(list(_NONE)))),
    *(
        type(reversed(each))
        for each in (list(_NONE), _NONE, _NONE.values(), _NONE.items(), range(0))
    ),
)
_VIEWS: Final[tuple[type[Any], ...]] = tuple(
    type(each) for each in (_NONE.keys(), _NONE.values(), _NONE.items())
)
_FUNCTIONS: Final[Mapping[str, Callable[..., Any]]] = {
    each.__name__: each
    for each in (len, list, tuple, dict, enumerate, zip, reversed, str, int, sorted, range)
}
CHANGING: Final = frozenset(
    {"append", "extend", "insert", "pop", "remove", "reverse", "clear", "sort", "update"}
    | {"setdefault", "popitem", "add", "discard", "appendleft", "popleft"}
)
"""Methods that change what they belong to."""
_STRUCTURE: Final = frozenset({"append", "extend", "reverse", "clear", "copy", "keys", "values"})
_METHODS: Final = frozenset(
    {"get", "pop", "setdefault", "update", "insert", "remove", "index", "sort", "items"}
    | {"format", "join", "upper", "lower", "title", "strip", "split", "startswith", "endswith"}
)


def used_up(value: Any) -> bool:
    """True for a row that a loop uses up."""
    return isinstance(value, _ITERATORS)


def row(value: Any) -> bool:
    """True for what a loop can go through in an order that is certain."""
    return isinstance(value, _ROWS + _ITERATORS + _VIEWS)


def function_result(name: str, arguments: Sequence[Any], keywords: Mapping[str, Any]) -> Any:
    """The result of a built-in function. Raises FailsError where it raises in Python."""
    function = _FUNCTIONS.get(name)
    deep = name in ("str", "int", "sorted", "range")
    if function is None or (keywords and name != "dict"):
        return UNKNOWN
    if not all(plain(each) if deep else row(each) for each in arguments):
        return UNKNOWN
    if name in ("str", "int") and not isinstance((*arguments, "")[0], str | int | float):
        return UNKNOWN
    try:
        return _short(function(*arguments, **keywords))
    except (TypeError, ValueError, ArithmeticError, RuntimeError) as error:
        raise FailsError from error


def method_result(owner: Any, name: str, arguments: list[Any], keywords: dict[str, Any]) -> Any:
    """The result of a method of a text, a list or a dictionary in a tuple; None if not followed.

    Raises FailsError where the method raises in Python.
    """
    deep = name not in _STRUCTURE and name not in ("items", "get", "pop", "setdefault", "insert")
    keys = arguments[:1] if not deep and name not in _STRUCTURE else arguments if deep else []
    if name not in _STRUCTURE | _METHODS or not all(map(plain, keys)):
        return None
    if (keywords and name not in ("update", "format")) or not plain(keywords):
        return None
    if deep and not plain(owner) and name != "update":
        return None
    if name == "extend" and not all(map(row, arguments)):
        return None
    if len(owner) > LONGEST or (isinstance(owner, str) and _WIDE.search(owner)):
        return None
    try:
        return (_short(getattr(owner, name)(*arguments, **keywords)),)
    except (TypeError, ValueError, LookupError, AttributeError, RuntimeError) as error:
        raise FailsError from error


def imports(text: str, word: str) -> bool:
    """True if a line that imports something names ``word``, whatever stands before it.

    >>> imports("# smach", "smach"), imports("from smach_ros import X", "smach")
    (False, True)
    """
    return re.search(rf"(?im)(?:^|\r)[ \t]*+(?:from|import)\b.*{word}", text) is not None


FAMILY = ("smach", "smach_ros", "flexbe_core")
KEEPING = frozenset({"rospy", "copy", "math", "time", "logging", "json", "container", "smach_ros"})
"""Modules of these that leave alone what they are handed."""
_SCOPES = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda, ast.ClassDef)


def same(left: Any, right: Any) -> bool:
    """True if two values are certainly one."""
    simple = type(left) is type(right) and isinstance(left, str | int | float | Library)
    return left is right or (simple and bool(left == right))


def stores(node: ast.Name) -> bool:
    """True for a name that is assigned or deleted."""
    return isinstance(node.ctx, ast.Store | ast.Del)


def in_family(value: Any) -> bool:
    """True for a name of SMACH or FlexBE."""
    return isinstance(value, Library) and value.name.partition(".")[0] in FAMILY


def changed_by(node: ast.AST) -> Iterable[ast.Name | ast.Attribute]:
    """Names and attributes that a node may change in place, or assign."""
    changed: list[ast.AST] = []
    if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store | ast.Del):
        changed = [node]
    elif isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store | ast.Del):
        changed = [node.value]
    elif isinstance(node, ast.Call):
        function = node.func
        if isinstance(function, ast.Attribute) and function.attr in CHANGING:
            changed = [function.value]
        if dotted(function).partition(".")[0] not in (*KEEPING, *FAMILY, "print", "str", "len"):
            changed += [*node.args, *(each.value for each in node.keywords)]
    return [each for each in changed if isinstance(each, ast.Name | ast.Attribute)]


def own_nodes(node: ast.AST) -> Iterable[ast.AST]:
    """The nodes in a function or a class, without those in functions and classes of its own."""
    for child in ast.iter_child_nodes(node):
        yield child
        if not isinstance(child, _SCOPES):
            yield from own_nodes(child)


def mentioned(function: Function, node: ast.AST) -> Any:
    """A value of a name, or a method of the class, that a function mentions."""
    if isinstance(node, ast.withitem):
        node = node.context_expr
    value: Any = None
    if isinstance(node, ast.Name):
        value = (function.scope.get(node.id) or (None,))[0]
    elif isinstance(node, ast.Attribute) and function.owner is not None:
        value = function.owner.get(node.attr)
    return value
