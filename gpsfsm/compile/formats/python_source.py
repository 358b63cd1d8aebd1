"""FlexBE and SMACH: Python that builds a state machine → the machine. It is never executed.

https://github.com/FlexBE/flexbe_behavior_engine, https://github.com/ros/executive_smach. Levels of
autonomy and data are left out, and a behaviour that uses another one has it as one state.

Both write machines as Python: a container is made, a ``with`` block adds states to it.
The statements are followed in their order, with the values that are written in the source: texts,
numbers, lists, dictionaries, what is put together of them, and functions and classes of the same
file that build parts. Everything else is unknown; a transition that is unknown is refused at its
line.

    sm = StateMachine(outcomes=["done"])
    with sm:
        for name in ["A", "B"]:
            StateMachine.add(name, Wait(), transitions={"ok": "done"})       two states, A and B
"""

from __future__ import annotations

import ast
import copy
import re
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from gpsfsm.compile.formats import Format
from gpsfsm.compile.formats.elements import problem
from gpsfsm.compile.formats.outcomes import State, machine_from
from gpsfsm.compile.formats.python_values import (
    LONGEST,
    UNKNOWN,
    Instance,
    called,
    compared,
    described,
    dotted,
    joined_text,
    operated,
    text_row,
)
from gpsfsm.compile.machines import Place
from gpsfsm.model.plan import Location
from gpsfsm.syntax.text import Lines

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.compile.machines import ReadMachine
    from gpsfsm.model.finding import Problem
    from gpsfsm.syntax.source import Limits

MOST_STEPS: Final = 50_000
MOST_VALUES: Final = 500_000
MOST_COPIES: Final = 5_000
_DEEPEST: Final = 12
_PRINT = re.compile(r"^([ \t]*)print\b(?!\s*\().*$", re.M)
_EXCEPT = re.compile(r"^([ \t]*except\s+[\w.()]+), ?(\w+)[ \t]*:", re.M)

SEQUENTIAL = ("StateMachine", "OperatableStateMachine", "PriorityContainer")
PARALLEL = ("Concurrence", "ConcurrencyContainer")
_ROW = "Sequence"


@dataclass(slots=True)
class _Function:
    node: ast.FunctionDef
    names: dict[str, Any]


@dataclass(slots=True)
class _Class:
    node: ast.ClassDef
    names: dict[str, Any]


class _LeaveError(Exception):
    """A statement that leaves the block around it: a loop's break and continue, or a return."""


class _BreakError(_LeaveError):
    pass


class _ContinueError(_LeaveError):
    pass


class _ReturnError(_LeaveError):
    def __init__(self, value: Any) -> None:
        super().__init__()
        self.value = value


class _TooMuchError(Exception):
    """More statements than are followed."""


class Source:
    """A file of Python: its containers in the order in which they are made."""

    def __init__(self, text: str) -> None:
        self.lines = Lines(text)
        self.containers: list[State] = []
        self.used: list[int] = []  # the ids of containers that stand in others
        self.executed: list[int] = []
        self.problems: list[Problem] = []
        self.steps = self.values = self.copies = 0
        self.depth = 0
        self.unsure = 0  # the conditions and loops around that only a run decides
        self.made_at: dict[int, int] = {}  # how unsure it was when a container was made
        self.open: list[State] = []  # the containers of the with blocks around
        self.called: set[str] = set()
        tree = self._parsed(text)
        if tree is not None:
            self._follow(tree)

    def machine(self, file: str, what: str) -> ReadMachine:
        """The machine of the outermost container, or why there is none."""
        tops = [each for each in self.containers if id(each) not in self.used and each.states]
        if self.problems:
            return None, tuple(self.problems)
        if not tops:
            message = f"no {what} can be read from this file without running it"
            hint = "build the states with names and transitions that are written in the source"
            return None, (problem(message, Location(1, 1, "/machine"), hint),)
        run = [each for each in tops if id(each) in self.executed]
        return machine_from(max(run or tops, key=_size), file)

    def _parsed(self, text: str) -> ast.Module | None:
        old = _EXCEPT.sub(r"\1 as \2:", _PRINT.sub(r"\1pass", text)).expandtabs(8)  # Python 2
        for attempt in (text, old):
            try:
                return ast.parse(attempt.replace("\r\n", "\n"))
            except SyntaxError as error:
                line, column = error.lineno or 1, error.offset or 1
                message = f"this is neither Python 3 nor Python 2 that is like it: {error.msg}"
            except (RecursionError, MemoryError, ValueError):
                line, column, message = 1, 1, "this Python is nested too deeply, or no text"
                break
        place = Location(max(line, 1), max(column, 1), "/machine")
        self.problems.append(problem(message, place, "correct it there"))
        return None

    def _follow(self, tree: ast.Module) -> None:
        names: dict[str, Any] = {}
        try:
            self._block(tree.body, names)
            if not any(each.states for each in self.containers):
                self._rest(names)
        except _LeaveError:
            pass  # the file ends early
        except _TooMuchError:
            message = "this program makes its machine in too many steps to be followed"
            self.problems.append(problem(message, Location(1, 1, "/machine")))
        except RecursionError:
            message = "this Python is nested too deeply"
            self.problems.append(problem(message, Location(1, 1, "/machine")))

    def _rest(self, names: dict[str, Any]) -> None:
        """Functions that nothing has called, and methods of classes: one of them builds it."""
        for value in list(names.values()):
            if isinstance(value, _Function) and value.node.name not in self.called:
                self._call(value, [], {})
            elif isinstance(value, _Class) and value.node.name not in self.called:
                attributes: dict[str, Any] = {}
                for method in value.node.body:
                    if isinstance(method, ast.FunctionDef):
                        inside = {**names, **attributes, "self": UNKNOWN}
                        self._body(method.body, inside)
                        attributes |= {
                            name: each for name, each in inside.items() if name.startswith("self.")
                        }

    def fault(self, node: ast.AST, message: str, hint: str) -> None:
        """Something at a place of the source cannot be read."""
        place = Location(getattr(node, "lineno", 1), getattr(node, "col_offset", 0) + 1, "/machine")
        self.problems.append(problem(message, place, hint))

    # -- statements -------------------------------------------------------------------------

    def _body(self, body: Sequence[ast.stmt], names: dict[str, Any]) -> Any:
        try:
            self._block(body, names)
        except _ReturnError as returned:
            return returned.value
        except _LeaveError:
            return None  # outside of a loop: no Python
        return None

    def _block(self, body: Sequence[ast.stmt], names: dict[str, Any]) -> None:
        for statement in body:
            self.steps += 1
            if self.steps > MOST_STEPS:
                raise _TooMuchError
            self._statement(statement, names)

    def _statement(self, node: ast.stmt, names: dict[str, Any]) -> None:
        if isinstance(node, ast.FunctionDef):
            names[node.name] = _Function(node, names)
        elif isinstance(node, ast.ClassDef):
            names[node.name] = _Class(node, names)
        elif isinstance(node, ast.Assign):
            value = self.value(node.value, names)
            for target in node.targets:
                self._assign(target, value, names)
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            self._assign(node.target, self.value(node.value, names), names)
        elif isinstance(node, ast.Expr):
            self.value(node.value, names)
        elif isinstance(node, ast.With):
            self._with(node, names)
        elif isinstance(node, ast.For):
            self._for(node, names)
        elif isinstance(node, ast.Return):
            raise _ReturnError(None if node.value is None else self.value(node.value, names))
        else:
            self._compound(node, names)

    def _compound(self, node: ast.stmt, names: dict[str, Any]) -> None:
        if isinstance(node, ast.If):
            test = self.value(node.test, names)
            if test is UNKNOWN:
                self._perhaps(node.body, names)
                self._perhaps(node.orelse, names)
            else:
                self._block(node.body if test else node.orelse, names)
        elif isinstance(node, ast.While):
            self._perhaps(node.body, names)
        elif isinstance(node, ast.Break):
            raise _BreakError
        elif isinstance(node, ast.Continue):
            raise _ContinueError
        elif isinstance(node, ast.Try):
            self._block((*node.body, *node.orelse, *node.finalbody), names)

    def _perhaps(self, body: Sequence[ast.stmt], names: dict[str, Any]) -> None:
        """Statements of which only a run decides whether they are executed, and how often."""
        self.unsure += 1
        try:
            self._block(body, names)
        except _LeaveError:
            pass
        finally:
            self.unsure -= 1

    def _with(self, node: ast.With, names: dict[str, Any]) -> None:
        entered = 0
        for item in node.items:
            value = self.value(item.context_expr, names)
            if item.optional_vars is not None:
                self._assign(item.optional_vars, value, names)
            if isinstance(value, State):
                self.open.append(value)
                entered += 1
        try:
            self._block(node.body, names)
        finally:  # a return may leave it
            if entered:
                del self.open[-entered:]

    def _for(self, node: ast.For, names: dict[str, Any]) -> None:
        rows = self.value(node.iter, names)
        if isinstance(rows, dict):
            rows = list(rows)
        if not isinstance(rows, list | tuple | str) or len(rows) > LONGEST:
            self._assign(node.target, UNKNOWN, names)
            self._perhaps(node.body, names)
            return
        for row in list(rows):
            self._assign(node.target, row, names)
            try:
                self._block(node.body, names)
            except _ContinueError:
                continue
            except _BreakError:
                return
        self._block(node.orelse, names)

    def _assign(self, target: ast.expr, value: Any, names: dict[str, Any]) -> None:
        if isinstance(target, ast.Tuple | ast.List):
            rows = list(value) if isinstance(value, list | tuple) else []
            fits = len(rows) == len(target.elts)
            for number, each in enumerate(target.elts):
                self._assign(each, rows[number] if fits else UNKNOWN, names)
        elif isinstance(target, ast.Subscript):
            container, key = self.value(target.value, names), self.value(target.slice, names)
            if isinstance(container, dict) and isinstance(key, str | int):
                container[key] = value
        else:
            names[dotted(target)] = value

    # -- expressions ------------------------------------------------------------------------

    def value(self, node: ast.expr, names: dict[str, Any]) -> Any:
        """The value of an expression, as far as the source says it."""
        self.values += 1
        if self.values > MOST_VALUES:
            raise _TooMuchError
        if isinstance(node, ast.Constant):
            return node.value
        if isinstance(node, ast.Name | ast.Attribute):
            return names.get(dotted(node), UNKNOWN)
        if isinstance(node, ast.List | ast.Tuple):
            return [self.value(each, names) for each in node.elts]
        if isinstance(node, ast.Dict):
            return self._dictionary(node, names)
        if isinstance(node, ast.Call):
            return self._called(node, names)
        return self._combined(node, names)

    def _dictionary(self, node: ast.Dict, names: dict[str, Any]) -> Any:
        result: dict[Any, Any] = {}
        for key, each in zip(node.keys, node.values, strict=True):
            name = UNKNOWN if key is None else self.value(key, names)
            if not isinstance(name, str | int | float | bool):
                return UNKNOWN
            result[name] = self.value(each, names)
        return result

    def _combined(self, node: ast.expr, names: dict[str, Any]) -> Any:
        if isinstance(node, ast.JoinedStr):
            return joined_text([self._part(each, names) for each in node.values])
        if isinstance(node, ast.BinOp):
            left, right = self.value(node.left, names), self.value(node.right, names)
            return operated(node.op, left, right)
        if isinstance(node, ast.Subscript):
            whole, key = self.value(node.value, names), self.value(node.slice, names)
            try:
                return whole[key] if isinstance(whole, dict | list | str) else UNKNOWN
            except (KeyError, IndexError, TypeError):
                return UNKNOWN
        if isinstance(node, ast.IfExp):
            test = self.value(node.test, names)
            if test is UNKNOWN:
                return UNKNOWN
            return self.value(node.body if test else node.orelse, names)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
            value = self.value(node.operand, names)
            if isinstance(node.op, ast.Not):
                return UNKNOWN if value is UNKNOWN else not value
            return -value if isinstance(value, int | float) else UNKNOWN
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            if isinstance(node.left, ast.Name) and node.left.id == "__name__":
                return True  # the file is the program
            sides = self.value(node.left, names), self.value(node.comparators[0], names)
            return compared(node.ops[0], *sides)
        return UNKNOWN

    def _part(self, node: ast.expr, names: dict[str, Any]) -> Any:
        """A part of a formatted text; unknown if it is written in a form of its own."""
        if not isinstance(node, ast.FormattedValue):
            return self.value(node, names)
        plain = node.format_spec is None and node.conversion == -1
        return self.value(node.value, names) if plain else UNKNOWN

    def _called(self, node: ast.Call, names: dict[str, Any]) -> Any:
        name = dotted(node.func)
        last = name.rpartition(".")[2]
        arguments = [self.value(each, names) for each in node.args]
        keywords = {
            each.arg: self.value(each.value, names)
            for each in node.keywords
            if each.arg is not None
        }
        function = names.get(name, UNKNOWN)
        if isinstance(function, _Function):
            return self._call(function, arguments, keywords)
        if isinstance(function, _Class):
            return self._instance(function, node, arguments, keywords)
        if last in (*SEQUENTIAL, *PARALLEL, _ROW):
            return self._container(node, last, arguments, keywords)
        if last == "Iterator" and "outcomes" in keywords:
            hint = "check the machine that is repeated by itself"
            self.fault(node, "how often an Iterator repeats is not read", hint)
            return UNKNOWN
        if last == "add" and self.open and arguments:
            self._add(node, self.open[-1], arguments, keywords)
            return UNKNOWN
        owner = names.get(name.rpartition(".")[0], UNKNOWN)
        if isinstance(owner, State):
            return self._method(node, owner, last, arguments, keywords)
        return called(last, name, owner, arguments, keywords)

    def _call(self, function: _Function, arguments: list[Any], keywords: dict[str, Any]) -> Any:
        self.called.add(function.node.name)
        if self.depth >= _DEEPEST:
            return UNKNOWN
        parameters = function.node.args
        inside = dict(function.names)
        names = [each.arg for each in (*parameters.posonlyargs, *parameters.args)]
        defaults = [self.value(each, function.names) for each in parameters.defaults]
        inside |= dict.fromkeys(names, UNKNOWN)
        inside |= dict(zip(reversed(names), reversed(defaults), strict=False))
        inside |= dict(zip(names, arguments, strict=False))
        inside |= {key: each for key, each in keywords.items() if key in names}
        self.depth += 1
        try:
            return self._body(function.node.body, inside)
        finally:
            self.depth -= 1

    def _instance(
        self, kind: _Class, node: ast.Call, arguments: list[Any], keywords: dict[str, Any]
    ) -> Any:
        """A state, or a container if its class is one."""
        self.called.add(kind.node.name)
        bases = {dotted(each).rpartition(".")[2] for each in kind.node.bases}
        init = next(
            (
                each
                for each in kind.node.body
                if isinstance(each, ast.FunctionDef) and each.name == "__init__"
            ),
            None,
        )
        container = bases & {*SEQUENTIAL, *PARALLEL, _ROW}
        if init is not None and init.args.args and container:
            base = next(iter(sorted(container)))
            made = self._container(node, base, [], {})
            own = {**kind.names, init.args.args[0].arg: made}
            own |= dict(zip([each.arg for each in init.args.args[1:]], arguments, strict=False))
            self._super(init, base, made, own)
            self.depth += 1
            if self.depth < _DEEPEST:
                self._body(init.body, own)
            self.depth -= 1
            return made
        if init is not None and not any(base.endswith("State") for base in bases):
            own = {**kind.names, init.args.args[0].arg if init.args.args else "self": UNKNOWN}
            own |= dict(zip([each.arg for each in init.args.args[1:]], arguments, strict=False))
            self.depth += 1
            if self.depth < _DEEPEST:
                self._body(init.body, own)
            self.depth -= 1
        outcomes = _declared(init, lambda each: self.value(each, kind.names)) if init else ()
        shown = {key: each for key, each in keywords.items() if isinstance(each, str | int | float)}
        return Instance(kind.node.name, outcomes, shown)

    def _super(self, init: ast.FunctionDef, base: str, made: State, names: dict[str, Any]) -> None:
        """The call of the base class in ``__init__`` says the outcomes."""
        for each in ast.walk(init):
            if isinstance(each, ast.Call) and dotted(each.func).endswith("__init__"):
                arguments = [self.value(argument, names) for argument in each.args]
                arguments = [value for value in arguments if value is not made]
                keywords = {
                    keyword.arg: self.value(keyword.value, names)
                    for keyword in each.keywords
                    if keyword.arg
                }
                for message in described(made, base, arguments, keywords):
                    self.fault(each, message, "write it out")
                return

    # -- machines ---------------------------------------------------------------------------

    def _container(
        self, node: ast.Call, kind: str, arguments: list[Any], keywords: dict[str, Any]
    ) -> State:
        made = State(kind, self._place(node), kind=kind, container=True)
        made.parallel = kind in PARALLEL
        made.early = kind == "ConcurrencyContainer"
        for message in described(made, kind, arguments, keywords):
            self.fault(node, message, "write it out")
        self.containers.append(made)
        self.made_at[id(made)] = self.unsure
        return made

    def _method(
        self,
        node: ast.Call,
        owner: State,
        name: str,
        arguments: list[Any],
        keywords: dict[str, Any],
    ) -> Any:
        if name == "add" and arguments:
            self._add(node, owner, arguments, keywords)
        elif name in ("set_initial_state", "initial_state") and arguments:
            first = arguments[0]
            first = first[0] if isinstance(first, list) and first else first
            if isinstance(first, str):
                owner.initial = first
            else:
                self.fault(node, "the first state is not written in the source", "write it")
        elif name in ("execute", "__call__"):
            self.executed.append(id(owner))
        return UNKNOWN

    def _add(
        self, node: ast.Call, owner: State, arguments: list[Any], keywords: dict[str, Any]
    ) -> None:
        name = arguments[0]
        made = arguments[1] if len(arguments) > 1 else keywords.get("state", UNKNOWN)
        transitions = arguments[2] if len(arguments) > 2 else keywords.get("transitions", {})
        if not isinstance(name, str):
            self.fault(node, "the name of this state is not written in the source", "write it")
            return
        if not isinstance(transitions, dict) or not all(
            isinstance(each, str) for pair in transitions.items() for each in pair
        ):
            message = f"the transitions of {name!r} are not written in the source"
            self.fault(node, message, "write them as a dictionary of texts")
            return
        if self.unsure > self.made_at.get(id(owner), 0):
            message = f"whether {name!r} is added is decided only when the program runs"
            self.fault(node, message, "add it without a condition, for each one by itself")
            return
        if isinstance(made, State) and any(each is owner for each in within(made)):
            self.fault(node, f"{name!r} would contain itself", "add another container")
            return
        state = self._state(node, made, name)
        state.transitions = dict(transitions)
        state.name, state.place = name, self._place(node)
        if owner.kind == _ROW and owner.states:
            before = owner.states[-1]
            before.transitions.setdefault(owner.default, name)
        if owner.kind == _ROW:
            state.transitions.pop("", None)
        owner.states.append(state)

    def _state(self, node: ast.Call, made: Any, name: str) -> State:
        if isinstance(made, State):
            state = made
            if id(made) in self.used:
                self.copies += sum(1 for _ in within(made))
                if self.copies > MOST_COPIES:
                    raise _TooMuchError
                state = copy.deepcopy(made)
            self.used.append(id(made))
            return state
        if isinstance(made, Instance):
            return State(
                name,
                self._place(node),
                kind=made.kind,
                outcomes=made.outcomes,
                parameters=dict(made.parameters),
            )
        kind = name
        if len(node.args) > 1 and isinstance(node.args[1], ast.Call):
            kind = dotted(node.args[1].func).removeprefix("self.") or name
        return State(name, self._place(node), kind=kind)

    def _place(self, node: ast.AST) -> Place:
        line, column = getattr(node, "lineno", 1), getattr(node, "col_offset", 0) + 1
        start = self.lines.offset(line, 1) + column - 1
        return Place(line, column, start, start + 1)


def _size(state: State) -> int:
    return sum(1 for _ in within(state))


"""The parameters of SMACH's Concurrence in their order."""


def _declared(init: ast.FunctionDef, value: Any) -> tuple[str, ...]:
    """The outcomes that a state's class hands to its base class."""
    for each in ast.walk(init):
        if not (isinstance(each, ast.Call) and dotted(each.func).endswith("__init__")):
            continue
        for keyword in each.keywords:
            if keyword.arg == "outcomes":
                return text_row(value(keyword.value))
        for argument in each.args[:2]:
            if texts := text_row(value(argument)):
                return texts
    return ()


def within(state: State) -> Iterator[State]:
    """A state and all in it."""
    pending = [state]
    while pending:
        each = pending.pop()
        yield each
        pending += each.states


def _read(text: str, file: str, _limits: Limits, *, what: str) -> ReadMachine:
    """The outermost machine of a file, or why it cannot be read."""
    return Source(text).machine(file, what)


def _is_flexbe(text: str, file: str) -> bool:
    return file.endswith(".py") and imports(text, "flexbe_core")


def _is_smach(text: str, file: str) -> bool:
    return file.endswith(".py") and imports(text, "smach")


def imports(text: str, word: str) -> bool:
    """True if a line that imports something names ``word``, whatever stands before it.

    >>> imports("# smach", "smach"), imports("from smach_ros import X", "smach")
    (False, True)
    """
    return re.search(rf"(?im)^[ \t]*+(?:from|import)\b.*{word}", text) is not None


FLEXBE = Format(
    "flexbe", "FlexBE behaviours in Python", _is_flexbe, partial(_read, what="behaviour")
)
SMACH = Format(
    "smach", "SMACH state machines in Python", _is_smach, partial(_read, what="state machine")
)
FORMATS = (FLEXBE, SMACH)
