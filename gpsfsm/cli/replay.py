"""``gpsfsm replay``: run a journaled run again, and compare every event."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from gpsfsm.cli._help import ANY_PATH, Command, Section, declare
from gpsfsm.streams import complain, write_text

if TYPE_CHECKING:
    from gpsfsm.running.replaying import ReplayedRun

_NO_JOURNAL = """no journal is given; name the file of one. Example:
  gpsfsm replay run.db"""
_DIFFERS = 1


@click.command(
    "replay",
    cls=Command,
    section=Section.RUN,
    short_help="Replay a run and compare it with its journal.",
)
@click.argument("journal", required=False, metavar="JOURNAL", type=ANY_PATH)
@declare(
    "--run",
    "number",
    type=click.IntRange(min=1),
    metavar="N",
    help="Run number in the journal. [default: the last, and those it continues]",
)
@click.pass_context
def command(context: click.Context, journal: str | None, number: int | None) -> int:
    r"""Replay a run from JOURNAL without real runners and compare every event.

    External inputs come from the journal. A simulated run that has ended is also simulated again
    from its seed and world. If plans continued one another, all of their runs are replayed.

    Exit code: 0 all events are the same, 1 one differs, 2 not possible.

    \b
    Example:
      gpsfsm replay run.db
    """
    if not journal:
        raise click.UsageError(_NO_JOURNAL, context)
    return _run(journal, number)


def _run(journal: str, number: int | None) -> int:
    from gpsfsm.running.replaying import replayed_runs

    for each in replayed_runs(journal, number, complain):
        if not each:
            run = f"run {each.run}: " if each.run else ""
            complain(f"{journal}: {run}{each.difference}")
            return _DIFFERS
        write_text(_summary(each))
    return 0


def _summary(run: ReplayedRun) -> str:
    how = "and simulated again" if run.again else "without simulating it again"
    status = run.status.value if run.status is not None and run.status.ended else "not ended"
    return f"run {run.run} ({status}): replayed {how}; all {run.events} events are the same\n"
