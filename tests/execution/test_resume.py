"""A run whose process has ended goes on as if nothing had happened, or as its plan says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.errors import UsageError
from gpsfsm.execution.journal import Heading, Journal
from gpsfsm.execution.journal_errors import ReplayDivergence
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Left, Start, Status
from gpsfsm.execution.replay import (
    Adopting,
    Comparing,
    resume_into,
    settle,
    simulate_again,
    take_up,
)
from tests.execution.journaling import (
    SMALL,
    closed_again,
    compiled,
    cut,
    driver,
    ends_of_writes,
    exported,
    opened_up,
    resume_journaled,
    run_journaled,
)

if TYPE_CHECKING:
    from pathlib import Path

    from gpsfsm.execution.host import Sink

# -- virtual time -------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [1, 2, 10])
def test_from_every_point_a_run_ends_as_without_a_break(tmp_path: Path, seed: int) -> None:
    whole = tmp_path / "whole.db"
    run_journaled(whole, seed=seed)
    expected = exported(whole)
    for last in ends_of_writes(whole):
        cut(whole, tmp_path / "cut.db", last)
        assert len(exported(tmp_path / "cut.db").splitlines()) == last + 1
        assert resume_journaled(tmp_path / "cut.db").status.ended
        assert exported(tmp_path / "cut.db") == expected


def test_resuming_what_has_ended_writes_nothing(tmp_path: Path) -> None:
    run_journaled(tmp_path / "j.db", seed=2)
    before = exported(tmp_path / "j.db")
    assert resume_journaled(tmp_path / "j.db").status is Status.GAVE_UP
    assert exported(tmp_path / "j.db") == before


@pytest.mark.parametrize("steps", range(1, 14))
def test_what_came_from_outside_comes_again(tmp_path: Path, steps: int) -> None:
    whole = tmp_path / "whole.db"
    kernel = Kernel(compiled())
    with Journal(str(whole), "none") as journal:
        sink = journal.begin(kernel, Heading(plan=SMALL.encode(), seed=10, mode="test"))
        first = driver(kernel, sink, 10)
        first.mark(Input(Kind.NOTE, message="forced"))
        first.deliver(Input(Kind.BEGIN))
        for step in range(steps):
            assert first.advance()
            if step % 3 == 0:
                first.deliver(Input(Kind.PAUSE))
            elif step % 3 == 1:
                first.deliver(Input(Kind.RESUME))
        first.cancel("enough")
        while first.advance():
            pass
    expected = exported(whole)
    assert kernel.status is Status.CANCELLED
    assert expected.count('"PAUSE"') == -(-steps // 3)
    for last in ends_of_writes(whole)[-6:]:
        cut(whole, tmp_path / "cut.db", last)
        resume_journaled(tmp_path / "cut.db")
        events = exported(tmp_path / "cut.db")
        if '"CANCEL"' in "".join(exported(whole).splitlines()[: last + 1]):
            assert events == expected
        else:  # the process died before it was told to stop
            assert events.splitlines()[: last + 1] == expected.splitlines()[: last + 1]


def test_other_runners_do_not_go_on_with_a_run(tmp_path: Path) -> None:
    run_journaled(tmp_path / "j.db", seed=10)
    connection = opened_up(tmp_path / "j.db")
    connection.execute("DELETE FROM event WHERE seq > 20")
    closed_again(connection, tmp_path / "j.db")
    connection.close()
    with (
        Journal(str(tmp_path / "j.db"), "none") as journal,
        JournalReader(str(tmp_path / "j.db")) as reader,
    ):
        kernel = Kernel(compiled())
        sink = Comparing(kernel, reader.events(1), journal.go_on(kernel, 1))
        other = driver(kernel, sink, 11)
        with pytest.raises(ReplayDivergence):
            simulate_again(other, sink)
        assert not other._acting
        assert reader.run().events == 20


# -- real time ----------------------------------------------------------------------------------


class Toy(Adopting):
    """A host without time: what it is asked to do is noted, and answered by hand."""

    def __init__(self, kernel: Kernel, sink: Sink, idempotent: tuple[str, ...] = ()) -> None:
        super().__init__(kernel, sink)
        self.at_us = 0
        self.done: list[tuple[str, int]] = []
        self._idempotent = idempotent

    def now_us(self) -> int:
        self.at_us += 1
        return self.at_us

    def start(self, command: Start) -> None:
        self.done.append(("start", command.number))

    def stop(self, number: int) -> None:
        self.done.append(("stop", number))

    def load(self, runner: int) -> None:
        self.done.append(("load", runner))
        self.deliver(Input(Kind.LOADED, runner=runner))

    def unload(self, runner: int) -> None:
        self.done.append(("unload", runner))

    def adopt(self, left: Left) -> None:
        self.at_us = left.at_us
        self.done.append(("adopt", len(left.loaded)))
        take_up(self, left)
        names = [self.kernel.runners[start.runner][0] for start in left.active]
        repeatable = zip(left.active, names, strict=True)
        settle(self, left, {each.number for each, name in repeatable if name in self._idempotent})


PARALLEL = """<Plan>
  <Control name="all" type="parallel_all">
    <Runner interface="a" provider="p" x="1"/>
    <Runner interface="b" provider="p"/>
    <Control name="or else" type="recovery">
      <Runner interface="c" provider="p"/>
    </Control>
    <Runner interface="d" provider="p"/>
  </Control>
  <Runner interface="e" provider="p"/>
</Plan>
"""


class Life:
    """A journal and the processes that work with it, one after the other."""

    def __init__(self, path: Path, text: str = PARALLEL) -> None:
        self._path = str(path)
        self._text = text

    def begin(self) -> tuple[Toy, Journal]:
        journal = Journal(self._path, "none")
        kernel = Kernel(compiled(self._text))
        toy = Toy(kernel, journal.begin(kernel, Heading(plan=self._text.encode())))
        toy.deliver(Input(Kind.BEGIN))
        return toy, journal

    def resume(self, *idempotent: str) -> tuple[Toy, Journal]:
        journal = Journal(self._path, "none")
        kernel = Kernel(compiled(self._text))
        toy = Toy(kernel, journal.go_on(kernel, 1), idempotent)
        with JournalReader(self._path) as reader:
            resume_into(toy, reader.events(1))
        return toy, journal

    def tail(self, since: str = "CONTINUED") -> list[tuple[str, str]]:
        with JournalReader(self._path) as reader:
            reader.verify(1)
            rows = [row for row in reader.events(1) if row.record or row.input]
        first = max(place for place, row in enumerate(rows) if row.kind == since)
        return [(row.kind, row.interface) for row in rows[first:]]


def test_an_idempotent_instance_is_asked_again(tmp_path: Path) -> None:
    life = Life(tmp_path / "j.db")
    toy, journal = life.begin()
    toy.deliver(Input(Kind.SUCCEEDED, 0))
    journal.close()
    toy, journal = life.resume("a", "b", "c", "d", "e")
    assert toy.done == [("adopt", 2), ("start", 1), ("start", 3)]
    assert life.tail() == [("CONTINUED", ""), ("RESTARTED", "b"), ("RESTARTED", "d")]
    toy.deliver(Input(Kind.SUCCEEDED, 3))
    toy.deliver(Input(Kind.SUCCEEDED, 1))
    toy.deliver(Input(Kind.SUCCEEDED, 4))
    assert toy.kernel.status is Status.COMPLETED
    journal.close()


def test_another_one_has_failed_and_the_plan_goes_on(tmp_path: Path) -> None:
    life = Life(tmp_path / "j.db")
    toy, journal = life.begin()
    toy.deliver(Input(Kind.SUCCEEDED, 0))
    journal.close()
    toy, journal = life.resume("d")
    assert toy.done == [("adopt", 2), ("unload", 1), ("load", 2), ("start", 2), ("start", 3)]
    assert life.tail()[:2] == [("CONTINUED", ""), ("FAILED", "b")]
    assert life.tail()[-1] == ("RESTARTED", "d")
    with JournalReader(str(tmp_path / "j.db")) as reader:
        failed = [row for row in reader.events(1) if row.kind == "FAILED"]
    assert [row.message for row in failed] == ["the process ended while it was active"]
    journal.close()


def test_what_the_run_does_not_need_any_more_is_not_asked_again(tmp_path: Path) -> None:
    life = Life(tmp_path / "j.db")
    _, journal = life.begin()
    journal.close()
    toy, journal = life.resume("b", "d")  # a fails, and the plan has no answer to that
    assert toy.kernel.status is Status.GAVE_UP
    assert not [done for done in toy.done if done[0] == "start"]
    tail = life.tail()
    assert tail[1] == ("FAILED", "a")
    assert [kind for kind, _ in tail[2:]].count("STOPPED") == 2
    assert tail[-1] == ("ENDED", "")
    journal.close()


def test_a_run_that_was_being_stopped_is_stopped(tmp_path: Path) -> None:
    life = Life(tmp_path / "j.db")
    toy, journal = life.begin()
    toy.cancel("enough")
    assert [what for what, _ in toy.done[-3:]] == ["stop"] * 3
    assert toy.kernel.status is Status.STOPPING
    journal.close()
    toy, journal = life.resume("a", "b", "d")
    assert toy.kernel.status is Status.CANCELLED
    assert [("STOPPED", name) for name in "abd"] == life.tail()[1:4]
    journal.close()


def test_a_runner_that_was_being_loaded_is_loaded(tmp_path: Path) -> None:
    life = Life(tmp_path / "j.db")
    toy, journal = life.begin()
    journal.close()
    cut(tmp_path / "j.db", tmp_path / "cut.db", ends_of_writes(tmp_path / "j.db")[1])
    life = Life(tmp_path / "cut.db")
    toy, journal = life.resume("a")
    assert toy.done[0] == ("adopt", 0)
    assert [done for done in toy.done if done[0] == "load"] == [
        ("load", 0),
        ("load", 1),
        ("load", 3),
    ]
    assert list(toy.kernel.active) == [0, 1, 3]
    journal.close()


def test_a_run_that_never_began_begins(tmp_path: Path) -> None:
    path = str(tmp_path / "j.db")
    with Journal(path, "none") as journal:
        journal.begin(Kernel(compiled(PARALLEL)), Heading(plan=PARALLEL.encode()))
    toy, journal = Life(tmp_path / "j.db").resume()
    assert toy.kernel.status is Status.RUNNING
    assert [number for what, number in toy.done if what == "start"] == [0, 1, 3]
    journal.close()


def test_a_run_that_has_ended_is_left_alone(tmp_path: Path) -> None:
    life = Life(tmp_path / "j.db")
    toy, journal = life.begin()
    for number in (0, 1, 3, 4):
        toy.deliver(Input(Kind.SUCCEEDED, number))
    assert toy.kernel.status is Status.COMPLETED
    journal.close()
    before = exported(tmp_path / "j.db")
    toy, journal = life.resume("a", "b")
    assert toy.done == []
    journal.close()
    assert exported(tmp_path / "j.db") == before


def test_a_process_that_ends_while_it_resumes(tmp_path: Path) -> None:
    life = Life(tmp_path / "j.db")
    toy, journal = life.begin()
    toy.deliver(Input(Kind.SUCCEEDED, 0))
    journal.close()
    _, journal = life.resume("b", "c", "d", "e")
    journal.close()
    whole = ends_of_writes(tmp_path / "j.db")
    for last in whole[-3:]:
        cut(tmp_path / "j.db", tmp_path / "cut.db", last)
        toy, journal = Life(tmp_path / "cut.db").resume("b", "c", "d", "e")
        assert [number for what, number in toy.done if what == "start"] == [1, 3]
        for number in (1, 3, 4):
            toy.deliver(Input(Kind.SUCCEEDED, number))
        assert toy.kernel.status is Status.COMPLETED
        journal.close()


def test_a_journaled_outcome_is_never_asked_for_again(tmp_path: Path) -> None:
    life = Life(tmp_path / "j.db")
    toy, journal = life.begin()
    for number in (0, 1, 3, 4):
        toy.deliver(Input(Kind.SUCCEEDED, number))
    journal.close()
    for last in ends_of_writes(tmp_path / "j.db"):
        cut(tmp_path / "j.db", tmp_path / "cut.db", last)
        with JournalReader(str(tmp_path / "cut.db")) as reader:
            over = {row.node - 1 for row in reader.events(1) if row.kind == "SUCCEEDED"}
        toy, journal = Life(tmp_path / "cut.db").resume("a", "b", "c", "d", "e")
        started = [number for what, number in toy.done if what == "start"]
        assert not over & set(started)
        assert sorted(toy.kernel.active) == sorted(started)
        journal.close()


def test_only_a_fresh_kernel_can_take_up_a_run(tmp_path: Path) -> None:
    toy, journal = Life(tmp_path / "j.db").begin()
    with pytest.raises(UsageError, match="has not begun"):
        resume_into(toy, [])
    journal.close()
