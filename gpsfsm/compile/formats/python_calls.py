"""Functions, classes and calls of Python that is read and not executed.

A function or a class of the file is followed. A call of anything else may change what it is handed,
and may add states to a container that is open; so the one is unknown afterwards, the other refused.
"""

from __future__ import annotations

import ast
from abc import abstractmethod
from typing import TYPE_CHECKING, Any, Final

from gpsfsm.compile.formats.python_builders import (
    CONTAINERS,
    STATES,
    Arguments,
    Container,
    texts,
)
from gpsfsm.compile.formats.python_effects import (
    Expressions,
    LeaveError,
    RaiseError,
)
from gpsfsm.compile.formats.python_values import (
    CHANGING,
    KEEPING,
    UNKNOWN,
    Bound,
    Class,
    FailsError,
    Function,
    Instance,
    Library,
    Scope,
    dotted,
    function_result,
    in_family,
    method_result,
    own_nodes,
)
from gpsfsm.model.precision import Cause, Reading

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

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
_LEAVING = frozenset(
    {"print", "len", "str", "repr", "int", "float", "bool", "abs", "round", "isinstance", "super"}
    | {"issubclass", "callable", "hasattr", "id", "hash", "input", "open", "ord", "chr", "format"}
)
"""Functions that keep nothing of what they are handed, and return nothing of it."""
_TAKING = frozenset({"max", "min", "sum", "set", "frozenset", "any", "all", "list", "tuple"}) | {
    *("sorted", "dict", "zip", "enumerate", "reversed", "range")
}
"""Functions that do so with what is in it."""
_SPECIAL = ("__getattr__", "__getattribute__", "__setattr__", "__new__", "__enter__", "add")
_OVERRIDDEN = (*_SPECIAL, "__init_subclass__", "get_registered_outcomes", "register_outcomes")
_EXITS = ("sys.exit", "os._exit", "builtins.exit", "builtins.quit")


class Calls(Expressions):
    """The values of calls, and what they do."""

    def __init__(self) -> None:
        super().__init__()
        self.called: set[Any] = set()
        self.instances: list[Instance] = []
        self.depth = self.constructing = 0

    @abstractmethod
    def block(self, body: Sequence[ast.stmt], scope: Scope) -> None:
        """Follow statements."""

    # -- functions and classes --------------------------------------------------------------

    def function(self, node: ast.FunctionDef | ast.AsyncFunctionDef, scope: Scope) -> Any:
        """A function where it is defined."""
        decorators = [self.value(each, scope) for each in node.decorator_list]
        defaults = self.defaults(node.args, scope)
        written = [e.annotation for e in ast.walk(node.args) if isinstance(e, ast.arg)]
        self.either_of([each for each in (*written, node.returns) if each], scope)
        made = Function(node, scope if scope.body is None else scope.body, defaults)
        self.functions.append(made)
        made.static = decorators == [Library("builtins.staticmethod")]
        self._decorated([made], [] if made.static else decorators, node)
        return UNKNOWN if decorators and not made.static else made

    def defaults(self, parameters: ast.arguments, scope: Scope) -> dict[str, Any]:
        """The values of parameters that a call leaves out, which are evaluated once."""
        names = [each.arg for each in (*parameters.posonlyargs, *parameters.args)]
        values = [self.value(each, scope) for each in parameters.defaults]
        self.elements([each for each in parameters.kw_defaults if each], scope)
        return dict(zip(reversed(names), reversed(values), strict=False))

    def _decorated(self, made: Sequence[Function], decorators: list[Any], node: ast.AST) -> None:
        """Decorators are called at once, and may call what they decorate."""
        for decorator in decorators:
            for each in (*made, decorator):
                self.later(each)
            if not in_family(decorator) and self.open:
                self.fault(node, "what this decorator does is not followed", "leave it out")

    def class_of(self, node: ast.ClassDef, scope: Scope) -> Any:
        """A class where it is defined."""
        decorators = self.elements(node.decorator_list, scope) or []
        bases = [self.value(each, scope) for each in node.bases]
        self.elements([each.value for each in node.keywords], scope)
        inner = Scope(scope)
        inner.body = scope
        self.declare_names(own_nodes(node), inner)
        self.block(node.body, inner)
        functions = [each for each in inner.names.values() if isinstance(each, Function)]
        self._decorated(functions, decorators, node)
        for name, each in inner.names.items():
            if name.startswith("__") and name != "__init__":
                self.later(each)  # Python calls it by itself
        if node.keywords or node.decorator_list or {*inner.names} & {*_OVERRIDDEN}:
            return UNKNOWN
        bases = [each for each in bases if each != Library("builtins.object")]
        made = Class(node.name, bases, inner.names)
        for each in functions:
            each.owner = made
        return made

    def declare_names(self, nodes: Iterable[ast.AST], scope: Scope) -> None:
        """``global`` and ``nonlocal``: wherever one stands, it holds in all of its scope."""
        for node in nodes:
            if isinstance(node, ast.Global | ast.Nonlocal):
                for name in node.names:
                    around = scope.outer if isinstance(node, ast.Nonlocal) else None
                    while around is not None and name not in around.names:
                        around = around.outer
                    scope.elsewhere[name] = around or self.globals

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
            self.lose([owner, *(arguments or ()), *keywords.values()], node)
            return UNKNOWN
        if self.depth >= _DEEPEST:
            self.fault(node, "these functions call each other too deeply", "write them out")
            return UNKNOWN
        scope = Scope(function.scope, function.owner)
        self.declare_names(inner, scope)
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
        if partly:
            self.lose(result, None)
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

    def called_value(self, node: ast.Call, scope: Scope) -> Any:
        """The value of a call."""
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
        arguments = self.elements(node.args, scope)
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
                self.lose([value, arguments], each.value)
        return (None if hidden else arguments), keywords

    def _inherited(self, node: ast.expr, scope: Scope) -> Any:
        """A method of ``super()``; None for all else."""
        if not isinstance(node, ast.Attribute) or not isinstance(node.value, ast.Call):
            return None
        if dotted(node.value.func) != "super" or scope.owner is None or not scope.names:
            return None
        value = scope.owner.get(node.attr, inherited=True)
        return self.bound(value, next(iter(scope.names.values())))

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
            self.lose([owner, *(arguments or ()), *keywords.values()], node)
            return UNKNOWN
        self.sources[id(result[0])] = (result[0], owner)
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
            elif callee.name == "copy.copy":
                self.lose_inside(each)
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
        result = self.fresh(function_result(name, arguments, keywords))
        self.sources[id(result)] = (result, *arguments)
        for each in (*arguments, *keywords.values()) if result is UNKNOWN else ():
            if name in _TAKING:
                self.lose_inside(each)
            elif name not in _LEAVING:
                self.lose(each, node)
        return result

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
            method = self.of_container(arguments[0], last, node)
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
