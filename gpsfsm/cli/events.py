"""``gpsfsm events``: the events of a journaled run as a table, as data or as a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from gpsfsm.cli._streams import STDOUT, check_writable, write_text

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.execution.journal_read import JournalReader, StoredRun

__all__ = ["COMMAND"]

_NO_JOURNAL = """no journal is given; name the file of one. Example:
  gpsfsm events run.db"""


@click.command("events", short_help="Show the events of a run.")
@click.argument("journal", required=False, metavar="JOURNAL", type=click.Path())
@click.option(
    "--format",
    "output_format",
    type=click.Choice(["table", "jsonl", "svg"]),
    default="table",
    show_default=True,
    help="table: for people; jsonl: the same bytes for the same run; svg: a timeline.",
)
@click.option(
    "--run",
    "number",
    type=click.IntRange(min=1),
    metavar="N",
    help="The number of the run in the journal. [default: the last one]",
)
@click.option("--list", "list_runs", is_flag=True, help="List the runs of the journal instead.")
@click.option("--wall-clock", is_flag=True, help="Add the date and time of each event.")
@click.option("--verify", is_flag=True, help="Check first that the journal was not changed.")
@click.option(
    "--output-file",
    default=STDOUT,
    metavar="FILE",
    type=click.Path(),
    help="Write to this file instead of standard output.",
)
@click.pass_context
def COMMAND(context: click.Context, /, **_: object) -> int:  # noqa: N802  (it is an object)
    """Show the events of a run that is in JOURNAL, also while it runs.

    \b
    Exit code: 0 shown, 2 not possible.

    \b
    Example:
      gpsfsm events run.db --format svg --output-file run.svg
    """  # noqa: D301  (click wants the \b)
    values = context.params
    if not values["journal"]:
        raise click.UsageError(_NO_JOURNAL, context)
    check_writable(values["output_file"], [values["journal"]])
    from gpsfsm.execution.journal_read import JournalReader  # noqa: PLC0415  (loads sqlite3)

    with JournalReader(values["journal"]) as reader:
        if values["list_runs"]:
            text = "".join(map(_listed, reader.runs()))
        else:
            run = reader.run(values["number"])
            if values["verify"]:
                reader.verify(run.number)
            shown = _shown(reader, run, values["output_format"], wall_clock=values["wall_clock"])
            text = "".join(shown)
    write_text(text, values["output_file"])
    return 0


def _listed(run: StoredRun) -> str:
    from gpsfsm.model.printable import clip  # noqa: PLC0415
    from gpsfsm.watch.moments import seconds  # noqa: PLC0415

    return (
        f"{run.number:>4}  {run.status.value:<9}  {seconds(run.at_us):>12} s  "
        f"{run.events:>7} events  seed {run.seed}  {clip(run.mode, 40)}  {clip(run.file, 200)}\n"
    )


def _shown(
    reader: JournalReader, run: StoredRun, output_format: str, *, wall_clock: bool
) -> Iterator[str]:
    rows = reader.events(run.number)
    if output_format == "jsonl":
        from gpsfsm.execution.export import jsonl  # noqa: PLC0415

        yield from jsonl(run, rows, wall_clock=wall_clock)
        return
    from gpsfsm.cli._runs import stored  # noqa: PLC0415  (loads the front end)
    from gpsfsm.watch.stored import stored_moments  # noqa: PLC0415

    prepared = stored(reader, run)
    words = prepared.words()
    nodes = len(prepared.compiled.automaton.nodes)
    events = stored_moments(rows, nodes, len(words.runners))
    if output_format == "table":
        from gpsfsm.watch.table import table_lines  # noqa: PLC0415

        for line in table_lines(events, words, wall_clock=wall_clock):
            yield line + "\n"
        return
    from gpsfsm.watch.moments import Tally  # noqa: PLC0415
    from gpsfsm.watch.svg import to_svg  # noqa: PLC0415
    from gpsfsm.watch.timeline import timeline  # noqa: PLC0415

    moments = [moment for _, moment in events]
    tally = Tally()
    for moment in moments:
        tally.add(moment.at_us, [moment.record])
    yield to_svg(timeline(moments, words), f"{run.file or 'a plan'}: {tally.told}")
