"""A run in which plans give up is killed before each row that it writes, and resumed."""

from __future__ import annotations

import json
import signal
from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import main
from gpsfsm.execution.export import jsonl, queue_jsonl
from gpsfsm.execution.journal import Journal
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.queue import QueueRow
from tests.cli.regenerating import ARGUMENTS, CLOSING, MODEL, answers, plan, rows, waypoint
from tests.cli.support import run

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


class KilledError(BaseException):
    """The process is gone."""


def whole(path: Path) -> tuple[list[str], list[str]]:
    """All runs and all decisions, without those that were begun once more."""
    with JournalReader(str(path)) as reader:
        assert reader.verify_queue()
        runs = [line for run in reader.runs() for line in jsonl(run, reader.events(run.number))]
        rows = [
            (at_us, QueueRow.stored(kind, plan, by, data, message))
            for _, at_us, kind, plan, by, data, message in reader.queue()
        ]
    known: set[tuple[str, int]] = set()
    decisions = []
    for at_us, row in rows:
        if row.kind == "BEGUN" and (row.kind, row.plan) in known:
            continue
        known.add((row.kind, row.plan))
        decisions.append((at_us, row))
    lines = [json.loads(line) for line in queue_jsonl(decisions)]
    return runs, [json.dumps({**line, "seq": 0}) for line in lines]


def kill(monkeypatch: pytest.MonkeyPatch, at: int) -> Callable[[], int]:
    """Let the write number ``at`` and all after it fail; returns how many there were."""
    writes = 0
    write = Journal._transaction

    def deadly(self: Journal, action: Callable[[], object]) -> object:
        nonlocal writes
        writes += 1
        if writes >= at:
            raise KilledError
        return write(self, action)

    monkeypatch.setattr(Journal, "_transaction", deadly)
    return lambda: writes


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> tuple[int, tuple[list[str], list[str]]]:
    """How many writes the whole run takes, and what is in its journal then."""
    folder = tmp_path_factory.mktemp("whole")
    answers(folder)
    return uninterrupted(folder, *ARGUMENTS)


def uninterrupted(folder: Path, *arguments: str) -> tuple[int, tuple[list[str], list[str]]]:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        writes = kill(patch, 10**9)
        assert main(["run", *arguments, "--journal", "run.db"]) == 0
        return writes(), whole(folder / "run.db")


def killed_everywhere(
    folder: Path, writes: int, journal: tuple[list[str], list[str]], *arguments: str
) -> None:
    """Before each write but those before the heading of the first run: there is no run yet."""
    for at in range(4, writes + 1):
        name = f"{at}.db"
        with pytest.MonkeyPatch.context() as patch:
            kill(patch, at)
            with pytest.raises(KilledError):
                main(["run", *arguments, "--journal", name, "--durability", "none"])
        assert main(["resume", name, *MODEL, "--durability", "none"]) == 0, at
        assert whole(folder / name) == journal, at


def test_it_ends_as_if_it_had_not_been_killed(
    tmp_path: Path, expected: tuple[int, tuple[list[str], list[str]]]
) -> None:
    writes, journal = expected
    answers(tmp_path)
    assert writes > 30
    killed_everywhere(tmp_path, writes, journal, *ARGUMENTS)


def test_a_plan_that_gave_up_may_have_submitted_another_one(tmp_path: Path) -> None:
    name = "fabric_capabilities/FabricGeneratePlanRunner"
    submits = f'<Runner interface="{name}" provider="{name}" task="Later." uuid="u" flush="true"/>'
    (tmp_path / "a.xml").write_text(plan(submits, waypoint(7, 9)), encoding="utf-8")
    later, now = plan(waypoint(3, 3)), plan(waypoint(2, 3))
    lines = [{"task": "Later.", "answer": later}, {"task": "Now.", "answer": now}]
    text = "".join(json.dumps({**line, "latency_s": 1.5}) + "\n" for line in lines)
    (tmp_path / "answers.jsonl").write_text(text, encoding="utf-8")
    arguments = ("a.xml", "--world", CLOSING, *MODEL, "--task", "Now.")
    writes, journal = uninterrupted(tmp_path, *arguments)
    kinds = [(row["kind"], row["plan"]) for row in map(json.loads, journal[1])]
    assert [plan for kind, plan in kinds if kind == "BEGUN"] == [1, 3, 2]
    assert [plan for kind, plan in kinds if kind == "SUBMITTED"] == [1, 2, 3]
    killed_everywhere(tmp_path, writes, journal, *arguments)


def test_an_answer_to_another_prompt_is_not_taken(
    tmp_path: Path, expected: tuple[int, tuple[list[str], list[str]]]
) -> None:
    answers(tmp_path)
    for at in range(4, expected[0]):
        with pytest.MonkeyPatch.context() as patch:
            kill(patch, at)
            with pytest.raises(KilledError):
                main(["run", *ARGUMENTS, "--journal", f"{at}.db", "--durability", "none"])
        if rows(tmp_path / f"{at}.db", "ATTEMPT"):
            break
    asked = rows(tmp_path / f"{at}.db", "ASKED")
    assert main(["resume", f"{at}.db", *MODEL, "--context", "2600"]) == 0
    first, second, *_ = rows(tmp_path / f"{at}.db", "ASKED")
    assert [first] == asked
    assert second["why"] == first["why"]  # about the same plan, in other words
    assert second["prompt_sha256"] != first["prompt_sha256"]
    told = rows(tmp_path / f"{at}.db", "ATTEMPT")
    assert [row["round"] for row in told][:3] == [1, 1, 2]


@pytest.mark.parametrize(
    ("kind", "when"),
    [("ASKED", "inside"), ("ATTEMPT", "before"), ("GENERATED", "after"), ("SUBMITTED", "inside")],
)
def test_it_ends_so_after_sigkill_too(
    kind: str, when: str, tmp_path: Path, expected: tuple[int, tuple[list[str], list[str]]]
) -> None:
    """Twice: the process that goes on is killed as well, at the next such row."""
    answers(tmp_path)
    resume = ["resume", "run.db", *MODEL]
    first = "2" if kind == "SUBMITTED" else "1"  # the first one is that of the command line
    following = "1" if when == "after" else "2"
    for number, command in (
        (first, ["run", *ARGUMENTS, "--journal", "run.db"]),
        (following, resume),
    ):
        done = run(kind, number, when, *command, cwd=tmp_path, module="tests.cli.killed_run")
        assert done.returncode == -signal.SIGKILL, done.stderr
    assert main(resume) == 0
    assert whole(tmp_path / "run.db") == expected[1]
