"""Journals of the first edition, in which notes about a model were sentences (journals/README.md).

They are read, shown, replayed and gone on with.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from gpsfsm.cli import main
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.journal_rows import Row, endings, line
from gpsfsm.generation.service import Answered
from tests.cli.support import run
from tests.generation import test_answers as now

OLD = Path(__file__).parent / "journals"
NAMES = ("real_killed", "world_killed", "real_finished", "world_finished")
MODEL = "--model=replay:answers.jsonl"


@pytest.fixture
def old(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for each in OLD.iterdir():
        shutil.copy(each, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def shown(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main([*words]) == 0
    return capsys.readouterr().out


def rows(file: Path) -> list[Row]:
    with JournalReader(str(file)) as reader:
        reader.verify(1)
        return list(reader.events(1))


@pytest.mark.parametrize("name", NAMES)
def test_they_are_shown_as_they_were(
    name: str, old: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    expected = (old / f"{name}.events.txt").read_text(encoding="utf-8")
    assert shown(capsys, "events", f"{name}.db") == expected
    if (old / f"{name}.jsonl").exists():
        expected = (old / f"{name}.jsonl").read_text(encoding="utf-8")
        assert shown(capsys, "events", f"{name}.db", "--format", "jsonl", "--verify") == expected


@pytest.mark.parametrize("name", NAMES)
def test_they_are_replayed(name: str, old: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert (old / f"{name}.db").exists()
    how = "replayed and simulated again" if name == "world_finished" else "replayed"
    count = 42 if name.endswith("finished") else 26
    out = shown(capsys, "replay", f"{name}.db")
    assert how in out
    assert f"all {count} events are the same" in out


def test_a_simulated_one_goes_on_as_if_it_had_not_been_killed(old: Path) -> None:
    """The plan that was accepted is taken from it, and what follows has notes that are data."""
    done = run("resume", "world_killed.db", MODEL, cwd=old)
    assert done.returncode == 0, done.stderr
    both, whole = rows(old / "world_killed.db"), rows(old / "world_finished.db")
    bare = [row._replace(data="") if row.kind == "LOG" else row for row in both]
    assert [line(row) for row in bare] == [line(row) for row in whole]
    assert [line(row) for row in both[:26]] == [line(row) for row in whole[:26]]
    notes = [row.values for row in both[26:] if row.kind == "LOG"]
    request = {"note": "request", "model": "replay:answers.jsonl", "latency_s": 0.5}
    assert notes == [request, request, {"note": "accepted", "attempt": 1}]
    assert run("replay", "world_killed.db", cwd=old).returncode == 0


def test_a_real_one_counts_the_requests_in_it(old: Path) -> None:
    """One number was said and two answers for a plan were taken: the next ones follow."""
    done = run("resume", "real_killed.db", "--real", "--force", MODEL, cwd=old)
    assert done.returncode == 0, done.stderr
    assert b"succeeded: text='Two.'" in done.stdout
    outputs = [row.values for row in rows(old / "real_killed.db") if row.kind == "SUCCEEDED"]
    answers = [json.loads(text) for text in (old / "answers.jsonl").read_text().splitlines()]
    plans = [values["ReceivedPlan"] for values in outputs if "ReceivedPlan" in values]
    assert plans == [answers[3]["answer"], answers[4]["answer"]]


def of_first_edition(these: list[Row]) -> list[Row]:
    return [row._replace(data="") if row.kind == "LOG" else row for row in these]


@pytest.mark.parametrize("place", range(len(now.cuts(now.WHOLE))))
def test_wherever_a_simulated_one_ends_it_goes_on(place: int) -> None:
    """Its own rows come again byte by byte, and the run is the one that was not interrupted."""
    past = of_first_edition(now.WHOLE[: now.cuts(now.WHOLE)[place]])
    whole = now.simulate(now.PLAN, past, now.service(now.model()))
    assert now.lines(whole[: len(past)]) == now.lines(past)
    assert now.lines(of_first_edition(whole)) == now.lines(of_first_edition(now.WHOLE))
    assert now.lines(whole[len(past) :]) == now.lines(now.WHOLE[len(past) :])


def test_a_plan_that_was_accepted_is_taken_from_the_sentence(old: Path) -> None:
    """Whatever came of the plan then."""
    past = endings(rows(old / "world_finished.db"))
    accepted = [ending for ending in past.values() if Answered(ending=ending).accepted]
    assert [ending.parameters["task"] for ending in accepted] == ["Wait.", "Wait."]
