"""The house's language: what may still be there, and may only become less.

``tests/allowed.json`` holds per package how often a house rule of CONTRIBUTING.md is broken. Who
breaks it less often lowers the number (``GPSFSM_UPDATE_GOLDEN=1`` does it); nothing raises it.
"""

from __future__ import annotations

import ast
import importlib.util
import json
import os
import re
from collections import Counter
from functools import cache
from pathlib import Path
from types import ModuleType

import pytest

REPO = Path(__file__).parents[1]
ALLOWED = Path(__file__).with_name("allowed.json")
RULES = ("names", "docstrings", "suppressions")
MOST_MODULES = 529
MOST_LINES_OF_COMMANDS = 6_848
MOST_WITHOUT_CLICK = 0
"""These only become less, too."""
_NO_SUBJECT = re.compile(r"(?:What|Whether|How|Who|That|Which|Where|Why)\b")


def _house() -> ModuleType:
    spec = importlib.util.spec_from_file_location("house", REPO / "docs" / "house.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    import sys

    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


HOUSE = _house()


def subjectless(tree: ast.AST) -> int:
    """How many docstrings begin with a word that leaves their subject open."""
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    texts = (ast.get_docstring(node) for node in ast.walk(tree) if isinstance(node, documented))
    return sum(1 for text in texts if text and _NO_SUBJECT.match(text))


@cache
def broken_rules() -> dict[str, dict[str, int]]:
    """Per rule and package how often the rule is broken."""
    counts: dict[str, Counter[str]] = {rule: Counter() for rule in RULES}
    for folder in HOUSE.PRODUCT:
        for file in HOUSE.python_files(REPO / folder):
            package = ".".join(HOUSE.module_name(file, REPO).split(".")[:2])
            text = file.read_text(encoding="utf-8")
            tree = ast.parse(text)
            counts["names"][package] += len(HOUSE.banned_names(tree))
            counts["docstrings"][package] += subjectless(tree)
            counts["suppressions"][package] += sum(
                HOUSE.SUPPRESSION.search(line) is not None for line in text.splitlines()
            )
    return {
        rule: {package: count for package, count in sorted(counted.items()) if count}
        for rule, counted in counts.items()
    }


@pytest.mark.parametrize("rule", RULES)
def test_what_is_allowed_only_becomes_less(rule: str) -> None:
    allowed: dict[str, dict[str, int]] = json.loads(ALLOWED.read_text(encoding="utf-8"))
    now = broken_rules()[rule]
    more = {each: count for each, count in now.items() if count > allowed[rule].get(each, 0)}
    assert not more, f"more than before; allowed: {[allowed[rule].get(each, 0) for each in more]}"
    if now != allowed[rule] and "GPSFSM_UPDATE_GOLDEN" in os.environ:
        allowed[rule] = now
        ALLOWED.write_text(json.dumps(allowed, indent=2) + "\n", encoding="utf-8")
    assert now == allowed[rule], "fewer than before: set GPSFSM_UPDATE_GOLDEN=1 and commit"


def test_names_are_split_into_their_words() -> None:
    source = "def asked_for(told):\n    self.wayThrough, bylaw, knowledge = told\n"
    assert sorted(HOUSE.banned_names(ast.parse(source))) == ["asked_for", "told", "wayThrough"]


def test_the_house_stays_small() -> None:
    modules = [file for folder in HOUSE.PRODUCT for file in HOUSE.python_files(REPO / folder)]
    assert len(modules) <= MOST_MODULES
    figures = HOUSE.command_line(REPO)
    lines = int(figures["command_line"].split(" / ")[1].replace(",", ""))
    assert lines <= MOST_LINES_OF_COMMANDS
    assert int(figures["without_click"]) <= MOST_WITHOUT_CLICK
