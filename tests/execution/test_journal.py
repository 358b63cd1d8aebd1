"""What a journal holds, and that it is written before anything is done."""

from __future__ import annotations

import functools
import itertools
import json
import sqlite3
from typing import TYPE_CHECKING

import pytest

from gpsfsm.compile import compile_plan
from gpsfsm.errors import UsageError
from gpsfsm.execution.journal import Heading, Journal
from gpsfsm.execution.journal_errors import DamagedJournalError, JournalError, JournalFullError
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.journal_rows import RowMaker, canonical, clean, decoded, jsonl, line
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.queue import QueueKind, QueueRow
from gpsfsm.execution.records import Input, Kind, Record, Status
from tests.execution.journaling import (
    SMALL,
    compiled,
    driver,
    exported,
    opened_up,
    run_journaled,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


class Collected:
    """A sink that keeps everything, and fails from some write on."""

    def __init__(self, good: int = 10**9) -> None:
        self.rows: list[tuple[int, Input, Sequence[Record]]] = []
        self._good = good

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        if len(self.rows) >= self._good:
            raise JournalFullError("full")
        self.rows.append((at_us, happened, records))


def test_the_journal_holds_every_record_in_order(tmp_path: Path) -> None:
    sink = Collected()
    driver(Kernel(compiled()), sink, 1).run()
    run_journaled(tmp_path / "j.db")
    with JournalReader(str(tmp_path / "j.db")) as reader:
        rows = list(reader.events(1))
    assert [row.seq for row in rows] == list(range(1, len(rows) + 1))
    kept = [(row.at_us, row.kind, row.node, row.values) for row in rows if row.record]
    recorded = [
        (at_us, record.kind.value, record.node, dict(record.data or {}))
        for at_us, happened, records in sink.rows
        for record in records
    ]
    assert kept == recorded
    inputs = [(row.at_us, row.kind, row.values) for row in rows if row.input]
    assert inputs == [(at_us, each.kind.value, dict(each.outputs)) for at_us, each, _ in sink.rows]


def test_causes_point_to_the_input_before(tmp_path: Path) -> None:
    run_journaled(tmp_path / "j.db")
    with JournalReader(str(tmp_path / "j.db")) as reader:
        rows = list(reader.events(1))
    last = 0
    for row in rows:
        if row.input:
            assert row.cause == 0
            last = row.seq
        else:
            assert row.cause == last


def test_the_same_run_has_the_same_bytes_whenever_it_is_run(tmp_path: Path) -> None:
    for path in (tmp_path / "a.db", tmp_path / "b.db"):
        run_journaled(path)
    run_journaled(tmp_path / "b.db")
    first = exported(tmp_path / "a.db")
    assert first == exported(tmp_path / "b.db", 1) == exported(tmp_path / "b.db", 2)
    run_journaled(tmp_path / "b.db", seed=2)
    assert exported(tmp_path / "b.db") != first


def test_a_clock_shows_only_where_it_is_asked_for(tmp_path: Path) -> None:
    path, ticks = str(tmp_path / "j.db"), itertools.count(7_000_000)
    with Journal(path, "none", wall_us=lambda: next(ticks)) as journal:
        kernel = Kernel(compiled())
        sink = journal.begin(kernel, Heading(plan=SMALL.encode()))
        sink.write(5, Input(Kind.BEGIN), kernel.step(Input(Kind.BEGIN))[0])
    with JournalReader(path) as reader:
        run = reader.run()
        plain = [json.loads(text) for text in jsonl(run, reader.events(1))]
        timed = [json.loads(text) for text in jsonl(run, reader.events(1), wall_clock=True)]
    assert not any("wall_us" in each for each in plain)
    assert [each["wall_us"] for each in timed[:2]] == [7_000_000, 7_000_001]
    assert run.wall_us == 7_000_000


def test_ids_are_made_of_what_a_run_is(tmp_path: Path) -> None:
    def ids(name: str, *headings: Heading) -> list[str]:
        with Journal(str(tmp_path / name), "none") as journal:
            return [journal.begin(Kernel(compiled()), heading).id for heading in headings]

    plain, seeded = Heading(plan=b"a"), Heading(plan=b"a", seed=1)
    first = ids("1.db", plain, plain, seeded)
    assert len(set(first)) == 3
    assert ids("2.db", plain, plain, seeded) == first
    assert ids("3.db", Heading(plan=b"a", file="/some/where.xml")) == first[:1]
    others = [
        Heading(plan=b"b"),
        Heading(plan=b"a", world=b"w"),
        Heading(plan=b"a", capabilities="c"),
        Heading(plan=b"a", mode="real"),
        Heading(plan=b"a", options={"timeout": 3}),
        Heading(plan=b"a", parent="p"),
    ]
    actual = [ids(f"o{place}.db", heading)[0] for place, heading in enumerate(others)]
    assert len({*actual, *first}) == len(actual) + len(first)


def test_the_heading_comes_back(tmp_path: Path) -> None:
    path = str(tmp_path / "j.db")
    heading = Heading(
        plan=b"<Plan/>\xff",
        file="p.xml",
        capabilities="{}",
        world=b"w",
        seed=-3,
        mode="real",
        options={"timeout": 2.5},
    )
    with Journal(path, "none") as journal:
        journal.begin(Kernel(compiled()), heading)
        journal.begin(Kernel(compiled()), heading)
    with JournalReader(path) as reader:
        first, second = reader.runs()
        assert reader.content(second, "plan") == heading.plan
        assert reader.content(first, "capabilities") == b"{}"
        assert reader.content(first, "world") == b"w"
        assert (first.seed, first.mode, dict(first.options)) == (-3, "real", {"timeout": 2.5})
        assert (first.file, first.status, first.events) == ("p.xml", Status.RUNNING, 0)
        assert [first.number, second.number] == [1, 2]
        with pytest.raises(JournalError, match=r"no run 3 in .*j\.db; it holds runs 1 to 2$"):
            reader.run(3)


def test_a_run_knows_how_it_ended(tmp_path: Path) -> None:
    kernel = run_journaled(tmp_path / "j.db")
    with JournalReader(str(tmp_path / "j.db")) as reader:
        assert reader.run().status is kernel.status
        assert reader.run().at_us > 0


def test_runs_may_take_turns(tmp_path: Path) -> None:
    path = str(tmp_path / "j.db")
    with Journal(path, "none") as journal:
        kernels = [Kernel(compiled()) for _ in range(2)]
        drivers = [
            driver(kernel, journal.begin(kernel, Heading(plan=SMALL.encode(), seed=seed)), seed)
            for seed, kernel in enumerate(kernels)
        ]
        for each in drivers:
            each.deliver(Input(Kind.BEGIN))
        while any(not kernel.status.ended for kernel in kernels):
            for each in drivers:
                if not each.kernel.status.ended:
                    assert each.advance()
    run_journaled(tmp_path / "alone.db", seed=1)
    alone, together = exported(tmp_path / "alone.db"), exported(path, 2)
    assert alone.splitlines()[1:] == together.splitlines()[1:]


def test_nothing_can_be_changed(tmp_path: Path) -> None:
    run_journaled(tmp_path / "j.db")
    connection = sqlite3.connect(tmp_path / "j.db")
    for statement in (
        "UPDATE event SET kind = 'X'",
        "DELETE FROM event WHERE seq = 3",
        "DELETE FROM run",
        "UPDATE content SET bytes = x'00'",
    ):
        with pytest.raises(sqlite3.IntegrityError, match="only ever appended"):
            connection.execute(statement)
    connection.close()


@pytest.mark.parametrize(
    "change",
    [
        "UPDATE event SET message = 'it went well' WHERE seq = 5",
        "UPDATE event SET at_us = at_us + 1 WHERE seq = 5",
        "DELETE FROM event WHERE seq = 5",
        "DELETE FROM event WHERE seq = 1",
        "UPDATE event SET seq = 1000 WHERE seq = 5",
        "UPDATE run SET header = replace(header, '\"seed\":1', '\"seed\":2')",
        "UPDATE run SET id = 'x'",
        "UPDATE content SET bytes = CAST(bytes || ' ' AS BLOB)",
    ],
)
def test_what_was_changed_is_found(tmp_path: Path, change: str) -> None:
    run_journaled(tmp_path / "j.db")
    with JournalReader(str(tmp_path / "j.db")) as reader:
        assert reader.verify(1) == reader.run().events
    connection = opened_up(tmp_path / "j.db")
    assert connection.execute(change).rowcount == 1
    connection.close()
    with JournalReader(str(tmp_path / "j.db")) as reader, pytest.raises(DamagedJournalError):
        reader.verify(1)


def test_the_end_alone_can_be_verified(tmp_path: Path) -> None:
    run_journaled(tmp_path / "j.db")
    connection = opened_up(tmp_path / "j.db")
    connection.execute("UPDATE event SET message = 'it went well' WHERE seq = 5")
    connection.close()
    with JournalReader(str(tmp_path / "j.db")) as reader:
        events = reader.run().events
        for last in range(1, events + 3):
            if last <= events - 5:
                assert reader.verify(1, last=last) == events
            else:
                with pytest.raises(DamagedJournalError, match="event 5 of run 1"):
                    reader.verify(1, last=last)


def test_the_guard_against_a_second_end(tmp_path: Path) -> None:
    kernel = run_journaled(tmp_path / "j.db")
    with Journal(str(tmp_path / "j.db"), "none") as journal:
        sink = journal.go_on(kernel, 1)
        with pytest.raises(JournalError, match="UNIQUE"):
            sink.write(1, Input(Kind.CANCEL), [Record(Kind.CANCEL), Record(Kind.ENDED)])


def test_undeclared_outputs_are_kept_as_they_came(tmp_path: Path) -> None:
    kernel = Kernel(compiled())
    maker = RowMaker(kernel)
    happened = Input(Kind.SUCCEEDED, 0, outputs={"b": 2, "a": 1})
    same = maker.make(9, happened, [Record(Kind.SUCCEEDED, 1, data={"a": 1, "b": 2})])
    assert [(row.input, row.record, row.data) for row in same] == [(True, True, '{"a":1,"b":2}')]
    less = maker.make(9, happened, [Record(Kind.SUCCEEDED, 1, data={"a": 1})])
    assert [(row.input, row.record, row.cause, row.seq, row.data) for row in less] == [
        (True, False, 0, 2, '{"a":1,"b":2}'),
        (False, True, 2, 3, '{"a":1}'),
    ]
    assert json.loads(line(less[0]))["record"] is False


def test_an_input_without_records_is_kept() -> None:
    rows = RowMaker(Kernel(compiled())).make(3, Input(Kind.STOPPED, 0, message="late"), [])
    assert json.loads(line(rows[0])) == {
        "seq": 1,
        "at_us": 3,
        "kind": "STOPPED",
        "input": True,
        "record": False,
        "node": 1,
        "element": "/Plan/Runner[1]",
        "interface": "a",
        "provider": "p",
        "message": "late",
    }


def test_any_value_and_any_text_can_be_kept(tmp_path: Path) -> None:
    path = str(tmp_path / "j.db")
    outputs = {"a": "\x00\ud800\n", "n": -0.0, "e": 1e300, "i": 2**62, "l": [[True, "ü"]], "": ""}
    with Journal(path, "none") as journal:
        kernel = Kernel(compiled())
        sink = journal.begin(kernel, Heading(plan=b"", file="\udcff.xml"))
        sink.write(0, Input(Kind.SUCCEEDED, 0, outputs=outputs, message="\ud800\x00 ü"), [])
    with JournalReader(path) as reader:
        (row,) = reader.events(1)
        assert reader.verify(1) == 1
    assert row.values == outputs
    assert str(row.values["n"]) == "-0.0"
    assert row.message == "\\ud800\x00 ü"
    assert len(clean("x" * 20_000)) == 10_000


def test_numbers_that_json_does_not_have_become_text() -> None:
    values = {"x": float("nan"), "y": [float("inf"), {"z": float("-inf")}], "a": 1.0}
    assert canonical(values) == '{"a":1.0,"x":"nan","y":["inf",{"z":"-inf"}]}'
    assert decoded(canonical({"b": 1, "a": True})) == {"a": True, "b": 1}
    with pytest.raises(DamagedJournalError):
        decoded("[1]")


def test_lines_of_runners_are_events(tmp_path: Path) -> None:
    run_journaled(tmp_path / "j.db", seed=3)
    with JournalReader(str(tmp_path / "j.db")) as reader:
        logs = [row for row in reader.events(1) if row.kind == "LOG"]
    assert logs
    assert all(row.message == "it will not work" and row.input and not row.record for row in logs)


@functools.cache
def eventful_seed() -> int:
    """One with which ten inputs happen."""

    def inputs(seed: int) -> int:
        sink = Collected()
        driver(Kernel(compiled()), sink, seed).run()
        return len(sink.rows)

    return next(seed for seed in range(1000) if inputs(seed) >= 10)


@pytest.mark.parametrize("good", range(10))
def test_what_cannot_be_written_has_no_effect(good: int) -> None:
    whole, sink = Collected(), Collected(good)
    driver(Kernel(compiled()), whole, eventful_seed()).run()
    broken = driver(Kernel(compiled()), sink, eventful_seed())
    started: list[int] = []
    begin = broken.start
    broken.start = lambda command: (started.append(command.number), begin(command))[1]  # type: ignore[method-assign]
    with pytest.raises(JournalFullError):
        broken.run()
    written = [
        record.node - 1
        for _, _, records in whole.rows[:good]
        for record in records
        if record.kind is Kind.STARTED
    ]
    assert started == written
    assert sink.rows == whole.rows[:good]
    assert not broken._acting
    assert not broken._runners
    with pytest.raises(JournalFullError):  # and it stays so
        broken.cancel("why not")


def test_decisions_of_the_queue_are_kept(tmp_path: Path) -> None:
    path = str(tmp_path / "j.db")
    with Journal(path, "none") as journal:
        journal.write_queue(0, QueueRow(QueueKind.SUBMITTED, 1))
        journal.write_queue(4, QueueRow(QueueKind.REFUSED, 2, 1, {"findings": ["x"]}, "no"))
    with JournalReader(path) as reader:
        assert list(reader.queue()) == [
            (1, 0, "SUBMITTED", 1, 0, "{}", ""),
            (2, 4, "REFUSED", 2, 1, '{"findings":["x"]}', "no"),
        ]
        assert reader.verify_queue() == 2
    connection = opened_up(path)
    connection.execute("UPDATE queue SET by = 0")
    connection.close()
    with (
        JournalReader(path) as reader,
        pytest.raises(DamagedJournalError, match="decision 2 of the plan queue"),
    ):
        reader.verify_queue()


def test_durability_is_one_of_three(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="power, process, none"):
        Journal(str(tmp_path / "j.db"), "much")
    ways = {}
    for durability in ("power", "process", "none"):
        with Journal(str(tmp_path / "j.db"), durability) as journal:
            ways[durability] = journal._connection.execute("PRAGMA synchronous").fetchone()[0]
            mode = journal._connection.execute("PRAGMA journal_mode").fetchone()[0]
            assert mode == "wal"
    assert ways == {"power": 2, "process": 1, "none": 0}


def test_there_is_no_run_to_go_on_with(tmp_path: Path) -> None:
    with (
        Journal(str(tmp_path / "j.db"), "none") as journal,
        pytest.raises(JournalError, match="there is no run 4"),
    ):
        journal.go_on(Kernel(compiled()), 4)


def test_a_plan_of_nothing_but_one_runner_reads_well(tmp_path: Path) -> None:
    plan = '<Plan><Runner interface="a" provider="p" x="1"/></Plan>'
    kernel = Kernel(compile_plan(compiled(plan).automaton.plan))
    happened = Input(Kind.BEGIN)
    rows = RowMaker(kernel).make(0, happened, kernel.step(happened)[0])
    assert [line(row) for row in rows] == [
        '{"seq":1,"at_us":0,"kind":"BEGIN","input":true}',
        '{"seq":2,"at_us":0,"kind":"TRIGGERED","cause":1,"node":1,"element":"/Plan/Runner[1]",'
        '"interface":"a","provider":"p","data":{"x":1}}',
        '{"seq":3,"at_us":0,"kind":"LOADING","cause":1,"runner":0,"interface":"a","provider":"p"}',
    ]
