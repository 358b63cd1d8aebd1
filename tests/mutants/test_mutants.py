"""Planting mutants: each is a change, is valid Python, and the right tests are run for it."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from gpsfsm.analysis.rules import all_rules
from tests.conftest import REPO
from tests.mutants.operators import Mutant, mutants_of, planted
from tests.mutants.report import report
from tests.mutants.samples import of_rules, over_analysis, rules
from tests.mutants.suites import suites_of

if TYPE_CHECKING:
    from pathlib import Path

SOURCE = '''"""Words and (and nothing."""
if TYPE_CHECKING:
    _MOST = 3

def first(values: list[int], most: int = 3) -> bool:
    """Not 1 == 2."""
    assert most > 1
    found = [value for value in values if value < most]
    if not found or most + 1 == 4:
        return any(found)
    return f"(and {most} x)" is not None
'''


def test_the_changes_of_a_small_module() -> None:
    mutants = mutants_of("m.py", SOURCE)
    assert [(each.line, each.change) for each in mutants] == [
        (8, "a filter is left out"),
        (8, "Lt becomes LtE"),
        (9, "the condition is negated"),
        (9, "or becomes and"),
        (9, "not is left out"),
        (9, "Eq becomes NotEq"),
        (9, "Add becomes Sub"),
        (9, "1 becomes 2"),
        (9, "4 becomes 5"),
        (10, "any becomes all"),
        (11, "IsNot becomes Is"),
        (11, "(and becomes (or "),
    ]
    texts = [planted(SOURCE, each) for each in mutants]
    assert len(set(texts)) == len(mutants)
    assert "if value < most" not in texts[0]
    assert "if found or" in texts[4]
    assert "(or {most} x)" in texts[-1]


def test_every_mutant_of_a_module_is_another_module() -> None:
    name = "analysis/decisions/stuck.py"
    source = (REPO / name).read_text(encoding="utf-8")
    mutants = mutants_of(name, source)
    texts = {planted(source, each) for each in mutants}
    assert len(mutants) > 5
    assert len(texts) == len(mutants)


@pytest.mark.campaign
def test_the_samples_are_functions_of_the_seed() -> None:
    first, again, other = over_analysis(1), over_analysis(1), over_analysis(2)
    assert first == again
    assert first != other
    assert sorted(map(str, first)) == sorted(map(str, other))
    assert {each.file.split("/")[0] for each in first} == {"analysis"}
    assert len(set(map(str, first))) == len(first)
    assert of_rules(1, 2) == of_rules(1, 2)
    assert of_rules(1, 2) != of_rules(2, 2)


def test_every_rule_has_defects_where_it_is_found() -> None:
    kept = of_rules(1, 2)
    codes = [code for code, _ in kept]
    assert sorted(set(codes)) == [rule.code for rule in all_rules()] == list(rules())
    assert max(map(codes.count, codes)) == 2
    places = {code: mutant.file for code, mutant in kept}
    assert places["GP302"] == "analysis/rules/gp302_dangling_failure.py"
    assert places["GP112"] == "gpsfsm/syntax/elements.py"
    assert places["GP604"] == "gpsfsm/tasks/steps.py"
    assert places["GP812"].startswith("gpsfsm/syntax/tree")


def test_the_tests_of_every_module_are_there() -> None:
    files = {mutant.file: code for code, mutant in of_rules(1, 2)}
    files |= {mutant.file: "" for mutant in over_analysis(1)}
    for file, code in files.items():
        for test, *_ in suites_of(file, code):
            assert (REPO / test.partition("::")[0]).exists(), file


def test_the_report_lists_survivors() -> None:
    mutants = [Mutant("analysis/a.py", n, n, "or becomes and") for n in range(5)]
    ends = ("killed", "killed", "timed out", "survived")
    results = {str(each): end for each, end in zip(mutants, ends, strict=False)}
    of_each = [("GP301", mutants[0]), ("GP302", mutants[3]), ("GP303", mutants[4])]
    text = report(results, of_each, mutants, 90)
    assert "| of each of 2 rules | 2 | 1 | 0 | 1 | 50.0 % |" in text
    assert "| of all 90 in `analysis/` | 4 | 2 | 1 | 1 | 75.0 % |" in text
    assert "| both | 4 | 2 | 1 | 1 | 75.0 % |" in text
    assert "noticed of 1 of the 2 rules" in text
    assert text.splitlines()[-1] == "| `analysis/a.py:3` | or becomes and (3) |"


@pytest.mark.campaign
def test_a_defect_of_a_rule_is_planted_in_a_copy_and_noticed(tmp_path: Path) -> None:
    file = tmp_path / "results.json"
    options = ("--rule", "GP304", "--each-rule", "1", "--mutants", "0", "--results", str(file))
    command = (sys.executable, "-m", "tests.mutants", *options)
    done = subprocess.run(command, cwd=REPO, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert list(json.loads(file.read_text(encoding="utf-8")).values()) == ["killed"]
    assert "| of each of 1 rules | 1 | 1 | 0 | 0 | 100.0 % |" in done.stdout
    source = REPO / "analysis" / "rules" / "gp30x_completion.py"
    assert "completes is Frequency.NEVER and" in source.read_text(encoding="utf-8")
