"""What the tests of the journal share: a plan, simulated runners, a journaled run."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from typing import TYPE_CHECKING

from gpsfsm.compile import compile_plan
from gpsfsm.execution.journal import Heading, Journal
from gpsfsm.execution.journal_file import mark_closed
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.journal_rows import jsonl, line
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.replay import Comparing, simulate_again
from gpsfsm.execution.runner import Runner, RunnerError
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.syntax import parse

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from gpsfsm.compile import Compiled
    from gpsfsm.execution.host import Sink
    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import RunContext

SMALL = """<Plan>
  <Runner interface="a" provider="p"/>
  <Control name="all" type="parallel_all">
    <Runner interface="a" provider="p" x="1.5" text="grüß 日本"/>
    <Runner interface="b" provider="p"/>
    <Control name="else" type="recovery">
      <Runner interface="c" provider="p"/>
      <Runner interface="a" provider="q"/>
    </Control>
  </Control>
  <Runner interface="b" provider="p"/>
</Plan>
"""


LONG = "<Plan>" + '<Runner interface="a" provider="p"/>' * 60 + "</Plan>"
LONG_SEED = 4
"""With it LONG completes."""


class Drawn(Runner):
    """Takes some time, says something, sometimes fails, hands something over."""

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        for _ in range(context.random.randrange(1, 4)):
            await context.sleep(context.random.uniform(0.1, 2))
        if context.random.random() < 0.3:
            context.log("it will not work")
        if context.random.random() < 0.02:
            raise RunnerError("no luck", left=1)
        return {"value": context.random.random(), "list": ["é", True, 3]}


def compiled(text: str = SMALL) -> Compiled:
    plan = parse(text).plan
    assert plan is not None
    return compile_plan(plan)


def driver(kernel: Kernel, sink: Sink, seed: int) -> VirtualDriver:
    return VirtualDriver(kernel, sink, lambda _interface, _provider: Drawn(), seed=seed)


def run_journaled(
    path: Path | str, text: str = SMALL, *, seed: int = 1, durability: str = "none"
) -> Kernel:
    """Run a plan from its beginning to its end, as the next run of a journal."""
    kernel = Kernel(compiled(text))
    with Journal(str(path), durability) as journal:
        sink = journal.begin(kernel, Heading(plan=text.encode(), seed=seed, mode="test"))
        driver(kernel, sink, seed).run()
    return kernel


def resume_journaled(path: Path | str, *, durability: str = "none") -> Kernel:
    """Go on with the last run of a journal."""
    with Journal(str(path), durability) as journal, JournalReader(str(path)) as reader:
        run = reader.run()
        kernel = Kernel(compiled(reader.content(run, "plan").decode()))
        sink = Comparing(kernel, reader.events(run.number), journal.go_on(kernel, run.number))
        simulate_again(driver(kernel, sink, run.seed), sink)
    return kernel


def exported(path: Path | str, number: int | None = None) -> str:
    with JournalReader(str(path)) as reader:
        run = reader.run(number)
        assert reader.verify(run.number) == run.events
        return "".join(jsonl(run, reader.events(run.number)))


def lines(path: Path) -> list[str]:
    """The events of the first run."""
    with JournalReader(str(path)) as reader:
        return [line(row) for row in reader.events(1)]


def opened_up(path: Path | str) -> sqlite3.Connection:
    """The file without its guards, to do what no journal lets anybody do. Close it."""
    connection = sqlite3.connect(path, isolation_level=None)
    for (name,) in connection.execute(
        "SELECT name FROM sqlite_master WHERE type = 'trigger'"
    ).fetchall():
        connection.execute(f"DROP TRIGGER {name}")
    return connection


def cut(path: Path, target: Path, last: int) -> None:
    """A copy of a journal with only the events up to ``last``, as if it had been closed there."""
    shutil.copy(path, target)
    forge(target, "DELETE FROM event WHERE seq > ?", values=(last,))


def forge(path: Path | str, *statements: str, values: tuple[object, ...] = ()) -> None:
    """Change a journal by SQL, and record its ends as they are then."""
    with closing(opened_up(path)) as connection:
        for statement in statements:
            connection.execute(statement, values)
        closed_again(connection, path)


def closed_again(connection: sqlite3.Connection, path: Path | str) -> None:
    """Records the ends of all runs as they are now: whoever forged the events forges these too."""
    connection.execute("DELETE FROM ending")
    connection.execute("DELETE FROM mark WHERE kind = 'CLOSED'")
    mark_closed(connection, str(path))


def ends_of_writes(path: Path) -> list[int]:
    """The seq of the last event of each transaction, and 0."""
    with JournalReader(str(path)) as reader:
        rows = list(reader.events(1))
    return [row.seq - 1 for row in rows if row.input] + [rows[-1].seq]
