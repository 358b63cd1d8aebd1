"""``gpsfsm replay``: run a journaled run again, and compare every event."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from gpsfsm.cli._streams import complain, write_text
from gpsfsm.errors import InputError

if TYPE_CHECKING:
    from gpsfsm.execution.journal_read import StoredRun

__all__ = ["COMMAND"]

_NO_JOURNAL = """no journal is given; name the file of one. Example:
  gpsfsm replay run.db"""
_DIFFERS = 1


@click.command("replay", short_help="Compare a run with its journal.")
@click.argument("journal", required=False, metavar="JOURNAL", type=click.Path())
@click.option(
    "--run",
    "number",
    type=click.IntRange(min=1),
    metavar="N",
    help="The number of the run in the journal. [default: the last one, and those it continues]",
)
@click.pass_context
def COMMAND(context: click.Context, /, **_: object) -> int:  # noqa: N802  (it is an object)
    """Run a run in JOURNAL again, without real runners, and compare every event.

    What came from outside is taken from the journal. A simulated run that has ended is also
    simulated again from its beginning, with its world and its seed. Where plans went on for others
    that gave up, all of their runs are replayed.

    \b
    Exit code: 0 all events are the same, 1 one differs, 2 not possible.

    \b
    Example:
      gpsfsm replay run.db
    """  # noqa: D301  (click wants the \b)
    values = context.params
    if not values["journal"]:
        raise click.UsageError(_NO_JOURNAL, context)
    return _run(values["journal"], values["number"])


def _run(journal: str, number: int | None) -> int:
    from gpsfsm.cli._past import chain, queue_of, queues  # noqa: PLC0415  (loads the engine)
    from gpsfsm.execution.chain import broken_link  # noqa: PLC0415
    from gpsfsm.execution.journal_read import JournalReader  # noqa: PLC0415

    with JournalReader(journal) as reader:
        note = reader.check()
        last = reader.run(number).number
        known = queues(reader)
        runs = chain(known, last) if number is None else (last,)
        found = queue_of(known, last)
        link = ""
        if found is not None:
            link = broken_link(row for _, row in known[found[0] - 1].rows)
    if link:
        complain(f"{journal}: {link}")
        return _DIFFERS
    for run in runs:
        if _replayed(journal, run):
            return _DIFFERS
    if note:
        complain(note)
    return 0


def _replayed(journal: str, number: int) -> int:
    from gpsfsm.cli._past import past_of, world  # noqa: PLC0415
    from gpsfsm.cli._runs import REAL  # noqa: PLC0415
    from gpsfsm.execution.journal_errors import ReplayDivergence  # noqa: PLC0415
    from gpsfsm.execution.journal_read import JournalReader  # noqa: PLC0415
    from gpsfsm.execution.replay import replay  # noqa: PLC0415

    with JournalReader(journal) as reader:
        run = reader.run(number)
        this, earlier = past_of(reader, run)
    if not this.rows:
        raise InputError(f"{journal}: run {run.number} has no event yet, so nothing is compared")
    again = run.status.ended and this.prepared.heading.mode != REAL
    try:
        replay(this.prepared.kernel(), this.rows)
        if again:
            world([*earlier, this])
    except ReplayDivergence as error:
        complain(f"{journal}: run {run.number}: {error}")
        return _DIFFERS
    write_text(_told(run, len(this.rows), again=again))
    return 0


def _told(run: StoredRun, events: int, *, again: bool) -> str:
    how = "and simulated again" if again else "without simulating it again"
    status = run.status.value if run.status.ended else "not ended"
    return f"run {run.number} ({status}): replayed {how}; all {events} events are the same\n"
