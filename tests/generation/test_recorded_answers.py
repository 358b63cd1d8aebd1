"""The answers of three models in a published experiment: the totals on the page."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import answers
from benchmarks.run import replaced

REPO = Path(__file__).parents[2]
PAGE = REPO / "docs" / "generation.md"


@pytest.fixture(scope="module")
def found(shared_corpus: Path) -> dict[tuple[str, str], answers.Tally]:
    assert shared_corpus.is_dir()
    return answers.tally(answers.answers(), answers.successes())


def test_the_totals(found: dict[tuple[str, str], answers.Tally]) -> None:
    whole = answers.total(found.values())
    assert (whole.answers, whole.empty, whole.bare) == (300, 92, 10)
    assert [whole.accepted[stage] for stage in answers.STAGES] == [123, 123, 161]
    assert [whole.right[stage] for stage in answers.STAGES] == [100, 100, 137]
    assert sum(whole.left.values()) == 300 - 123
    assert whole.left["GP501",] == 20
    assert whole.left["GP307",] == 7


def test_fixes_reject_nothing(found: dict[tuple[str, str], answers.Tally]) -> None:
    for each in found.values():
        for counts in (each.accepted, each.right):
            numbers = [counts[stage] for stage in answers.STAGES]
            assert numbers == sorted(numbers)


def test_the_page_shows_these_tables(found: dict[tuple[str, str], answers.Tally]) -> None:
    text = PAGE.read_text(encoding="utf-8")
    tables = f"{answers.accepted_table(found)}\n\n{answers.rejected_table(found)}"
    assert replaced(text, "answers", tables) == text
