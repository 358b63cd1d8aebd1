"""Expressions, values that are not certain, and paths that only a run decides.

A statement under a condition that the source does not decide is followed as if it were reached;
what it has changed is unknown afterwards. What is handed to code that is not followed is *lost*:
unknown from then on. Names that a function writes which is called later are *haunted*: unknown
at any time. So is what an unknown value may be or hold: whoever gets it may change it unseen.

    if foo(): then = "DOCK"    from here on `then` is unknown, if it was anything before
"""

from __future__ import annotations

import ast
import builtins
from abc import abstractmethod
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from gpsfsm.compile.formats.python_builders import (
    CONTAINERS,
    HARMLESS_METHODS,
    STATES,
    Builder,
    Container,
)
from gpsfsm.compile.formats.python_values import (
    FAMILY,
    UNKNOWN,
    Bound,
    Class,
    FailsError,
    Function,
    Instance,
    Library,
    Scope,
    changed_by,
    compared,
    dotted,
    joined_text,
    mentioned,
    negated,
    operated,
    plain,
    row,
    same,
    stores,
    truth,
    used_up,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

_PRIVATE = frozenset(
    {"set_initial_state", "add_auto", "register_outcomes", "_transitions", "_states"}
    | {"_initial_state_label", "_connector_outcomes", "_outcome_map", "_default_outcome"}
    | {"_conditions", "_labels"}
)
MOST_STEPS: Final = 50_000
_MOST_ROUNDS: Final = 8
MISSING: Final[Any] = object()
MOST_VALUES: Final = 500_000
_Comprehension = ast.ListComp | ast.SetComp | ast.DictComp | ast.GeneratorExp


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
        self.catching = 0  # statements around that may end an exception
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
                ends.append(self._end(action))
            finally:
                rows, self.branch, self.journal = self.journal, outside, journal
                self.open = opened
            for mapping, key, old in {(id(e[0]), e[1]): e for e in reversed(rows)}.values():
                value = mapping.pop(key, MISSING)
                if old is not MISSING:
                    mapping[key] = old
                if ends[-1] == "raise" and not (torn or self.catching):
                    continue
                lasting = not torn or isinstance(value, Library | Function | Class)
                kept = lasting and (old is MISSING or same(old, value))
                changed |= not kept and old is not UNKNOWN
                if not kept:
                    self._forget(old, value, torn=torn)
                self.write(mapping, key, value if kept else UNKNOWN)
        self.left |= "leave" in ends
        if {*ends} == {"raise"} and not torn:
            raise RaiseError
        self.left |= {*ends} == {"raise"}  # what swallows it goes on
        return changed or len(self.lost) > before

    def _forget(self, *values: Any, torn: bool) -> None:
        """Values that a name had, which has an unknown one now: it may be one of these."""
        for each in values:
            inside = isinstance(each, Container) and len(each.branch) > len(self.branch)
            if each is not MISSING and not (torn and inside):  # those are ``torn`` themselves
                self.lose(each, None)

    def _end(self, action: Callable[[], object]) -> str:
        """The end of an action."""
        try:
            action()
        except RaiseError:
            return "raise"
        except LeaveError as left:
            self.lose(left.value, None)
            return "leave"
        return ""

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
        else:
            self.lose_inside(value, node)

    def lose_inside(self, value: Any, node: ast.AST | None = None) -> None:
        """Code that is not followed gets what is in a row; one that is used up is at its end."""
        if row(value) and not isinstance(value, str | range):
            for each in list(value.values() if isinstance(value, dict) else value):
                self.lose(each, node)

    def later(self, value: Any) -> None:
        """A function that may be called at any time from here on."""
        function = value.function if isinstance(value, Bound) else value
        if not isinstance(function, Function) or id(function) in self.scanned:
            return
        self.scanned.add(id(function))
        nodes = [*ast.walk(function.node)]
        names = {each.id for each in nodes if isinstance(each, ast.Name) and stores(each)}
        for each in nodes:
            if isinstance(each, ast.Global | ast.Nonlocal):
                self.haunted |= names & {*each.names}
                names -= {*each.names}
        calls = [each for each in nodes if isinstance(each, ast.Call)]
        builds = any(dotted(each.func).rpartition(".")[2] in CONTAINERS for each in calls)
        names |= {each.arg for each in nodes if isinstance(each, ast.arg)}
        for each in nodes:
            around = mentioned(function, each)
            self.later(around)
            if isinstance(each, ast.Return) and isinstance(each.value, ast.Name):
                for returned in function.scope.get(each.value.id) or ():
                    if not isinstance(returned, Container) and each.value.id not in names:
                        self.lose(returned, None)
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
            for changed in changed_by(each):
                spot = changed.attr if isinstance(changed, ast.Attribute) else changed.id
                if isinstance(changed, ast.Attribute) or spot not in names:
                    self.haunted.add(spot)
                    for held in function.scope.get(spot) or ():
                        self.lose(held, None)

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


class Expressions(Effects):
    """The values of expressions."""

    def __init__(self) -> None:
        super().__init__()
        self.globals = Scope()
        self.functions: list[Function] = []
        self.strangers = False  # another file may give names that are not seen
        self.values = 0

    @abstractmethod
    def assign(self, target: ast.expr, value: Any, scope: Scope) -> None:
        """Follow an assignment."""

    @abstractmethod
    def called_value(self, node: ast.Call, scope: Scope) -> Any:
        """Follow a call."""

    @abstractmethod
    def defaults(self, parameters: ast.arguments, scope: Scope) -> dict[str, Any]:
        """The values of parameters that a call leaves out."""

    def value(self, node: ast.expr, scope: Scope) -> Any:
        """The value of an expression, as far as the source says it."""
        self.values += 1
        if self.values > MOST_VALUES:
            raise TooMuchError
        match node:
            case ast.Constant():
                return node.value
            case ast.Name():
                result = self._name(node.id, scope)
            case ast.Attribute():
                result = self.attribute(self.value(node.value, scope), node.attr, node)
            case ast.Call():
                result = self.called_value(node, scope)
            case ast.List() | ast.Tuple():
                rows = self.elements(node.elts, scope)
                result = UNKNOWN if rows is None else rows
                if isinstance(node, ast.Tuple) and rows is not None:
                    result = tuple(rows)
                self.fresh(result)
            case ast.Dict():
                result = self.fresh(self._dictionary(node, scope))
            case _:
                result = self._combined(node, scope)
        return UNKNOWN if id(result) in self.lost else result

    def _name(self, name: str, scope: Scope) -> Any:
        if name in self.haunted:
            return UNKNOWN
        value = scope.get(name)
        if value is not None:
            return value[0]
        if name == "__name__":
            return "__main__"  # the file is the program
        if hasattr(builtins, name):
            return Library(f"builtins.{name}")
        if self.strangers and name in ("smach", "smach_ros", *CONTAINERS, *STATES):
            return Library(name if name in FAMILY else f"smach.{name}")
        return UNKNOWN

    def elements(self, nodes: Iterable[ast.expr], scope: Scope) -> list[Any] | None:
        """Values in their order; None where a star hides how many, and who has them then."""
        result: list[Any] | None = []
        every: list[Any] = []
        for each in nodes:
            value = self.value(each.value if isinstance(each, ast.Starred) else each, scope)
            every.append(value)
            if not isinstance(each, ast.Starred):
                if result is not None:
                    result.append(value)
            elif result is None or not row(value):
                result = None
            else:
                result.extend(value)
        if result is None:
            self.lose(every, None)
        return result

    def _dictionary(self, node: ast.Dict, scope: Scope) -> Any:
        result: Any = {}
        every: list[Any] = []
        for key, each in zip(node.keys, node.values, strict=True):
            name = None if key is None else self.value(key, scope)
            value = self.value(each, scope)
            every.append(value)
            if key is None and isinstance(value, dict) and result is not UNKNOWN:
                result.update(value)
            elif key is None or not plain(name) or isinstance(name, list | dict):
                result = UNKNOWN
            elif result is not UNKNOWN:
                result[name] = value
        if result is UNKNOWN:
            self.lose(every, node)
        return result

    def _combined(self, node: ast.expr, scope: Scope) -> Any:
        match node:
            case ast.JoinedStr():
                return joined_text([self._part(each, scope) for each in node.values])
            case ast.BinOp():
                left, right = self.value(node.left, scope), self.value(node.right, scope)
                return self._of_parts(self.fresh(operated(node.op, left, right)), left, right)
            case ast.UnaryOp():
                return negated(node.op, self.value(node.operand, scope))
            case ast.BoolOp():
                return self._either(node.values, scope, stop=isinstance(node.op, ast.Or))
            case ast.Compare():
                return self._compare(node, scope)
            case ast.IfExp():
                test = truth(self.value(node.test, scope))
                if test is UNKNOWN:
                    return self.either_of((node.body, node.orelse), scope)
                return self.value(node.body if test else node.orelse, scope)
            case ast.Subscript():
                return self._item(node, scope)
            case ast.NamedExpr():
                value = self.value(node.value, scope)
                while scope.passing and scope.outer is not None:
                    scope = scope.outer
                self.assign(node.target, value, scope)
                return value
            case ast.Lambda():
                made = Function(node, scope, self.defaults(node.args, scope))
                self.functions.append(made)
                self.later(made)
                return made
            case ast.ListComp() | ast.DictComp() | ast.SetComp() | ast.GeneratorExp():
                return self._comprehended(node, Scope(scope, passing=True))
        self.all_of(node, scope)
        return UNKNOWN

    def _of_parts(self, result: Any, *parts: Any) -> Any:
        """A result; if it is unknown, who has what is in its parts is not known either."""
        for each in parts if result is UNKNOWN else ():
            self.lose_inside(each)
        return result

    def _comprehended(self, node: _Comprehension, scope: Scope) -> Any:
        """The rows of a comprehension, as far as the source says them."""
        rows: list[Any] = []
        parts = [node.key, node.value] if isinstance(node, ast.DictComp) else [node.elt]
        if isinstance(node, ast.GeneratorExp) or not self._rounds(
            node.generators, parts, rows, scope
        ):
            self.repeated(lambda: self.all_of(node, scope))
        elif isinstance(node, ast.ListComp):
            return self.fresh([each for (each,) in rows])
        elif isinstance(node, ast.DictComp) and all(isinstance(each[0], str) for each in rows):
            return self.fresh(dict(rows))
        self.lose(rows, None)
        return UNKNOWN

    def _rounds(
        self,
        loops: Sequence[ast.comprehension],
        parts: Sequence[ast.expr],
        rows: list[Any],
        scope: Scope,
    ) -> bool:
        """Go through the loops of a comprehension; False where a run decides how."""
        if not loops:
            rows.append([self.value(each, scope) for each in parts])
            return True
        first, *inner = loops
        through = self.value(first.iter, scope)
        if not row(through) or first.is_async or (self.branch and used_up(through)):
            return False
        try:
            for each in through:
                self.step()
                self.assign(first.target, each, scope)
                test = truth(self._either(first.ifs, scope, stop=False) if first.ifs else True)
                if test is UNKNOWN or (test and not self._rounds(inner, parts, rows, scope)):
                    return False
                if self.stale(through):
                    return False
        except RuntimeError as error:  # its size has changed
            if isinstance(error, RecursionError):
                raise
            raise FailsError from error
        return True

    def all_of(self, node: ast.AST, scope: Scope) -> None:
        """All expressions in one that is not followed itself."""
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.comprehension):
                self.lose_inside(self.value(child.iter, scope))
                self.assign(child.target, UNKNOWN, scope)
                self.elements(child.ifs, scope)
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.expr):
                self._lost(child, scope)

    def _lost(self, node: ast.expr, scope: Scope) -> None:
        self.lose(self.value(node, scope), node)

    def either_of(self, nodes: Sequence[ast.expr], scope: Scope) -> Any:
        """Expressions of which only a run decides whether they are evaluated."""
        for each in nodes:
            self.perhaps(partial(self._lost, each, scope), lambda: None)
        return UNKNOWN

    def _either(self, nodes: Sequence[ast.expr], scope: Scope, *, stop: bool) -> Any:
        value: Any = UNKNOWN
        for number, each in enumerate(nodes):
            value = self.value(each, scope)
            test = truth(value)
            if test is UNKNOWN and number + 1 < len(nodes):
                self.lose(value, each)
                return self.either_of(nodes[number + 1 :], scope)
            if test is stop:
                return value
        return value

    def _compare(self, node: ast.Compare, scope: Scope) -> Any:
        left, result = self.value(node.left, scope), True
        for number, (kind, each) in enumerate(zip(node.ops, node.comparators, strict=True)):
            right = self.value(each, scope)
            result = compared(kind, left, right)
            if result is UNKNOWN:
                return self.either_of(node.comparators[number + 1 :], scope)
            if not result:
                return False
            left = right
        return result

    def _part(self, node: ast.expr, scope: Scope) -> Any:
        """A part of a formatted text; unknown if it is written in a form of its own."""
        if not isinstance(node, ast.FormattedValue):
            return self.value(node, scope)
        simple = node.format_spec is None and node.conversion == -1
        value = self.value(node.value, scope)
        if node.format_spec is not None:
            self.value(node.format_spec, scope)
        return value if simple else UNKNOWN

    def _item(self, node: ast.Subscript, scope: Scope) -> Any:
        return self.item(self.value(node.value, scope), self.value(node.slice, scope), node)

    def item(self, whole: Any, key: Any, node: ast.AST) -> Any:
        """An item of a value."""
        if isinstance(whole, Container):
            self.fault(node, "the states of a container are not followed", "write them out")
        if not isinstance(whole, dict | list | tuple | str) or not plain(key):
            return self._of_parts(UNKNOWN, whole)
        try:
            return whole[key]
        except (LookupError, TypeError) as error:
            raise FailsError from error

    def attribute(self, owner: Any, name: str, node: ast.AST) -> Any:
        """An attribute of a value."""
        if isinstance(owner, Library):
            return Library(f"{owner.name}.{name}")
        if name in self.haunted:
            return UNKNOWN
        if isinstance(owner, Class):
            value = owner.get(name)
            return UNKNOWN if value is None else value
        if isinstance(owner, Instance):
            value = None if owner.of is None else owner.of.get(name)
            value = owner.attributes.get(name, value)
            if isinstance(owner, Container) and (value is None or isinstance(value, Library)):
                return self.of_container(owner, name, node)
            return self.bound(value, owner)
        if isinstance(owner, Bound):
            self.lose(owner, node)
        return Bound(name, owner) if isinstance(owner, str | list | dict | tuple) else UNKNOWN

    def bound(self, value: Any, owner: Any) -> Any:
        """A method with the object that it belongs to; another value as it is."""
        if isinstance(value, Function) and value.owner is not None and not value.static:
            return Bound(value, owner)
        if isinstance(value, Library) and value.name.partition(".")[0] in FAMILY:
            return Bound(value, owner)
        return UNKNOWN if value is None else value

    def of_container(self, owner: Container, name: str, node: ast.AST) -> Any:
        """An attribute of a container."""
        if name in ("add", "add_auto"):
            return Library(f"smach.{owner.kind}.{name}")
        if name in ("execute", "async_execute"):
            self.executed.append(owner)
        if name in ("set_initial_state", "initial_state", "open", "close", "opened"):
            return Bound(name, owner)
        if name in HARMLESS_METHODS:
            return Library(f"container.{name}")
        message = f"{name!r} of a container is not followed"
        self.fault(node, message, "build the machine with add and set_initial_state only")
        return UNKNOWN
