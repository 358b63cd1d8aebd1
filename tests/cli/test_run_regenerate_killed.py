"""A run in which plans give up is killed before each row that it writes, and resumed."""

from __future__ import annotations

import json
import shutil
import signal
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import main
from gpsfsm.execution.journal import Journal
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.journal_rows import jsonl, queue_jsonl
from gpsfsm.execution.queue import QueueRow
from tests.cases import ALL
from tests.cli.regenerating import ARGUMENTS, CLOSING, MODEL, answers, plan, rows, waypoint
from tests.cli.support import run

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


@dataclass(frozen=True)
class Recorded:
    """A whole run: its journal, how many writes that took, and a copy from before each of them."""

    folder: Path
    writes: int
    journal: tuple[list[str], list[str]]

    def left_behind(self) -> Iterator[str]:
        """The journals that a process leaves that is killed before one of its writes.

        They are copied into this folder. Before the first writes there is no run yet.
        """
        for at in range(_FIRST, self.writes + 1):
            for part in _PARTS:
                shutil.copy(self.folder / f"{at}.db{part}", f"{at}.db{part}")
            yield f"{at}.db"


_PARTS = ("", "-wal", "-seen")
_FIRST = 4  # the first write behind the heading of the first run


def whole(path: Path) -> tuple[list[str], list[str]]:
    """All runs and all decisions, without those that were begun once more."""
    with JournalReader(str(path)) as reader:
        assert reader.verify_queue()
        runs = [line for run in reader.runs() for line in jsonl(run, reader.events(run.number))]
        rows = [
            (at_us, QueueRow.stored(kind, plan, by, data, message))
            for _, at_us, kind, plan, by, data, message in reader.queue()
        ]
    places: set[tuple[str, int]] = set()
    decisions = []
    for at_us, row in rows:
        if row.kind == "BEGUN" and (row.kind, row.plan) in places:
            continue
        places.add((row.kind, row.plan))
        decisions.append((at_us, row))
    lines = [json.loads(line) for line in queue_jsonl(decisions)]
    return runs, [json.dumps({**line, "seq": 0}) for line in lines]


def recorded(folder: Path, *arguments: str) -> Recorded:
    writes = 0
    write = Journal._transaction

    def copying(self: Journal, action: Callable[[], object]) -> object:
        nonlocal writes
        writes += 1
        if writes >= _FIRST:
            for part in _PARTS:
                shutil.copy(f"run.db{part}", f"{writes}.db{part}")
        return write(self, action)

    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(Journal, "_transaction", copying)
        assert main(["run", *arguments, "--journal", "run.db", "--durability", "none"]) == 0
    return Recorded(folder, writes, whole(folder / "run.db"))


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """What is in the journal of the whole run, and was in it before each write."""
    folder = tmp_path_factory.mktemp("whole")
    answers(folder)
    return recorded(folder, *ARGUMENTS)


def goes_on_everywhere(expected: Recorded) -> None:
    """Before every third write; CASES=all goes on before each of them."""
    for name in [*expected.left_behind()][:: 1 if ALL else 3]:
        assert whole(Path(name)) != expected.journal, name
        assert main(["resume", name, *MODEL, "--durability", "none"]) == 0, name
        assert whole(Path(name)) == expected.journal, name


def test_it_ends_as_if_it_had_not_been_killed(tmp_path: Path, expected: Recorded) -> None:
    answers(tmp_path)
    assert expected.writes > 30
    goes_on_everywhere(expected)


def test_a_plan_that_gave_up_may_have_submitted_another_one(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    name = "fabric_capabilities/FabricGeneratePlanRunner"
    submits = f'<Runner interface="{name}" provider="{name}" task="Later." uuid="u" flush="true"/>'
    later, now = plan(waypoint(3, 3)), plan(waypoint(2, 3))
    lines = [{"task": "Later.", "answer": later}, {"task": "Now.", "answer": now}]
    text = "".join(json.dumps({**line, "latency_s": 1.5}) + "\n" for line in lines)
    folder = tmp_path_factory.mktemp("whole")
    for each in (tmp_path, folder):
        (each / "a.xml").write_text(plan(submits, waypoint(7, 9)), encoding="utf-8")
        (each / "answers.jsonl").write_text(text, encoding="utf-8")
    completed = recorded(folder, "a.xml", "--world", CLOSING, *MODEL, "--task", "Now.")
    kinds = [(row["kind"], row["plan"]) for row in map(json.loads, completed.journal[1])]
    assert [plan for kind, plan in kinds if kind == "BEGUN"] == [1, 3, 2]
    assert [plan for kind, plan in kinds if kind == "SUBMITTED"] == [1, 2, 3]
    goes_on_everywhere(completed)


def test_an_answer_to_another_prompt_is_not_taken(tmp_path: Path, expected: Recorded) -> None:
    answers(tmp_path)
    name = next(each for each in expected.left_behind() if rows(Path(each), "ATTEMPT"))
    table = rows(Path(name), "ASKED")
    assert main(["resume", name, *MODEL, "--context", "2600"]) == 0
    first, second, *_ = rows(Path(name), "ASKED")
    assert [first] == table
    assert second["why"] == first["why"]  # about the same plan, in other words
    assert second["prompt_sha256"] != first["prompt_sha256"]
    lines = rows(Path(name), "ATTEMPT")
    assert [row["round"] for row in lines][:3] == [1, 1, 2]


@pytest.mark.parametrize(
    ("kind", "when"),
    [("ASKED", "inside"), ("ATTEMPT", "before"), ("GENERATED", "after"), ("SUBMITTED", "inside")],
)
def test_it_ends_so_after_sigkill_too(
    kind: str, when: str, tmp_path: Path, expected: Recorded
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
    assert whole(tmp_path / "run.db") == expected.journal
