"""A tiny campaign, and that a campaign would notice: what differs is found, small and kept."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from hypothesis import strategies as st

from tests.campaigns import __main__ as command
from tests.campaigns import batch as batches
from tests.campaigns.base import Pair, UnknownError
from tests.campaigns.batch import play, seed_of
from tests.campaigns.counts import Counts
from tests.campaigns.page import table
from tests.campaigns.registry import all_pairs

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@pytest.mark.campaign
@pytest.mark.parametrize("name", all_pairs())
def test_a_few_cases_agree(name: str) -> None:
    pair = all_pairs()[name]
    if pair.missing():
        pytest.skip(pair.missing())
    done = play(name, 0, 0, pair.few)
    assert done.failure is None, f"{done.failure.text}\n{done.failure.said}"
    assert (done.cases > 0, done.unknown) == (True, 0)
    assert done.labels


def judge(number: int) -> Iterator[str]:
    if number == 13:
        raise UnknownError("no answer")
    assert number < 500, "five hundred is too much"
    yield "small"


SUMS = Pair(
    name="sums",
    about="numbers",
    cases=lambda: st.integers(0, 1_000),
    judge=judge,
    text=str,
    full=300,
    batch=100,
)


@pytest.fixture
def sums(monkeypatch: pytest.MonkeyPatch) -> Pair:
    for module in (batches, command):
        monkeypatch.setattr(module, "all_pairs", lambda: {"sums": SUMS})
    return SUMS


@pytest.mark.usefixtures("sums")
def test_a_disagreement_is_found_and_made_small() -> None:
    done = play("sums", 1, 0, 100)
    assert done.failure is not None
    assert done.failure.text == "500"
    assert "five hundred is too much" in done.failure.said
    assert done.labels == {"small": done.cases}


@pytest.mark.usefixtures("sums")
def test_a_disagreement_is_kept_and_comes_back(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command.main(["--failures", str(tmp_path), "--seed", "4"]) == 1
    (place,) = tmp_path.iterdir()
    assert (place / "case.txt").read_text() == "500"
    said = (place / "said.txt").read_text()
    words = said.splitlines()[0].split()[3:]
    assert words == ["--only", "sums", "--seed", "4", "--batch", place.name.rpartition("-")[2]]
    assert command.main(words) == 1
    assert "a disagreement, see" in capsys.readouterr().out


def test_no_answer_is_no_agreement(monkeypatch: pytest.MonkeyPatch) -> None:
    silent = Pair(name="sums", about="", cases=lambda: st.just(13), judge=judge, text=str)
    monkeypatch.setattr(batches, "all_pairs", lambda: {"sums": silent})
    done = play("sums", 1, 0, 10)
    assert (done.cases, done.unknown, done.failure) == (0, 1, None)


def test_batches_are_drawn_from_their_own_seeds() -> None:
    same = [play("tinyxml", 1, 3, 20).labels for _ in range(2)]
    assert same[0] == same[1]
    seeds = {seed_of(name, seed, n) for name in "ab" for seed in (1, 2) for n in range(5)}
    assert len(seeds) == 20


def test_each_has_a_batch_however_short_the_time_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last four attacks of a minute passed on a slow machine, without a case."""
    of = {name: replace(SUMS, name=name, cases=lambda: st.integers(0, 9)) for name in "abc"}
    for module in (batches, command):
        monkeypatch.setattr(module, "all_pairs", lambda: of)
    file = tmp_path / "counts.json"
    assert command.main(["--seconds", "0", "--counts", str(file)]) == 0
    counts = json.loads(file.read_text())["of"]
    assert {name: counts[name]["batches"] for name in counts} == {"a": 1, "b": 1, "c": 1}


def test_counts_go_on_where_they_ended(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if all_pairs()["tinyxml"].missing():
        pytest.skip(all_pairs()["tinyxml"].missing())
    file = tmp_path / "counts.json"
    words = ["--only", "tinyxml", "--counts", str(file), "--cases"]
    assert command.main([*words, "20"]) == 0
    first = json.loads(file.read_text())["of"]["tinyxml"]
    assert first["batches"] == 1
    assert first["cases"] <= 20
    assert command.main([*words, "60"]) == 0
    second = json.loads(file.read_text())["of"]["tinyxml"]
    assert second["batches"] == 2
    assert first["cases"] < second["cases"] <= 60
    assert table(Counts.load(file, 1)) in capsys.readouterr().out
    with pytest.raises(ValueError, match="of seed 1, not of 2"):
        Counts.load(file, 2)


@pytest.mark.parametrize("words", [["--only", "nothing"], ["--without", "nothing"]])
def test_unknown_names(words: list[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        command.main(words)
    assert stopped.value.code == 2
