"""The samples of defects: some of every rule, and some of all of ``analysis/``."""

from __future__ import annotations

import ast
import re
from functools import cache
from itertools import chain, zip_longest
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.rules import all_rules
from tests.mutants.operators import Mutant, mutants_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from gpsfsm.analysis.rules import Rule

__all__ = ["ROOT", "of_rules", "over_analysis", "rules"]

ROOT = Path(__file__).resolve().parents[2]
_PACKAGE = ROOT / "gpsfsm"
_TEXTS = re.compile(
    r"words|examples|messages|__init__|rules/names|rules/missing|/limits|explain_|/gp[1689]xx_"
)
_REPORTING = (
    "checking/check.py",
    "analysis/machines/findings.py",
    "checking/engine_check.py",
    "checking/approximations.py",
    "analysis/machines/runners.py",
    "compile",
    "equivalence",
    "checking/selection.py",
    "syntax",
    "tasks",
)
"""Where rules are reported whose own module holds only their texts."""


@cache
def _everything() -> tuple[Mutant, ...]:
    return tuple(chain.from_iterable(_of_file(f"analysis/{name}") for name in _modules("analysis")))


def over_analysis(seed: int) -> list[Mutant]:
    """All mutants of analysis/ in an order drawn by a seed; modules of texts are left out."""
    result = list(_everything())
    Random(seed).shuffle(result)  # noqa: S311  (a sample, no secret)
    return result


def rules() -> dict[str, str]:
    """The module of every rule that finds something itself; "" for those reported elsewhere."""
    modules = {rule.code: _finder(rule) for rule in all_rules()}
    return {
        code: f"analysis/rules/{function.__module__.rpartition('.')[2]}.py" if function else ""
        for code, function in modules.items()
    }


def _finder(rule: Rule) -> Any:
    return rule.find or rule.find_on_engine


def _of_rule(code: str, file: str) -> tuple[Mutant, ...]:
    """The mutants of a rule's module that stand between the rule before it and its own."""
    ends = {
        ast.literal_eval(node.value.keywords[0].value): node.end_lineno or 0
        for node in ast.parse((ROOT / file).read_text(encoding="utf-8")).body
        if isinstance(node, ast.Assign)
        and isinstance(node.value, ast.Call)
        and ast.unparse(node.value.func) == "Rule"
    }
    end = ends[code]
    start = max((other for other in ends.values() if other < end), default=0)
    last = end == max(ends.values())
    return tuple(
        each for each in _of_file(file) if each.line > start and (last or each.line <= end)
    )


def of_rules(seed: int, each: int) -> list[tuple[str, Mutant]]:
    """For every rule, ``each`` defects of what finds it, with the rule's code; fewer if there are.

    That is the rule's module, or the code around each place that reports the rule.
    """
    results: list[tuple[str, Mutant]] = []
    for code, file in rules().items():
        mutants = (
            (file and _of_rule(code, file)) or tuple(_where_reported(code)) or tuple(_near(code))
        )
        drawn = Random(f"{seed} {code}").sample(mutants, len(mutants))  # noqa: S311
        results += [(code, mutant) for mutant in _spread(drawn)[:each]]
    return results


def _modules(folder: str) -> list[str]:
    here = ROOT / folder
    names = sorted(str(file.relative_to(here)) for file in here.rglob("*.py"))
    return [name for name in names if not _TEXTS.search(f"{folder}/{name}")]


@cache
def _of_file(file: str) -> tuple[Mutant, ...]:
    return tuple(mutants_of(file, (ROOT / file).read_text(encoding="utf-8")))


def _where_reported(code: str) -> Iterator[Mutant]:
    for file, source in _naming(code):
        lines = set(_lines_around(ast.parse(source), code))
        yield from (each for each in _of_file(file) if each.line in lines)


def _near(code: str) -> Iterator[Mutant]:
    for file, _ in _naming(code):
        yield from _of_file(file)


def _naming(code: str) -> Iterator[tuple[str, str]]:
    """The modules that report a rule, with their texts."""
    for name in _REPORTING:
        place = _PACKAGE / name
        for path in [place] if place.is_file() else sorted(place.rglob("*.py")):
            source = path.read_text(encoding="utf-8")
            if f'"{code}"' in source:
                yield str(path.relative_to(ROOT)), source


def _lines_around(tree: ast.AST, code: str) -> Iterator[int]:
    """The lines of the conditions on which a rule is reported, or of the function that does it."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)) and _names(node, code):
            ifs = [each for each in ast.walk(node) if isinstance(each, ast.If)]
            around = [each for each in ifs if any(_names(under, code) for under in each.body)]
            if around:
                yield from (each.test.lineno for each in around)
            else:
                yield from range(node.lineno, (node.end_lineno or node.lineno) + 1)


def _names(node: ast.AST, code: str) -> bool:
    return any(isinstance(each, ast.Constant) and each.value == code for each in ast.walk(node))


def _spread(mutants: Iterable[Mutant]) -> list[Mutant]:
    """Not two of one line as long as there are other lines."""
    lines: dict[tuple[str, int], list[Mutant]] = {}
    for each in mutants:
        lines.setdefault((each.file, each.line), []).append(each)
    rounds = chain.from_iterable(zip_longest(*lines.values()))
    return [each for each in rounds if each is not None]
