"""Values that are not certain: what unread code may change, and paths that only a run decides.

A statement under a condition that the source does not decide is followed as if it were reached;
what it has changed is unknown afterwards. What is handed to code that is not followed is *lost*:
unknown from then on. Names that a function writes which is called later are *haunted*: unknown
at any time.

    if get_param("night"):
        then = "DOCK"          from here on `then` is unknown, if it was anything before
"""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING, Any, Final

from gpsfsm.compile.formats.python_builders import (
    CONTAINERS,
    HARMLESS_METHODS,
    Builder,
    Container,
)
from gpsfsm.compile.formats.python_values import (
    CHANGING,
    UNKNOWN,
    Bound,
    Class,
    FailsError,
    Function,
    Instance,
    Library,
    dotted,
    plain,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

FAMILY = ("smach", "smach_ros", "flexbe_core")
KEEPING = frozenset({"rospy", "copy", "math", "time", "logging", "json", "container", "smach_ros"})
"""Modules of these that leave alone what they are handed."""
_PRIVATE = frozenset(
    {"set_initial_state", "add_auto", "_transitions", "_states", "_initial_state_label"}
    | {"_connector_outcomes", "_outcome_map", "_default_outcome", "_conditions", "_labels"}
)
MOST_STEPS: Final = 50_000
_MOST_ROUNDS: Final = 8
MISSING: Final[Any] = object()


class LeaveError(Exception):
    """A statement that leaves the loop or the function around it, which may return a value."""

    def __init__(self, value: Any = None) -> None:
        super().__init__()
        self.value = value


class BreakError(LeaveError):
    """A ``break``."""


class ContinueError(LeaveError):
    """A ``continue``."""


class RaiseError(Exception):
    """A statement that raises an exception."""


class TooMuchError(Exception):
    """More statements than are followed."""


class Effects(Builder):
    """The values that are certain, and those that are not."""

    def __init__(self) -> None:
        super().__init__()
        self.haunted: set[str] = set()
        self.scanned: set[int] = set()
        self.born: dict[int, tuple[tuple[int, ...], Any]] = {}
        self.steps = self.serial = 0
        self.left = False  # a path may have left the function that is followed
        self.journal: list[tuple[dict[Any, Any], Any, Any]] = []

    # -- what only a run decides ------------------------------------------------------------

    def step(self) -> None:
        """One more step of the program."""
        self.steps += 1
        if self.steps > MOST_STEPS:
            raise TooMuchError

    def write(self, mapping: dict[Any, Any], key: Any, value: Any) -> None:
        """A name or an attribute gets a value."""
        if self.branch:
            self.journal.append((mapping, key, mapping.get(key, MISSING)))
        mapping[key] = value

    def perhaps(self, *actions: Callable[[], object], torn: bool = False) -> bool:
        """Actions of which only a run decides whether they are done: what they change is unknown.

        A name that had no value before keeps the new one, since without it the run fails. ``torn``:
        an exception may leave them in their midst. Returns True if anything is different.
        """
        before = len(self.lost)
        changed, ends = False, []
        for action in actions:
            outside, journal, opened = self.branch, self.journal, list(self.open)
            self.serial += 1
            self.branch, self.journal = (*outside, self.serial), []
            try:
                ends.append(_end(action))
            finally:
                rows, self.branch, self.journal = self.journal, outside, journal
                self.open = opened
            for mapping, key, old in {(id(e[0]), e[1]): e for e in reversed(rows)}.values():
                value = mapping.pop(key, MISSING)
                if old is not MISSING:
                    mapping[key] = old
                if ends[-1] == "raise" and not torn:
                    continue
                lasting = not torn or isinstance(value, Library | Function | Class)
                kept = lasting and (old is MISSING or _same(old, value))
                changed |= not kept and old is not UNKNOWN
                self.write(mapping, key, value if kept else UNKNOWN)
        self.left |= "leave" in ends
        if {*ends} == {"raise"}:
            raise RaiseError
        return changed or len(self.lost) > before

    def repeated(self, body: Callable[[], object]) -> None:
        """A loop of which only a run decides how often it goes round."""
        made = len(self.containers)
        for _ in range(_MOST_ROUNDS):
            del self.containers[made:]  # those of the round before
            if not self.perhaps(body, lambda: None):
                return
        raise TooMuchError

    def certain(self, value: Any) -> bool:
        """True if the program gets here wherever it makes a value; else the value is lost."""
        born = self.born.get(id(value), ((), value))[0]
        if born[: len(self.branch)] == self.branch:
            return True
        self.lose(value, None)
        return False

    def fresh(self, value: Any) -> Any:
        """A row or a dictionary that is made here."""
        if self.branch:
            self.born[id(value)] = (self.branch, value)
        return value

    # -- what code that is not followed may do ----------------------------------------------

    def lose(self, value: Any, node: ast.AST | None) -> None:
        """Code that is not followed gets a value: nothing is certain of it from here on."""
        if id(value) in self.lost or isinstance(value, str | int | float | None | range):
            return
        if isinstance(value, Container):
            value.lost = True
            if node is not None:
                message = "what this does to a container is decided in code that is not followed"
                self.fault(node, message, "build the machine in this file")
            return
        if isinstance(value, Function | Bound):
            self.later(value)
            if isinstance(value, Bound) and not isinstance(value.function, Function):
                self.lose(value.owner, node)
            return
        self.lost[id(value)] = value
        if isinstance(value, Instance):
            del self.lost[id(value)]
            held = value.attributes
            value.open, value.attributes = True, {}
            for each in held.values():
                self.lose(each, node)
        elif isinstance(value, list | tuple | dict):
            for each in list(value.values() if isinstance(value, dict) else value):
                self.lose(each, node)

    def later(self, value: Any) -> None:
        """A function that may be called at any time from here on."""
        function = value.function if isinstance(value, Bound) else value
        if not isinstance(function, Function) or id(function) in self.scanned:
            return
        self.scanned.add(id(function))
        nodes = [*ast.walk(function.node)]
        names = {each.id for each in nodes if isinstance(each, ast.Name) and _stores(each)}
        for each in nodes:
            if isinstance(each, ast.Global | ast.Nonlocal):
                self.haunted |= names & {*each.names}
                names -= {*each.names}
        calls = [each for each in nodes if isinstance(each, ast.Call)]
        builds = any(dotted(each.func).rpartition(".")[2] in CONTAINERS for each in calls)
        names |= {each.arg for each in nodes if isinstance(each, ast.arg)}
        for each in nodes:
            around = self._mentioned(function, each)
            self.later(around)
            base = dotted(each.value).rpartition(".")[2] if isinstance(each, ast.Attribute) else ""
            attribute = each.attr if isinstance(each, ast.Attribute) else ""
            adds = attribute == "add" and base in CONTAINERS
            adds |= isinstance(around, Library) and around.name.endswith((".add", ".add_auto"))
            opens = isinstance(each, ast.withitem) and dotted(each.context_expr) not in names
            builds_here = builds and not opens
            opens &= isinstance(around, Container)
            if ((attribute in _PRIVATE or adds) and not builds_here) or opens:
                node = each.context_expr if isinstance(each, ast.withitem) else each
                message = "this may change the machine while it runs"
                self.fault(node, message, "build the whole machine before it is executed")
            for changed in _changed_by(each):
                spot = changed.attr if isinstance(changed, ast.Attribute) else changed.id
                if isinstance(changed, ast.Attribute) or spot not in names:
                    self.haunted.add(spot)

    def _mentioned(self, function: Function, node: ast.AST) -> Any:
        """A value of a name, or a method of the class, that a function mentions."""
        if isinstance(node, ast.withitem):
            node = node.context_expr
        value: Any = None
        if isinstance(node, ast.Name):
            value = (function.scope.get(node.id) or (None,))[0]
        elif isinstance(node, ast.Attribute) and function.owner is not None:
            value = function.owner.get(node.attr)
        return value

    def changed_attribute(self, owner: Any, name: str, value: Any, node: ast.AST) -> None:
        """An attribute is assigned."""
        if isinstance(owner, Library):
            if owner.name.partition(".")[0] in FAMILY and "(" not in owner.name:
                self.fault(node, f"{owner.name}.{name} is replaced", "leave the library as it is")
            elif "(" not in owner.name and not owner.name.startswith("container."):
                self.lose(value, node)
        elif isinstance(owner, Container) and (name.startswith("_") or name in HARMLESS_METHODS):
            if name not in ("userdata", "name"):
                self.fault(node, f"{name!r} of a container is replaced", "leave it as it is")
        elif isinstance(owner, Instance) and name in ("_outcomes", "get_registered_outcomes"):
            self.fault(node, "the outcomes of a state are replaced", "hand them to its base class")
        elif isinstance(owner, Instance):
            self.write(owner.attributes, name, value)
        elif isinstance(owner, Class):
            self.write(owner.names, name, value)
        else:
            if name in (*CONTAINERS, "add", "add_auto", "State"):
                self.fault(node, f"{name!r} of an unknown object is replaced", "leave it as it is")
            self.lose(owner, node)
            self.lose(value, node)

    def changed_item(
        self, owner: Any, key: Any, node: ast.AST, value: Any = None, *, delete: bool = False
    ) -> None:
        """An item is assigned, or deleted."""
        if isinstance(owner, Container):
            self.fault(node, "the states of a container are replaced", "add other states")
        if not isinstance(owner, list | dict):
            if not isinstance(owner, Library):
                self.lose(value, node)
        elif not plain(key) or isinstance(key, list | dict):
            self.lose(owner, node)
        elif self.certain(owner):
            try:
                if delete:
                    del owner[key]
                else:
                    owner[key] = value
            except (LookupError, TypeError) as error:
                raise FailsError from error


def _end(action: Callable[[], object]) -> str:
    """The end of an action."""
    try:
        action()
    except RaiseError:
        return "raise"
    except LeaveError:
        return "leave"
    return ""


def _same(left: Any, right: Any) -> bool:
    simple = type(left) is type(right) and isinstance(left, str | int | float | Library)
    return left is right or (simple and bool(left == right))


def _stores(node: ast.Name) -> bool:
    return isinstance(node.ctx, ast.Store | ast.Del)


def in_family(value: Any) -> bool:
    """True for a name of SMACH or FlexBE."""
    return isinstance(value, Library) and value.name.partition(".")[0] in FAMILY


def _changed_by(node: ast.AST) -> Iterable[ast.Name | ast.Attribute]:
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
    """The nodes in a function, without those in functions of its own."""
    for child in ast.iter_child_nodes(node):
        yield child
        if not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            yield from own_nodes(child)
