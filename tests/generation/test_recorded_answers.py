"""The answers of three models in a published experiment: what fixes make of them, and the page."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import answers
from benchmarks.run import replaced
from gpsfsm.compile.plan_text import holds_trees

REPO = Path(__file__).parents[2]
PAGE = REPO / "docs" / "generation.md"


@pytest.fixture(scope="module")
def tallies(shared_corpus: Path) -> dict[tuple[str, str], answers.Tally]:
    assert shared_corpus.is_dir()
    return answers.tally(answers.answers(), answers.successes())


def test_the_totals(tallies: dict[tuple[str, str], answers.Tally]) -> None:
    whole = answers.total(tallies.values())
    assert (whole.answers, whole.empty, whole.bare) == (300, 92, 10)
    assert [whole.accepted[stage] for stage in answers.STAGES] == [123, 123, 161]
    assert [whole.right[stage] for stage in answers.STAGES] == [100, 100, 137]
    assert sum(whole.left.values()) == 300 - 123
    assert whole.left["GP501",] == 20
    assert whole.left["GP307",] == 7


def test_fixes_make_plans_right_and_none_wrong(
    tallies: dict[tuple[str, str], answers.Tally],
) -> None:
    """As people judged plans of the same automaton."""
    right = answers.successes()
    for row in answers.answers():
        plans = answers.judge(row["response"]).plans
        wanted = right[str(row["task"])]
        is_right = [plan is not None and answers.meaning(plan) in wanted for plan in plans]
        assert is_right == sorted(is_right), row["id"]
        if row["model"] == "gpt":  # so it makes no difference whether trees are plans as well
            assert not holds_trees(row["response"], from_response=True)
    of_one = answers.total(each for (model, _), each in tallies.items() if model == "GPT-4o")
    assert [of_one.accepted[stage] for stage in answers.STAGES] == [93, 93, 100]
    assert [of_one.right[stage] for stage in answers.STAGES] == [80, 80, 97]


def test_fixes_reject_nothing(tallies: dict[tuple[str, str], answers.Tally]) -> None:
    for each in tallies.values():
        for counts in (each.accepted, each.right):
            numbers = [counts[stage] for stage in answers.STAGES]
            assert numbers == sorted(numbers)


def test_the_page_shows_these_tables(tallies: dict[tuple[str, str], answers.Tally]) -> None:
    text = PAGE.read_text(encoding="utf-8")
    tables = f"{answers.accepted_table(tallies)}\n\n{answers.rejected_table(tallies)}"
    assert replaced(text, "answers", tables) == text
