"""FlexBE and SMACH: Python that builds a state machine → the machine. It is never executed.

https://github.com/FlexBE/flexbe_behavior_engine, https://github.com/ros/executive_smach. A
behaviour that uses another one has it as one state.

Both write machines as Python: a container is made, a ``with`` block adds states to it.
The statements are followed in their order, with the values that are written in the source: texts,
numbers, lists, dictionaries, what is put together of them, and functions and classes of the same
file that build parts. Everything else is unknown. What is handed to code that is not followed is
unknown from then on; what is unknown and reaches a container is refused at its line.

    sm = StateMachine(outcomes=["done"])
    with sm:
        for name in ["A", "B"]:
            StateMachine.add(name, Wait(), transitions={"ok": "done"})       two states, A and B
"""

from __future__ import annotations

import ast
import re
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

from gpsfsm.compile.formats import Format
from gpsfsm.compile.formats.elements import problem
from gpsfsm.compile.formats.outcomes import machine_from
from gpsfsm.compile.formats.python_builders import CONTAINERS, MOST_COPIES, STATES, Container
from gpsfsm.compile.formats.python_calls import Calls
from gpsfsm.compile.formats.python_effects import (
    BreakError,
    ContinueError,
    LeaveError,
    RaiseError,
    TooMuchError,
)
from gpsfsm.compile.formats.python_values import (
    FAMILY,
    UNKNOWN,
    Class,
    FailsError,
    Function,
    Instance,
    Library,
    Scope,
    imports,
    operated,
    parsed,
    plain,
    row,
    truth,
    used_up,
)
from gpsfsm.compile.machines import Place
from gpsfsm.model.plan import Location
from gpsfsm.model.precision import Cause, Reading
from gpsfsm.syntax.text import Lines

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.compile.machines import ReadMachine
    from gpsfsm.model.finding import Problem
    from gpsfsm.syntax.source import Limits

_PREEMPTING = re.compile(r"request_preempt|set_preempt_handler")


class Source(Calls):
    """A file of Python: its containers in the order in which they are made."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.lines = Lines(text)
        self.problems: list[Problem] = []
        for each in _PREEMPTING.finditer(text):
            place = self.place(ast.Pass(lineno=text.count("\n", 0, each.start()) + 1, col_offset=0))
            self.note(Reading.DEFAULTED, each[0], place, Cause.PREEMPTION)
        tree = self._parsed(text)
        if tree is not None:
            self._guarded(lambda: self._module(tree))

    def machine(self, file: str, what: str) -> ReadMachine:
        """The machine of the outermost container, or why there is none."""
        top = None if self.problems else self._top()
        if top is not None:
            state = self.state_of(top)
            if self.copies > MOST_COPIES:
                message = "this program makes its machine in too many steps to be followed"
                self.problems.append(problem(message, Location(1, 1, "/machine")))
            elif not self.problems:
                return machine_from(state, file, approximations=self.notes.values())
        if not self.problems:
            message = f"no {what} can be read from this file without running it"
            hint = "build the states with names and transitions that are written in the source"
            self.problems.append(problem(message, Location(1, 1, "/machine"), hint))
        return None, tuple(dict.fromkeys(self.problems))

    def _top(self) -> Container | None:
        """The container that is executed or returned, else the largest."""
        inner = {id(each) for made in self.containers for each in list(made.within())[1:]}
        tops = [each for each in self.containers if id(each) not in inner and each.entries]
        run = [each for each in tops if each in self.executed]
        rows = run or tops
        if not rows or (not run and any(not each.entries for each in self.executed)):
            return None
        top = max(rows, key=lambda each: sum(len(e.entries) for e in each.within()))
        for each in tops:
            if each is not top and (each.branch or top.branch) and (not run or each in run):
                message = "which of several machines runs is decided only when the program runs"
                self.fault(self._at(each.place), message, "write each into a file of its own")
            elif each is not top:
                self.note(Reading.SKIPPED, each.kind, each.place, Cause.ANOTHER_MACHINE)
        for each in top.within():
            if each.torn is not None and top not in self.executed:
                message = "an exception may leave this statement before all states are added"
                self.fault(each.torn, message, "build the machine outside of it")
        self._changed_later(top)
        return top

    def _changed_later(self, top: Container) -> None:
        """Refuse what callbacks and states may do to the machine while it runs."""
        for function in self.functions:
            if function not in self.called:
                self.later(function)
        places = [self.globals.names, *(each.attributes for each in self.instances)]
        for function in self.functions:
            places += [function.scope.names, function.owner.names if function.owner else {}]
        for names in places:
            for name in self.haunted & {*names}:
                self.lose(names[name], None)
        for container in top.within():
            for entry in container.entries:
                if container.lost or self.settled(entry.transitions) is UNKNOWN:
                    message = (
                        f"code that is not followed may change the transitions of {entry.label!r}"
                    )
                    self.fault(self._at(entry.place), message, "write them out")

    @staticmethod
    def _at(place: Place) -> ast.AST:
        return ast.Pass(lineno=place.line, col_offset=place.column - 1)

    def _parsed(self, text: str) -> ast.Module | None:
        tree = parsed(text)
        if isinstance(tree, ast.Module):
            return tree
        message, line, column = tree
        place = Location(line, column, "/machine")
        self.problems.append(problem(message, place, "correct it there"))
        return None

    def _guarded(self, action: Callable[[], None]) -> None:
        try:
            action()
        except (LeaveError, RaiseError):
            pass  # the file ends early
        except TooMuchError:
            message = "this program makes its machine in too many steps to be followed"
            self.problems.append(problem(message, Location(1, 1, "/machine")))
        except RecursionError:
            message = "this Python is nested too deeply"
            self.problems.append(problem(message, Location(1, 1, "/machine")))

    def _module(self, tree: ast.Module) -> None:
        with suppress(LeaveError, RaiseError):
            self.block(tree.body, self.globals)
        if not any(each.entries for each in self.containers) and not self.problems:
            self._rest()

    def _rest(self) -> None:
        """Functions that nothing has called, and methods of classes: one of them builds it."""
        for value in list(self.globals.names.values()):
            if isinstance(value, Function) and value not in self.called:
                self._guarded(partial(self._alone, value))
            elif isinstance(value, Class) and value not in self.called:
                self._guarded(partial(self._methods, value))

    def _alone(self, function: Function) -> Any:
        return self.call(function, None, {}, function.node)

    def _methods(self, kind: Class) -> None:
        made = Instance(kind.name, kind)
        self.instances.append(made)
        for name in ("__init__", "create"):
            function = kind.names.get(name)
            if isinstance(function, Function):
                result = self.call(function, None, {}, function.node, owner=made)
                if name == "create" and isinstance(result, Container):
                    self.executed.append(result)
        for function in kind.names.values():
            if isinstance(function, Function) and function not in self.called:
                self.call(function, None, {}, function.node, owner=made)

    def fault(self, node: ast.AST, message: str, hint: str) -> None:
        """Something at a place of the source cannot be read."""
        place = Location(getattr(node, "lineno", 1), getattr(node, "col_offset", 0) + 1, "/machine")
        self.problems.append(problem(message, place, hint))

    def place(self, node: ast.AST) -> Place:
        """The place of a node of the syntax tree."""
        line, column = getattr(node, "lineno", 1), getattr(node, "col_offset", 0) + 1
        start = self.lines.offset(line, 1) + column - 1
        return Place(line, column, start, start + 1)

    # -- statements -------------------------------------------------------------------------

    def block(self, body: Sequence[ast.stmt], scope: Scope) -> None:
        """Statements; after one that may have left them, only a run decides about the others."""
        for number, statement in enumerate(body):
            self.step()
            try:
                self._statement(statement, scope)
            except FailsError:
                self.fault(statement, "this statement raises an exception", "correct it")
                raise RaiseError from None
            if self.left and number + 1 < len(body):
                self.left, rest = False, body[number + 1 :]
                self.perhaps(partial(self.block, rest, scope), lambda: None)
                self.left = True
                return

    def _statement(self, node: ast.stmt, scope: Scope) -> None:
        match node:
            case ast.Expr():
                self.value(node.value, scope)
            case ast.Assign():
                value = self.value(node.value, scope)
                for target in node.targets:
                    self.assign(target, value, scope)
            case ast.AnnAssign():
                if node.value is not None:
                    self.assign(node.target, self.value(node.value, scope), scope)
                self.perhaps(partial(self.value, node.annotation, scope), lambda: None)
            case ast.AugAssign():
                self._augmented(node, scope)
            case ast.Return():
                raise LeaveError(None if node.value is None else self.value(node.value, scope))
            case ast.Break():
                raise BreakError
            case ast.Continue():
                raise ContinueError
            case ast.Raise():
                self.all_of(node, scope)
                raise RaiseError
            case ast.Pass():
                pass
            case _:
                self._defining(node, scope)

    def _defining(self, node: ast.stmt, scope: Scope) -> None:
        match node:
            case ast.FunctionDef():
                self._store(node.name, self.function(node, scope), scope)
            case ast.AsyncFunctionDef():
                self.later(self.function(node, scope))
                self._store(node.name, UNKNOWN, scope)
            case ast.ClassDef():
                self._store(node.name, self.class_of(node, scope), scope)
            case ast.Import() | ast.ImportFrom():
                self._import(node, scope)
            case ast.Global() | ast.Nonlocal():
                pass  # see ``declare_names``
            case ast.Delete():
                for target in node.targets:
                    self._delete(target, scope)
            case ast.Assert():
                self.value(node.test, scope)
            case _:
                self._compound(node, scope)

    def _compound(self, node: ast.stmt, scope: Scope) -> None:
        match node:
            case ast.If():
                self._if(node, scope)
            case ast.For():
                self._for(node, scope)
            case ast.While():
                self._while(node, scope)
            case ast.With():
                self._with(node, scope)
            case ast.Try():
                self._try(node, scope)
            case ast.Match():
                self._match(node, scope)
            case _:
                message = f"statements of the kind {type(node).__name__} are not followed"
                self.fault(node, message, "build the machine without it")

    def _store(self, name: str, value: Any, scope: Scope) -> None:
        self.write(scope.elsewhere.get(name, scope).names, name, value)

    def _if(self, node: ast.If, scope: Scope) -> None:
        test = truth(self.value(node.test, scope))
        if test is UNKNOWN:
            self.perhaps(
                partial(self.block, node.body, scope), partial(self.block, node.orelse, scope)
            )
        else:
            self.block(node.body if test else node.orelse, scope)

    def _match(self, node: ast.Match, scope: Scope) -> None:
        subject = self.value(node.subject, scope)
        case = _case_of(subject, node)
        if case is not UNKNOWN:
            self.block(case.body if case else (), scope)
            return
        self.lose(subject, node)  # names of patterns have it, too
        names = {e.name for e in ast.walk(node) if isinstance(e, ast.MatchAs | ast.MatchStar)}
        names |= {e.rest for e in ast.walk(node) if isinstance(e, ast.MatchMapping)}
        for name in sorted(each for each in names if each):
            self._store(name, UNKNOWN, scope)
        for guard in (each.guard for each in node.cases):
            if guard is not None:
                self.perhaps(partial(self.value, guard, scope), lambda: None)
        cases = [partial(self.block, each.body, scope) for each in node.cases]
        self.perhaps(*cases, lambda: None)

    def _while(self, node: ast.While, scope: Scope) -> None:
        def around() -> None:
            self.value(node.test, scope)
            self.block(node.body, scope)

        while True:
            self.step()
            test = truth(self.value(node.test, scope))
            if test is UNKNOWN:
                self._unsure(around, node, scope)
                return
            if not test:
                break
            if self._round(node.body, scope):
                return
            if self.left:
                self._unsure(around, node, scope)
                return
        self.block(node.orelse, scope)

    def _unsure(self, around: Callable[[], None], node: ast.While | ast.For, scope: Scope) -> None:
        """The rounds of a loop of which only a run decides how many there are."""
        self.repeated(around)
        self.perhaps(partial(self.block, node.orelse, scope), lambda: None)

    def _round(self, body: Sequence[ast.stmt], scope: Scope) -> bool:
        """One round of a loop; True if a break ends it."""
        try:
            self.block(body, scope)
        except ContinueError:
            pass
        except BreakError:
            return True
        return False

    def _for(self, node: ast.For, scope: Scope) -> None:
        rows = self.value(node.iter, scope)

        def around() -> None:
            self.assign(node.target, UNKNOWN, scope)
            self.block(node.body, scope)

        if not row(rows) or (self.branch and used_up(rows)):
            self.lose(rows, node)
            self._unsure(around, node, scope)
            return
        try:
            for each in rows:
                self.step()
                self.assign(node.target, each, scope)
                if self._round(node.body, scope):
                    return
                if self.left or self.stale(rows):
                    self._unsure(around, node, scope)
                    return
        except RuntimeError as error:  # its size has changed
            if isinstance(error, RecursionError):
                raise
            raise FailsError from error
        self.block(node.orelse, scope)

    def _with(self, node: ast.With, scope: Scope) -> None:
        entered = 0
        for item in node.items:
            value = self.value(item.context_expr, scope)
            if item.optional_vars is not None:
                self.assign(item.optional_vars, value, scope)
            if isinstance(value, Container):
                self.open.append(value)
                entered += 1
        body = partial(self.block, node.body, scope)
        try:
            if entered == len(node.items):
                body()
            else:  # it may swallow exceptions
                self._torn(node, body)
        finally:  # a return may leave it
            if entered:
                del self.open[-entered:]

    def _torn(self, node: ast.stmt, *actions: Callable[[], None]) -> None:
        """Statements, of which an exception may leave the first ones in their midst."""
        first = len(self.containers)
        self.catching += 1
        try:
            self.perhaps(*actions, torn=True)
        finally:
            self.catching -= 1
            executed = {id(each) for made in self.executed for each in made.within()}
            for each in self.containers[first:]:
                if id(each) not in executed:
                    each.torn = each.torn or node

    def _try(self, node: ast.Try, scope: Scope) -> None:
        handlers = [
            each
            for each in node.handlers
            if self.catching or not isinstance(each.body[-1], ast.Raise) or _leaves(each.body)
        ]
        handlers = [] if all(map(_is_quiet, node.body)) else handlers

        def handle(handler: ast.ExceptHandler) -> None:
            if handler.type is not None:
                self.value(handler.type, scope)
            if handler.name:
                self._store(handler.name, UNKNOWN, scope)
            self.block(handler.body, scope)

        body = partial(self.block, (*node.body, *node.orelse), scope)
        try:
            if handlers or _leaves(node.finalbody):  # which ends an exception
                self._torn(node, body, *(partial(handle, each) for each in handlers))
            else:
                body()
        finally:
            self.block(node.finalbody, scope)

    def _import(self, node: ast.Import | ast.ImportFrom, scope: Scope) -> None:
        for each in node.names:
            if isinstance(node, ast.Import):
                name = each.asname or each.name.partition(".")[0]
                self._store(name, Library(each.name if each.asname else name), scope)
            elif each.name == "*":
                self._star(node, scope)
            else:
                value = Library(f"{node.module or '.'}.{each.name}")
                if node.module != "__future__":
                    self._store(each.asname or each.name, value, scope)

    def _star(self, node: ast.ImportFrom, scope: Scope) -> None:
        """``from … import *``."""
        if (node.module or "").partition(".")[0] in FAMILY:
            for name in (
                *CONTAINERS,
                *STATES,
                "Iterator",
                "UserData",
                "Behavior",
                "Autonomy",
                "Logger",
            ):
                self.write(scope.names, name, Library(f"{node.module}.{name}"))
            return
        self.strangers = True
        self.note(Reading.DEFAULTED, f"from {node.module or '.'} import *", node, Cause.IMPORTS)

    def _delete(self, target: ast.expr, scope: Scope) -> None:
        if isinstance(target, ast.Tuple | ast.List):
            for each in target.elts:
                self._delete(each, scope)
        elif isinstance(target, ast.Name):
            self.write(scope.elsewhere.get(target.id, scope).names, target.id, UNKNOWN)
        elif isinstance(target, ast.Subscript):
            owner, key = self.value(target.value, scope), self.value(target.slice, scope)
            self.changed_item(owner, key, target, delete=True)
        else:
            self.assign(target, UNKNOWN, scope)

    def _augmented(self, node: ast.AugAssign, scope: Scope) -> None:
        owner, key = self._spot(node.target, scope)
        match node.target:
            case ast.Name(name):
                left = self.value(ast.Name(name, ast.Load()), scope)
            case ast.Attribute(_, name):
                left = self.attribute(owner, name, node)
            case _:
                left = self.item(owner, key, node)
        right = self.value(node.value, scope)
        in_place = isinstance(left, list | dict)
        if in_place and not self.certain(left):
            return
        if in_place and right is UNKNOWN:
            self.lose(left, node)
        iterable = list(right) if in_place and isinstance(left, list) and row(right) else right
        result = operated(node.op, left, iterable, in_place=in_place)
        if in_place and result is UNKNOWN:
            self.lose(left, node)
        self._put(node.target, (owner, key), result, scope)

    def assign(self, target: ast.expr, value: Any, scope: Scope) -> None:
        """A target of an assignment gets a value."""
        match target:
            case ast.Tuple() | ast.List():
                rows = list(value) if row(value) else []
                fits = len(rows) == len(target.elts)
                star = any(isinstance(each, ast.Starred) for each in target.elts)
                if not fits and not star and row(value) and plain(value):
                    raise FailsError
                if star or not fits:
                    self.lose_inside(value)
                for number, each in enumerate(target.elts):
                    inner = each.value if isinstance(each, ast.Starred) else each
                    self.assign(inner, UNKNOWN if star or not fits else rows[number], scope)
            case _:
                self._put(target, self._spot(target, scope), value, scope)

    def _spot(self, target: ast.expr, scope: Scope) -> tuple[Any, Any]:
        """The owner of a target, and the key of an item."""
        match target:
            case ast.Attribute(owner):
                return self.value(owner, scope), None
            case ast.Subscript(owner, key):
                return self.value(owner, scope), self.value(key, scope)
        return None, None

    def _put(self, target: ast.expr, spot: tuple[Any, Any], value: Any, scope: Scope) -> None:
        match target:
            case ast.Name(name):
                self._store(name, value, scope)
            case ast.Attribute(_, name):
                self.changed_attribute(spot[0], name, value, target)
            case ast.Subscript():
                self.changed_item(*spot, target, value)


def _leaves(body: Sequence[ast.stmt]) -> bool:
    """True if a statement in these may leave the loop or the function around them."""
    leaving = (ast.Return, ast.Break, ast.Continue)
    return any(isinstance(each, leaving) for statement in body for each in ast.walk(statement))


def _is_quiet(statement: ast.stmt) -> bool:
    """True for a statement that raises no exception: it gives literals to names."""
    if not isinstance(statement, ast.Assign):
        return isinstance(statement, ast.Pass)
    literal = (ast.Constant, ast.List, ast.Tuple, ast.Load)
    return all(isinstance(each, ast.Name) for each in statement.targets) and all(
        isinstance(each, literal)
        or (isinstance(each, ast.Dict) and all(isinstance(key, ast.Constant) for key in each.keys))
        for each in ast.walk(statement.value)
    )


def _case_of(subject: Any, node: ast.Match) -> Any:
    """The case that a value takes, None if there is none; UNKNOWN where only a run decides."""
    for each in node.cases:
        match each:
            case ast.match_case(ast.MatchAs(None, None), None):
                return each
            case ast.match_case(ast.MatchValue(ast.Constant(value)), None) if plain(subject):
                if subject == value:
                    return each
            case _:
                return UNKNOWN
    return None


def _read(text: str, file: str, _limits: Limits, *, what: str) -> ReadMachine:
    """The outermost machine of a file, or why it cannot be read."""
    return Source(text).machine(file, what)


def _is_of(package: str, text: str, file: str) -> bool:
    return file.endswith(".py") and imports(text, package)


FLEXBE = Format(
    "flexbe",
    "FlexBE behaviours in Python",
    partial(_is_of, "flexbe_core"),
    partial(_read, what="behaviour"),
)
SMACH = Format(
    "smach",
    "SMACH state machines in Python",
    partial(_is_of, "smach"),
    partial(_read, what="state machine"),
)
FORMATS = (FLEXBE, SMACH)
