"""``gpsfsm run --model``: a plan that gives up is continued by plans that a model writes."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import main
from tests.cli.regenerating import (
    ARGUMENTS,
    CLOSING,
    ELSEWHERE,
    MISSION,
    MODEL,
    TASK,
    TO_ANNEX,
    answers,
    plan,
    rows,
    statuses,
    waypoint,
)
from tests.cli.support import write

if TYPE_CHECKING:
    from pathlib import Path


def ran(*arguments: str, capsys: pytest.CaptureFixture[str], code: int = 0) -> tuple[str, str]:
    exit_code = main(["run", *arguments])
    out, err = capsys.readouterr()
    assert exit_code == code, (exit_code, out, err)
    return out, err


def shown(command: str, *arguments: str, capsys: pytest.CaptureFixture[str], code: int = 0) -> str:
    exit_code = main([command, *arguments])
    out, err = capsys.readouterr()
    assert exit_code == code, (exit_code, out, err)
    return out + err


# -- a world -------------------------------------------------------------------------------------


def test_a_mission_is_finished_by_the_second_plan_that_a_model_writes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    answers(tmp_path)
    out, err = ran(*ARGUMENTS, "--journal", "run.db", capsys=capsys)
    assert err == ""
    lines = [line for line in out.splitlines() if not line.startswith(" ")]
    assert lines == [
        "GAVE_UP after 9.518 s: 2 started, 1 succeeded, 1 failed",
        "plan 1 gave up; replay:answers.jsonl is asked for a plan that continues it",
        "attempt 1: rejected, there is no plan in the answer; 1.5 s",
        "attempt 2: accepted; 1.5 s",
        "== plan 2, which continues plan 1",
        "GAVE_UP after 14.229 s: 2 started, 1 succeeded, 1 failed",
        "plan 2 gave up; replay:answers.jsonl is asked for a plan that continues it",
        "attempt 1: plan 2 is the same, and it gave up; 1.5 s",
        "attempt 2: accepted; 1.5 s",
        "== plan 3, which continues plan 2",
        "COMPLETED after 8.295 s: 1 started, 1 succeeded, 0 failed",
    ]
    assert statuses(tmp_path / "run.db") == ["GAVE_UP", "GAVE_UP", "COMPLETED"]
    requests = [str(row["asked"]) for row in rows(tmp_path / "run.db", "ATTEMPT")]
    assert f"Task: {TASK}" in requests[0]
    assert "- line 5  WaypointRunner (x=2.0, y=5.0): succeeded" in requests[0]
    assert "no way leads to (6.5, 4.5): the zone 'office door' is closed" in requests[0]
    assert "- The robot is at x=2, y=5 " in requests[0]
    assert "plan 2 is the same, and it gave up" in requests[3]
    assert "- The robot is at x=1, y=1 " in requests[2]
    assert "What came of plan 1:" in requests[2]
    assert TO_ANNEX in requests[2]


def test_it_is_one_story(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answers(tmp_path)
    ran(*ARGUMENTS, "--journal", "run.db", capsys=capsys)
    lines = [
        line
        for line in shown("events", "run.db", capsys=capsys).splitlines()
        if not line[:6].strip().isdecimal() and "what has happened" not in line
    ]
    why = "line 6  WaypointRunner (x=6.5, y=4.5) failed: no way leads to (6.5, 4.5)"
    again = "line 3  WaypointRunner (x=6.5, y=1.5) failed: no way leads to (6.5, 1.5)"
    text = "replay:answers.jsonl is asked for a plan that continues it"
    assert lines == [
        "plan 1 of 3 in queue 1",
        "plan 1 gave up:",
        f"  {text}: {why}: the zone 'office door' is closed",
        "  attempt 1: rejected, there is no plan in the answer",
        "  attempt 2: accepted",
        "  the plan of attempt 2 is taken",
        "",
        "plan 2 of 3 in queue 1, generated because plan 1 gave up",
        "plan 2 gave up:",
        f"  {text}: {again}: the zone 'annex door' is closed",
        "  attempt 1: plan 2 is the same, and it gave up",
        "  attempt 2: accepted",
        "  the plan of attempt 2 is taken",
        "",
        "plan 3 of 3 in queue 1, generated because plan 2 gave up",
    ]
    one = shown("events", "run.db", "--run", "3", "--verify", capsys=capsys)
    assert one.startswith("plan 3 of 3 in queue 1, generated because plan 2 gave up\n")
    queue = shown("events", "run.db", "--queue", capsys=capsys)
    assert "it is queued, to continue where plan 1 gave up" in queue
    assert "attempt 1: rejected, there is no plan in the answer" in queue
    assert shown("attempts", "run.db", capsys=capsys).count("a plan was accepted") == 2
    replayed = shown("replay", "run.db", capsys=capsys)
    assert [line[:7] for line in replayed.splitlines()] == ["run 1 (", "run 2 (", "run 3 ("]
    assert shown("replay", "run.db", "--run", "2", capsys=capsys).startswith("run 2 (GAVE_UP)")
    done = shown("resume", "run.db", *MODEL, capsys=capsys)
    assert "run 3 has ended already: COMPLETED" in done


def test_the_same_bytes_each_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answers(tmp_path)
    actual = set()
    for number in range(3):
        journal = f"{number}.db"
        out, _ = ran(*ARGUMENTS, "--journal", journal, capsys=capsys)
        queue = shown("events", journal, "--queue", "--format", "jsonl", capsys=capsys)
        runs = [
            shown("events", journal, "--run", f"{n}", "--format", "jsonl", capsys=capsys)
            for n in (1, 2, 3)
        ]
        actual.add((out, queue, *runs))
    assert len(actual) == 1


def test_it_is_the_same_without_a_journal_and_at_a_speed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    answers(tmp_path)
    out, _ = ran(*ARGUMENTS, capsys=capsys)
    assert ran(*ARGUMENTS, "--speed", "1000", capsys=capsys)[0] == out
    lines = ran(*ARGUMENTS, "--format", "json", capsys=capsys)[0].splitlines()
    assert [json.loads(line).get("journal") for line in lines].count(1) == 3


def test_plans_that_wait_come_behind_the_chain(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    answers(tmp_path, ELSEWHERE)
    write(tmp_path, other=plan(waypoint(1, 3)))
    out, _ = ran(MISSION, "other.xml", *ARGUMENTS[1:], capsys=capsys)
    assert [line for line in out.splitlines() if line.startswith("==")] == [
        f"== plan 1: {MISSION}",
        "== plan 3, which continues plan 1",
        "== plan 2: other.xml",
    ]


def test_without_a_task_the_plan_says_what_it_is_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    answers(tmp_path, ELSEWHERE)
    ran(MISSION, "--world", CLOSING, *MODEL, "--journal", "run.db", capsys=capsys)
    (request,) = (str(row["asked"]) for row in rows(tmp_path / "run.db", "ATTEMPT"))
    assert "Task: Achieve what this plan was to achieve. It says of itself: Fetch" in request
    assert "ignore GP302" not in request.partition("\n")[0]
    assert request.count('<Plan name="closed_door">') == 2  # as the task, and as what was tried


def test_a_task_in_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answers(tmp_path, ELSEWHERE)
    (tmp_path / "task.txt").write_text("Get to the window.\n", encoding="utf-8")
    how = (*MODEL, "--task-file", "task.txt", "--journal", "run.db")
    ran(MISSION, "--world", CLOSING, *how, capsys=capsys)
    (request,) = (str(row["asked"]) for row in rows(tmp_path / "run.db", "ATTEMPT"))
    assert request.startswith("Task: Get to the window.\n")


# -- when it does not work -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("said", "options", "reason"),
    [
        (["No."], [], "no plan was accepted in 3 attempts"),
        (["No."], ["--attempts", "1"], "no plan was accepted in 1 attempt"),
        (['<Plan><Control type="recovery"/></Plan>'], [], "no plan was accepted in 3 attempts"),
        (["No."], ["--context", "300"], "the model can read 300 tokens"),
        (["<Plan></Plan>"], [], "no plan was accepted in 3 attempts"),
        ([ELSEWHERE], ["--regenerations", "1", "--regenerate-for", "1"], ""),
        ([TO_ANNEX], ["--regenerations", "1"], "no more than 1 continuation may be asked for"),
        ([TO_ANNEX], ["--regenerate-for", "1"], "the time of 1 s for continuations is over"),
    ],
)
def test_what_ends_a_chain(
    said: list[str],
    options: list[str],
    reason: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    answers(tmp_path, *said * 3)
    code = 1 if reason else 0
    _, err = ran(*ARGUMENTS, *options, "--journal", "run.db", capsys=capsys, code=code)
    assert reason in err
    assert bool(err) is bool(reason)
    last = statuses(tmp_path / "run.db")[-1]
    assert last == ("GAVE_UP" if reason else "COMPLETED")
    regenerations = len(rows(tmp_path / "run.db", "ASKED"))
    text = shown("attempts", "run.db", capsys=capsys, code=0 if regenerations else 2)
    assert text.count("session ") == regenerations
    if reason:
        assert "has ended already: GAVE_UP" in shown(
            "resume", "run.db", *MODEL, capsys=capsys, code=1
        )
        assert reason in shown("events", "run.db", capsys=capsys)


def test_the_first_plan_in_other_words_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    same = plan("<!-- quite another one -->", waypoint(2.0, 5.0), waypoint(6.5, 4.5))
    answers(tmp_path, same, ELSEWHERE)
    out, _ = ran(*ARGUMENTS, capsys=capsys)
    assert "attempt 1: rejected, 1 error (repeated)" in out
    assert "attempt 2: accepted" in out


def test_a_model_that_cannot_be_reached(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answers(tmp_path)
    how = ("--model", "openai-compatible:tiny", "--base-url", "http://127.0.0.1:9", "--retries=0")
    out, err = ran(MISSION, "--world", CLOSING, *how, capsys=capsys, code=1)
    assert "plan 1 is not continued: " in err
    assert "127.0.0.1:9" in err
    assert "attempt 1: " in out


def test_what_a_small_model_is_not_told_is_told_to_people_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    answers(tmp_path)
    out, _ = ran(*ARGUMENTS, "--context", "2600", "--journal", "run.db", capsys=capsys)
    first, second, *_ = (line for line in out.splitlines() if line.startswith("attempt "))
    assert "; left out " in first
    assert "left out " not in second
    data = rows(tmp_path / "run.db", "ATTEMPT")
    assert str(data[0]["note"]).startswith("left out ")
    left_out = str(data[0]["note"]).replace(",", " ").split()
    assert "nav2_capabilities/WaypointRunner" not in left_out  # the plan has one
    assert "note" not in data[1] or "capabilities" not in str(data[1]["note"])


def test_a_task_that_is_too_long_is_told_before_anything_runs(
    capsys: pytest.CaptureFixture[str],
) -> None:
    how = (MISSION, "--world", CLOSING, *MODEL, "--task", "go " * 33_400)
    out, err = ran(*how, capsys=capsys, code=2)
    assert out == ""
    assert "the task is longer than 100,000 characters" in err


def test_without_a_model_the_run_ends_and_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    out, err = ran(MISSION, "--world", CLOSING, capsys=capsys, code=1)
    assert out.splitlines()[-1] == (
        "No model that could write a plan to continue from here is named (--model)."
    )
    assert err == ""


def test_nothing_is_asked_for_that_was_not_wanted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    answers(tmp_path)
    out, _ = ran(*ARGUMENTS, "--regenerations", "0", capsys=capsys, code=1)
    assert out.splitlines()[-1].startswith("GAVE_UP after 9.518 s")
    monkeypatch.setenv("GPSFSM_MODEL", "replay:answers.jsonl")  # for other commands
    out, _ = ran(MISSION, "--world", CLOSING, capsys=capsys, code=1)
    assert "is asked" not in out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--task", "x"], "--task needs a model; name one with --model"),
        (["--regenerations", "2"], "--regenerations needs a model; name one"),
        ([*MODEL, "--task", "x", "--task-file", "y"], "give the task or --task-file, not both"),
        ([*MODEL, "--task", " "], "there is no task"),
        ([*MODEL, "--regenerate-for", "nan"], "'--regenerate-for': nan is not a finite number"),
        (["--model", "replay:gone.jsonl"], "gone.jsonl: is not a file with recorded answers"),
    ],
)
def test_options_that_make_no_sense(
    options: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    answers(tmp_path)
    _, err = ran(MISSION, "--world", CLOSING, *options, capsys=capsys, code=2)
    assert message in err


def test_a_chain_that_was_changed_is_noticed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    answers(tmp_path)
    ran(*ARGUMENTS, "--journal", "run.db", capsys=capsys)
    monkeypatch.setattr(
        "gpsfsm.running.replaying.broken_link", lambda _rows: "plan 2 is another one"
    )
    text = shown("replay", "run.db", capsys=capsys, code=1)
    assert text == "gpsfsm: run.db: plan 2 is another one\n"
