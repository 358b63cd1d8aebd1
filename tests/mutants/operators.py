"""The defects that are planted: small changes to what a module computes.

Not planted are changes that no test should notice: in annotations, texts for people, assertions,
and code that only type checkers see.
"""

from __future__ import annotations

import ast
import copy
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

__all__ = ["Mutant", "mutants_of", "planted"]

_COMPARED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
}
_COMPUTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Add,
    ast.BitOr: ast.BitAnd,
    ast.BitAnd: ast.BitOr,
}
_CALLED = {"any": "all", "all": "any", "min": "max", "max": "min"}
_FORMULA = {"(and": "(or", "(or": "(and", "(not": "(or", "(=>": "(and"}
_FORMULA_START = re.compile(r"\((and|or|not|=>)(?= |$)")


@dataclass(frozen=True, slots=True)
class Mutant:
    """A defect: where, which operator, and its number among the mutants of the file."""

    file: str
    line: int
    number: int
    change: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line} {self.change} ({self.number})"


def mutants_of(file: str, source: str) -> list[Mutant]:
    """All mutants of a module, in the order of its syntax tree."""
    sites = _sites(ast.parse(source))
    return [Mutant(file, line, number, said) for number, (line, said, _) in enumerate(sites)]


def planted(source: str, mutant: Mutant) -> str:
    """The module with the defect; raises SyntaxError where that is no Python."""
    tree = ast.parse(source)
    _sites(tree)[mutant.number][2]()
    text = ast.unparse(ast.fix_missing_locations(tree))
    compile(text, mutant.file, "exec")
    return text


_Site = tuple[int, str, "Callable[[], None]"]


def _sites(tree: ast.Module) -> list[_Site]:
    results: list[_Site] = []
    # A stack, in reverse: nodes come in the order of the text.
    todo: list[ast.AST] = [tree]
    while todo:
        node = todo.pop()
        if _for_type_checkers(node):
            continue
        results += _of(node)
        todo += reversed(_below(node))
    return results


def _for_type_checkers(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def _below(node: ast.AST) -> list[ast.AST]:
    """The nodes in which defects are planted."""
    if isinstance(node, (ast.Assert, ast.Import, ast.ImportFrom, ast.Raise, ast.JoinedStr)):
        return []
    if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) in ("__all__", "RULES"):
        return []
    left_out: set[ast.AST | None] = set()
    if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
        left_out |= {node.returns, node.args, *node.decorator_list}
    elif isinstance(node, ast.ClassDef):
        left_out |= {*node.decorator_list, *node.bases}
    elif isinstance(node, ast.AnnAssign):
        left_out.add(node.annotation)
    elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("cast", "TypeVar", "Rule"):
        return []
    return [child for child in ast.iter_child_nodes(node) if child not in left_out]


def _of(node: ast.AST) -> Iterator[_Site]:  # noqa: PLR0912  (a table)
    line = getattr(node, "lineno", 0)
    if isinstance(node, ast.Compare):
        for at, each in enumerate(node.ops):
            if type(each) in _COMPARED:
                new = _COMPARED[type(each)]
                said = f"{type(each).__name__} becomes {new.__name__}"
                yield line, said, lambda at=at, new=new: node.ops.__setitem__(at, new())  # type: ignore[misc]
    elif isinstance(node, ast.BoolOp):
        other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        said = f"{type(node.op).__name__} becomes {type(other).__name__}".lower()
        yield line, said, lambda: setattr(node, "op", other)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield line, "not is left out", lambda: _become(node, node.operand)
    elif isinstance(node, (ast.BinOp, ast.AugAssign)) and type(node.op) in _COMPUTED:
        new_op = _COMPUTED[type(node.op)]
        said = f"{type(node.op).__name__} becomes {new_op.__name__}"
        yield line, said, lambda: setattr(node, "op", new_op())
    elif isinstance(node, ast.Constant):
        yield from _of_constant(node)
    elif isinstance(node, ast.JoinedStr):
        yield from _of_formula(node)
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        if node.func.id in _CALLED:
            other_name = _CALLED[node.func.id]
            said = f"{node.func.id} becomes {other_name}"
            yield line, said, lambda: setattr(node.func, "id", other_name)
    elif isinstance(node, (ast.If, ast.IfExp, ast.While)):
        yield line, "the condition is negated", lambda: _negate(node)
    elif isinstance(node, ast.comprehension):
        for at in range(len(node.ifs)):
            where = node.ifs[at].lineno
            yield where, "a filter is left out", lambda at=at: node.ifs.pop(at)  # type: ignore[misc]
    elif isinstance(node, (ast.Continue, ast.Break)):
        name = type(node).__name__.lower()
        yield line, f"{name} is left out", lambda: _become(node, ast.Pass())
    elif isinstance(node, ast.Expr) and isinstance(
        node.value, (ast.Call, ast.Yield, ast.YieldFrom)
    ):
        yield line, "a statement is left out", lambda: _left_out(node)


def _of_constant(node: ast.Constant) -> Iterator[_Site]:
    value = node.value
    if isinstance(value, bool):
        said = f"{value} becomes {not value}"
        yield node.lineno, said, lambda: setattr(node, "value", not value)
    elif isinstance(value, int):
        yield node.lineno, f"{value} becomes {value + 1}", lambda: setattr(node, "value", value + 1)
    elif isinstance(value, str) and (match := _FORMULA_START.match(value)):
        new = _FORMULA[match[0]] + value[match.end() :]
        yield node.lineno, f"{match[0]} becomes {new[:4]}", lambda: setattr(node, "value", new)


def _of_formula(node: ast.JoinedStr) -> Iterator[_Site]:
    """Formulas in SMT-LIB are texts with places to fill in."""
    for part in node.values:
        if isinstance(part, ast.Constant) and isinstance(part.value, str):
            yield from _of_constant(part)


def _become(node: ast.AST, other: ast.AST) -> None:
    """Put another node in the place of this one, by changing what this one is."""
    new = copy.copy(other)
    node.__class__ = new.__class__  # type: ignore[assignment]
    node.__dict__.clear()
    node.__dict__.update(new.__dict__)


def _negate(node: ast.If | ast.IfExp | ast.While) -> None:
    node.test = ast.UnaryOp(ast.Not(), node.test)


def _left_out(node: ast.Expr) -> None:
    # A generator stays one.
    node.value = (
        ast.YieldFrom(ast.Tuple([], ast.Load()))
        if isinstance(node.value, (ast.Yield, ast.YieldFrom))
        else ast.Constant(None)
    )
