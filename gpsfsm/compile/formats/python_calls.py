"""Expressions and calls of Python that is read and not executed.

A function or a class of the file is followed. A call of anything else may change what it is handed,
and may add states to a container that is open; so the one is unknown afterwards, the other refused.
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
    Arguments,
    Container,
    texts,
)
from gpsfsm.compile.formats.python_effects import (
    FAMILY,
    KEEPING,
    Effects,
    LeaveError,
    RaiseError,
    TooMuchError,
    in_family,
    own_nodes,
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
    Scope,
    compared,
    dotted,
    function_result,
    joined_text,
    method_result,
    operated,
    plain,
    row,
    truth,
)
from gpsfsm.model.precision import Cause, Reading

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

MOST_VALUES: Final = 500_000
_DEEPEST: Final = 12
_HARMLESS = frozenset(
    {"rospy", "roslib", "rclpy", "time", "math", "os", "sys", "logging", "threading", "actionlib"}
    | {"tf", "numpy", "copy", "json", "datetime", "signal", "argparse", "re", "random", "container"}
    | {"actionlib_msgs", "collections", "itertools", "string", "traceback", "functools", "self"}
)
"""Modules that know nothing of machines."""
_WITH_MACHINES = ("IntrospectionServer", "ActionServerWrapper", "set_preempt_handler", "Bag")
_FORBIDDEN = frozenset(
    {"exec", "eval", "compile", "globals", "locals", "vars", "__import__", "setattr", "delattr"}
    | {"getattr", "type", "breakpoint"}
)
_SPECIAL = ("__getattr__", "__getattribute__", "__setattr__", "__new__", "__enter__", "add")
_OVERRIDDEN = (*_SPECIAL, "__init_subclass__", "get_registered_outcomes", "register_outcomes")
_EXITS = ("sys.exit", "os._exit", "builtins.exit", "builtins.quit")


class Calls(Effects):
    """The values of expressions, and what calls do."""

    def __init__(self) -> None:
        super().__init__()
        self.globals = Scope()
        self.functions: list[Function] = []
        self.called: set[Any] = set()
        self.instances: list[Instance] = []
        self.strangers = False  # another file may give names that are not seen
        self.depth = self.values = self.constructing = 0

    @abstractmethod
    def block(self, body: Sequence[ast.stmt], scope: Scope) -> None:
        """Follow statements."""

    @abstractmethod
    def assign(self, target: ast.expr, value: Any, scope: Scope) -> None:
        """Follow an assignment."""

    # -- expressions ------------------------------------------------------------------------

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
                result = self._called(node, scope)
            case ast.List() | ast.Tuple():
                rows = self._elements(node.elts, scope)
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

    def _elements(self, nodes: Iterable[ast.expr], scope: Scope) -> list[Any] | None:
        """Values in their order; None where a star hides how many."""
        result: list[Any] | None = []
        for each in nodes:
            value = self.value(each.value if isinstance(each, ast.Starred) else each, scope)
            if not isinstance(each, ast.Starred):
                if result is not None:
                    result.append(value)
            elif result is None or not row(value):
                result = None
            else:
                result.extend(value)
        return result

    def _dictionary(self, node: ast.Dict, scope: Scope) -> Any:
        result: Any = {}
        for key, each in zip(node.keys, node.values, strict=True):
            name = None if key is None else self.value(key, scope)
            value = self.value(each, scope)
            if key is None and isinstance(value, dict) and result is not UNKNOWN:
                result.update(value)
            elif key is None or not plain(name) or isinstance(name, list | dict):
                result = UNKNOWN
            elif result is not UNKNOWN:
                result[name] = value
        return result

    def _combined(self, node: ast.expr, scope: Scope) -> Any:
        match node:
            case ast.JoinedStr():
                return joined_text([self._part(each, scope) for each in node.values])
            case ast.BinOp():
                left, right = self.value(node.left, scope), self.value(node.right, scope)
                return self.fresh(operated(node.op, left, right))
            case ast.UnaryOp():
                return self._unary(node, scope)
            case ast.BoolOp():
                return self._either(node.values, scope, stop=isinstance(node.op, ast.Or))
            case ast.Compare():
                return self._compare(node, scope)
            case ast.IfExp():
                test = truth(self.value(node.test, scope))
                if test is UNKNOWN:
                    return self._either_of((node.body, node.orelse), scope)
                return self.value(node.body if test else node.orelse, scope)
            case ast.Subscript():
                return self._item(node, scope)
            case ast.NamedExpr():
                value = self.value(node.value, scope)
                self.assign(node.target, value, scope)
                return value
            case ast.Lambda():
                made = Function(node, scope)
                self.functions.append(made)
                self.later(made)
                return made
        self._all_of(node, scope)
        return UNKNOWN

    def _all_of(self, node: ast.AST, scope: Scope) -> None:
        """All expressions in one that is not followed itself."""
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.comprehension):
                self.value(child.iter, scope)
                self.assign(child.target, UNKNOWN, scope)
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.expr):
                self.value(child, scope)

    def _either_of(self, nodes: Sequence[ast.expr], scope: Scope) -> Any:
        """Expressions of which only a run decides whether they are evaluated."""
        for each in nodes:
            self.perhaps(partial(self.value, each, scope), lambda: None)
        return UNKNOWN

    def _unary(self, node: ast.UnaryOp, scope: Scope) -> Any:
        value = self.value(node.operand, scope)
        if isinstance(node.op, ast.Not):
            test = truth(value)
            return test if test is UNKNOWN else not test
        negative = isinstance(node.op, ast.USub) and isinstance(value, int | float)
        return -value if negative else UNKNOWN

    def _either(self, nodes: Sequence[ast.expr], scope: Scope, *, stop: bool) -> Any:
        value: Any = UNKNOWN
        for number, each in enumerate(nodes):
            value = self.value(each, scope)
            test = truth(value)
            if test is UNKNOWN and number + 1 < len(nodes):
                return self._either_of(nodes[number + 1 :], scope)
            if test is stop:
                return value
        return value

    def _compare(self, node: ast.Compare, scope: Scope) -> Any:
        left, result = self.value(node.left, scope), True
        for number, (kind, each) in enumerate(zip(node.ops, node.comparators, strict=True)):
            right = self.value(each, scope)
            result = compared(kind, left, right)
            if result is UNKNOWN:
                return self._either_of(node.comparators[number + 1 :], scope)
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
        return value if simple else UNKNOWN

    def _item(self, node: ast.Subscript, scope: Scope) -> Any:
        whole = self.value(node.value, scope)
        key = self.value(node.slice, scope)
        if isinstance(whole, Container):
            self.fault(node, "the states of a container are not followed", "write them out")
        if not isinstance(whole, dict | list | tuple | str) or not plain(key):
            return UNKNOWN
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
                return self._of_container(owner, name, node)
            return self._bound(value, owner)
        return Bound(name, owner) if isinstance(owner, str | list | dict | tuple) else UNKNOWN

    def _bound(self, value: Any, owner: Any) -> Any:
        if isinstance(value, Function) and value.owner is not None and not value.static:
            return Bound(value, owner)
        if isinstance(value, Library) and value.name.partition(".")[0] in FAMILY:
            return Bound(value, owner)
        return UNKNOWN if value is None else value

    def _of_container(self, owner: Container, name: str, node: ast.AST) -> Any:
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

    # -- functions and classes --------------------------------------------------------------

    def function(self, node: ast.FunctionDef, scope: Scope) -> Any:
        """A function where it is defined."""
        parameters = node.args
        made = Function(node, scope if scope.body is None else scope.body)
        names = [each.arg for each in (*parameters.posonlyargs, *parameters.args)]
        values = [self.value(each, scope) for each in parameters.defaults]
        made.defaults = dict(zip(reversed(names), reversed(values), strict=False))
        self.functions.append(made)
        for each in node.decorator_list:
            decorator = self.value(each, scope)
            made.static = decorator == Library("builtins.staticmethod")
            if not made.static:
                self.later(made)
                if not in_family(decorator) and self.open:
                    self.fault(each, "what this decorator does is not followed", "leave it out")
                return UNKNOWN
        return made

    def class_of(self, node: ast.ClassDef, scope: Scope) -> Any:
        """A class where it is defined."""
        bases = [self.value(each, scope) for each in node.bases]
        inner = Scope(scope)
        inner.body = scope
        self.block(node.body, inner)
        if node.keywords or node.decorator_list or {*inner.names} & {*_OVERRIDDEN}:
            return UNKNOWN
        bases = [each for each in bases if each != Library("builtins.object")]
        made = Class(node.name, bases, inner.names)
        for each in inner.names.values():
            if isinstance(each, Function):
                each.owner = made
        return made

    def call(
        self,
        function: Function,
        arguments: list[Any] | None,
        keywords: dict[str, Any],
        node: ast.AST,
        *,
        owner: Any = None,
    ) -> Any:
        """A call of a function of the file. Arguments that are None may be any."""
        self.called.add(function)
        inner = [*own_nodes(function.node)]
        if any(isinstance(each, ast.Yield | ast.YieldFrom | ast.Await) for each in inner):
            self.later(function)
            return UNKNOWN
        if self.depth >= _DEEPEST:
            self.fault(node, "these functions call each other too deeply", "write them out")
            return UNKNOWN
        scope = Scope(function.scope, function.owner)
        self._bind(function, scope, arguments, keywords, owner)
        left, self.left = self.left, False
        result = None
        self.depth += 1
        try:
            if isinstance(function.node, ast.Lambda):
                return self.value(function.node.body, scope)
            self.block(function.node.body, scope)
        except LeaveError as returned:
            result = returned.value
        finally:
            self.depth -= 1
            partly, self.left = self.left, left
        return UNKNOWN if partly else result

    def _bind(
        self,
        function: Function,
        scope: Scope,
        arguments: list[Any] | None,
        keywords: dict[str, Any],
        owner: Any,
    ) -> None:
        parameters = function.node.args
        names = [each.arg for each in (*parameters.posonlyargs, *parameters.args)]
        every = [each.arg for each in ast.walk(parameters) if isinstance(each, ast.arg)]
        scope.names = dict.fromkeys(every, UNKNOWN)
        own = [] if owner is None else [owner]
        simple = len(every) == len(names)
        if arguments is None or not simple:
            scope.names |= dict(zip(names, own, strict=False))
            for each in (*(arguments or ()), *keywords.values()):
                self.lose(each, function.node)
            return
        arguments = [*own, *arguments]
        if (
            len(arguments) > len(names)
            or {*names[: len(arguments)]} & {*keywords}
            or {*keywords} - {*names}
            or {*names[len(arguments) :]} - {*keywords, *function.defaults}
        ):
            raise FailsError
        scope.names |= function.defaults | dict(zip(names, arguments, strict=False)) | keywords

    def _instance(self, kind: Class, node: ast.Call, passed: Arguments) -> Any:
        """An object of a class of the file: a state, a container, or something else."""
        arguments, keywords = passed
        self.called.add(kind)
        bases = [each for each in kind.line() if not isinstance(each, Class)]
        last = bases[0].name.rpartition(".")[2] if bases and in_family(bases[0]) else ""
        if last in CONTAINERS:
            made: Instance = self._container(node, last, kind)
        else:
            made = Instance(kind.name, kind, parameters=_shown(keywords))
        self.instances.append(self.fresh(made))
        init = kind.get("__init__")
        self.constructing += not isinstance(made, Container)
        try:
            if isinstance(init, Function):
                self.call(init, arguments, keywords, node, owner=made)
            elif isinstance(init, Library) and in_family(init):
                self.initialised(made, last, node, passed)
            else:
                self._unread(node, dotted(node.func) or "A", passed)
        finally:
            self.constructing -= not isinstance(made, Container)
        return made

    def _container(self, node: ast.Call, kind: str, of: Class | None = None) -> Container:
        made = Container(kind=kind, of=of, place=self.place(node), branch=self.branch)
        self.containers.append(made)
        return made

    # -- calls ------------------------------------------------------------------------------

    def _called(self, node: ast.Call, scope: Scope) -> Any:
        callee = self._inherited(node.func, scope) or self.value(node.func, scope)
        passed = self._arguments_of(node, scope)
        arguments, keywords = passed
        if isinstance(callee, Bound) and isinstance(callee.function, Function):
            return self.call(callee.function, arguments, keywords, node, owner=callee.owner)
        if isinstance(callee, Bound):
            return self._method(callee, node, passed)
        if isinstance(callee, Function):
            return self.call(callee, arguments, keywords, node)
        if isinstance(callee, Class):
            return self._instance(callee, node, passed)
        if isinstance(callee, Library):
            return self._library(callee, node, passed)
        if isinstance(node.func, ast.Attribute) and dotted(node.func):
            self.lose(self.value(node.func.value, scope), node)
        self.lose(callee, node)
        return self._unread(node, dotted(node.func), passed)

    def _arguments_of(self, node: ast.Call, scope: Scope) -> Arguments:
        arguments = self._elements(node.args, scope)
        keywords: dict[str, Any] = {}
        hidden = False
        for each in node.keywords:
            value = self.value(each.value, scope)
            if each.arg is not None:
                keywords[each.arg] = value
            elif isinstance(value, dict) and all(isinstance(key, str) for key in value):
                keywords |= value
            else:
                hidden = True
        return (None if hidden else arguments), keywords

    def _inherited(self, node: ast.expr, scope: Scope) -> Any:
        """A method of ``super()``; None for all else."""
        if not isinstance(node, ast.Attribute) or not isinstance(node.value, ast.Call):
            return None
        if dotted(node.value.func) != "super" or scope.owner is None or not scope.names:
            return None
        value = scope.owner.get(node.attr, inherited=True)
        return self._bound(value, next(iter(scope.names.values())))

    def _method(self, callee: Bound, node: ast.Call, passed: Arguments) -> Any:
        """A method of a container, or of a text, a list or a dictionary; or of a base class."""
        arguments, keywords = passed
        name, owner = callee.function, callee.owner
        if isinstance(name, Library):
            inherited = None if arguments is None else [owner, *arguments]
            return self._library(name, node, (inherited, keywords))
        if isinstance(owner, Container):
            return self.opened(owner, name, node, arguments or [])
        changing = name in CHANGING and not isinstance(owner, str | tuple)
        if changing and not self.certain(owner):
            return UNKNOWN
        result = None if arguments is None else method_result(owner, name, arguments, keywords)
        if result is None:
            self.lose(owner, node)
            for each in (*(arguments or ()), *keywords.values()):
                self.later(each)
            return UNKNOWN
        return self.fresh(result[0]) if name in ("copy", "split") else result[0]

    def _library(self, callee: Library, node: ast.Call, passed: Arguments) -> Any:
        """A call of something that is imported or built in."""
        arguments, keywords = passed
        root = callee.name.partition(".")[0]
        if callee.name in _EXITS:
            raise RaiseError
        if root == "builtins":
            return self._built_in(callee.name[9:], node, passed)
        if in_family(callee):
            return self._of_family(callee, node, passed)
        if root not in _HARMLESS and not _is_message(callee.name):
            return self._unread(node, dotted(node.func) or callee.name, passed)
        for each in (*(arguments or ()), *keywords.values()):
            if isinstance(each, Container) or root not in KEEPING:
                self.lose(each, node)
            self.later(each)
        return Library(f"{callee.name}()")

    def _built_in(self, name: str, node: ast.Call, passed: Arguments) -> Any:
        arguments, keywords = passed
        if name in _FORBIDDEN:
            self.fault(node, f"what {name}() does is not followed", "write it out")
            return UNKNOWN
        if arguments is None:
            return UNKNOWN
        for each in (*arguments, *keywords.values()):
            self.later(each)
        for each in arguments if name in ("next", "map", "filter") else ():
            self.lose(each, node)
        return self.fresh(function_result(name, arguments, keywords))

    def _of_family(self, callee: Library, node: ast.Call, passed: Arguments) -> Any:
        """A call of SMACH or FlexBE."""
        arguments, keywords = passed
        *_, kind, last = ("", *callee.name.split("."))
        builder = kind in CONTAINERS and last in ("add", "add_auto")
        if last == "Iterator":
            hint = "check the machine that is repeated by itself"
            self.fault(node, "how often an Iterator repeats is not read", hint)
            return UNKNOWN
        if arguments is None and (builder or last in CONTAINERS or kind in CONTAINERS):
            self.fault(node, f"the arguments of {last} are not written in the source", "write them")
            return UNKNOWN
        if builder:
            return self.add(f"{kind}.{last}", node, arguments or [], keywords)
        if last in CONTAINERS:
            made = self._container(node, last)
            self.initialised(made, last, node, passed)
            return made
        if last == "__init__" and arguments:
            self.initialised(arguments[0], kind, node, (arguments[1:], keywords))
            return None
        if kind in CONTAINERS and arguments and isinstance(arguments[0], Container):
            method = self._of_container(arguments[0], last, node)
            return (
                self._method(method, node, (arguments[1:], keywords))
                if isinstance(method, Bound)
                else UNKNOWN
            )
        name = dotted(node.func).removeprefix("self.") or last
        if last in STATES:
            state = self.fresh(Instance(name, parameters=_shown(keywords)))
            self.declare(state, last, passed)
            return state
        if last == "use_behavior":
            return Instance(name, parameters=_shown(keywords))
        if last == "register_outcomes" and arguments and isinstance(arguments[0], Instance):
            rows = self.settled(arguments[1]) if len(arguments) > 1 else UNKNOWN
            arguments[0].outcomes += tuple(rows) if texts(rows) else ()
            arguments[0].open |= not texts(rows) or not self.certain(arguments[0])
            return None
        for each in (*(arguments or ()), *keywords.values()):
            self.later(each)
            if isinstance(each, Container) and last not in _WITH_MACHINES:
                self.lose(each, node)
            elif isinstance(each, Container) and last == "ActionServerWrapper":
                self.executed.append(each)
        return Library(f"{callee.name}()")

    def _unread(self, node: ast.Call, name: str, passed: Arguments) -> Any:
        """A call of code that is not followed."""
        arguments, keywords = passed
        constructor = name.rpartition(".")[2].rpartition("__")[2][:1].isupper()
        if self.open and not constructor and self.constructing:
            self.note(Reading.DEFAULTED, f"{name}()", node, Cause.ADDS_NOTHING)
        elif self.open and not constructor:
            message = f"{name or 'this call'}() may add states to the container that is open here"
            self.fault(node, message, "call it outside of the container, or add the states here")
        outcomes = self.settled(keywords.get("outcomes"))
        for each in (*(arguments or ()), *keywords.values()):
            self.lose(each, node)
        if not constructor and not name.endswith("use_behavior"):
            return UNKNOWN
        own = tuple(outcomes) if texts(outcomes) else ()
        return Instance(name.removeprefix("self."), outcomes=own, parameters=_shown(keywords))


def _is_message(name: str) -> bool:
    root, _, rest = name.partition(".")
    return root.endswith(("_msgs", "_srvs")) or rest.partition(".")[0] in ("msg", "srv", "action")


def _shown(keywords: dict[str, Any]) -> dict[str, Any]:
    """The parameters of a state that a report shows."""
    return {key: each for key, each in keywords.items() if isinstance(each, str | int | float)}
