"""Planting mutants: each is a change, is valid Python, and the right tests are run for it."""

from __future__ import annotations

from tests.conftest import REPO
from tests.mutants.__main__ import report, sample
from tests.mutants.operators import Mutant, mutants_of, planted
from tests.mutants.suites import suites_of

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
    found = mutants_of("m.py", SOURCE)
    assert [(each.line, each.change) for each in found] == [
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
    texts = [planted(SOURCE, each) for each in found]
    assert len(set(texts)) == len(found)
    assert "if value < most" not in texts[0]
    assert "if found or" in texts[4]
    assert "(or {most} x)" in texts[-1]


def test_every_mutant_of_a_module_is_another_module() -> None:
    name = "analysis/decisions/stuck.py"
    source = (REPO / name).read_text(encoding="utf-8")
    found = mutants_of(name, source)
    texts = {planted(source, each) for each in found}
    assert len(found) > 5
    assert len(texts) == len(found)


def test_the_sample_is_a_function_of_the_seed() -> None:
    first, again, other = sample(1), sample(1), sample(2)
    assert first == again
    assert first != other
    assert sorted(map(str, first)) == sorted(map(str, other))
    assert {each.file.split("/")[0] for each in first} == {"analysis"}


def test_the_tests_of_every_module_are_there() -> None:
    for each in {mutant.file: mutant for mutant in sample(1)}.values():
        for test, *_ in suites_of(each.file):
            assert (REPO / test.partition("::")[0]).exists(), each.file


def test_the_report_lists_survivors() -> None:
    mutants = [Mutant("analysis/a.py", n, 0, "or becomes and") for n in range(4)]
    ends = ("killed", "killed", "timed out", "survived")
    results = {str(each): end for each, end in zip(mutants, ends, strict=True)}
    text = report(results, 90, 1)
    assert text.startswith("4 of 90 mutants, drawn with seed 1: 2 killed, 1 killed by the time")
    assert "75 % noticed" in text
    assert text.splitlines()[-1] == "| `analysis/a.py:3` | or becomes and |"
