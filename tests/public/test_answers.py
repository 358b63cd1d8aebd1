"""``grade``, ``rewards`` and ``generate`` from Python, beside the commands."""

from __future__ import annotations

import asyncio
import json
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pytest

import gpsfsm
from gpsfsm.grading.table_one import evaluate
from tests.cli.support import run

TASK = "interface: GoRunner\nplaces: {A: {x: 1}}\nsteps: [{do: A}]\n"
GOOD = '<Plan><Runner interface="demo/GoRunner" provider="demo/GoRunner" x="1"/></Plan>'
WORDS = Path("corpus/generation/task.txt").read_text(encoding="utf-8")
MODEL = "replay:corpus/generation/answers.jsonl"


@pytest.fixture
def answers(tmp_path: Path) -> list[str]:
    texts = {"good.xml": GOOD, "bad.xml": GOOD.replace("1", "2"), "none.xml": "I cannot."}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "task.yaml").write_text(TASK)
    return [str(tmp_path / name) for name in texts]


def test_grade_is_what_the_command_prints(answers: list[str], tmp_path: Path) -> None:
    task = tmp_path / "task.yaml"
    graded = gpsfsm.grade(answers, task)
    printed = run("grade", "--task", str(task), "--table", "json", *answers).stdout
    assert graded.to_dict() == json.loads(printed)
    assert [each.grade for each in graded.grades] == ["success", "partial", "failed"]


def test_a_text_is_graded_as_it_is() -> None:
    assert gpsfsm.grade("I cannot do that.", TASK).grades[0].grade == "failed"
    assert gpsfsm.grade(GOOD, TASK).grades[0].to_dict()["syntax"] is True


def test_progress_is_told_after_each_item(answers: list[str]) -> None:
    counts: list[tuple[int, int | None]] = []

    def progress(done: int, total: int | None) -> None:
        counts.append((done, total))

    expected = [(1, 3), (2, 3), (3, 3)]
    for call in (
        lambda: gpsfsm.check(answers, progress=progress),
        lambda: gpsfsm.grade(answers, TASK, progress=progress),
        lambda: gpsfsm.rewards([GOOD, "no", ""], TASK, progress=progress),
        lambda: gpsfsm.fuzz(GOOD, runs=3, progress=progress),
    ):
        counts.clear()
        call()
        assert counts == expected
    counts.clear()
    gpsfsm.check(GOOD, progress=progress)
    assert counts == [(1, 1)]
    counts.clear()
    evaluate([], "experiments/navigation", progress=progress)
    assert counts == []


def test_generate_is_what_the_command_prints(tmp_path: Path) -> None:
    printed = run("generate", WORDS, "--model", MODEL, "--no-journal", "--format", "json").stdout
    steps: list[tuple[int, int | None]] = []
    journal = tmp_path / "kept.db"
    generated = gpsfsm.generate(
        WORDS, model=MODEL, journal=journal, progress=lambda *both: steps.append(both)
    )
    assert generated.accepted
    assert generated.to_dict() == json.loads(printed)
    assert steps == [(done, 3) for done in range(1, len(generated.attempts) + 1)]
    assert b"a plan was accepted" in run("attempts", str(journal)).stdout
    assert asyncio.run(gpsfsm.generate_async(WORDS, model=MODEL)).plan == generated.plan


def test_an_event_loop_goes_on_while_an_answer_is_checked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    checked: list[str] = []

    class Apart(AbstractContextManager[Any]):
        """Needs the event loop of the caller for each answer, as nobody does who blocks it."""

        def __init__(self, judge: Any) -> None:
            self._judge, self._loop = judge, asyncio.get_running_loop()

        def __exit__(self, *_: object) -> None:
            pass

        def __call__(self, answer: str) -> Any:
            asyncio.run_coroutine_threadsafe(asyncio.sleep(0), self._loop).result(timeout=60)
            checked.append(answer)
            return self._judge(answer)

    monkeypatch.setattr("gpsfsm.running.search.JudgeApart", Apart)
    assert asyncio.run(gpsfsm.generate_async(WORDS, model=MODEL)).accepted
    assert checked
