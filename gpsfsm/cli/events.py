"""``gpsfsm events``: the events of a journaled run as a table, data, a picture or a recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import click

from gpsfsm.cli._help import ANY_PATH, Command, Section, declare
from gpsfsm.cli._options import Values, format_option, output_option, read_values
from gpsfsm.errors import InputError, UsageError
from gpsfsm.streams import (
    STDOUT,
    Form,
    Stream,
    check_writable,
    complain,
    form_of,
    is_terminal,
    to_stdout,
    write_bytes,
    write_private,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from gpsfsm.execution.journal_read import JournalReader, StoredRun
    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.watch.moments import Moment
    from gpsfsm.watch.record_text import Words

_Part = TypeVar("_Part")
_FAILED = 2
_NO_JOURNAL = """no journal is given; name the file of one. Example:
  gpsfsm events run.db"""


@dataclass(frozen=True, kw_only=True)
class EventsCommand(Values):
    """The options of ``gpsfsm events``."""

    journal: str
    output_format: str
    number: int | None
    list_runs: bool
    show_queue: bool
    wall_clock: bool
    verify: bool
    output_file: str


@click.command("events", cls=Command, section=Section.RUN, short_help="Show the events of a run.")
@click.argument("journal", required=False, metavar="JOURNAL", type=ANY_PATH)
@format_option(
    "table",
    "jsonl",
    "svg",
    "mcap",
    text="table: for people; jsonl: the same bytes for the same run; svg: a timeline; mcap: a "
    "recording for Foxglove, which goes to a file.",
)
@declare(
    "--run",
    "number",
    type=click.IntRange(min=1),
    metavar="N",
    help="The number of the run in the journal. [default: the last one; as a table also the plans "
    "that it continues]",
)
@declare("--list", "list_runs", is_flag=True, help="List the runs in the journal instead.")
@declare(
    "--queue", "show_queue", is_flag=True, help="Show the queued plans and their results instead."
)
@declare("--wall-clock", is_flag=True, help="Add the date and time of each event.")
@declare(
    "--verify", is_flag=True, help="Verify the whole journal first; show nothing if it is damaged."
)
@output_option()
@click.pass_context
def command(context: click.Context, /, **_: object) -> int:
    r"""Show the events of a run in JOURNAL, also while it runs.

    All events are verified against the hashes in the journal. If it is damaged, the damage is
    reported first, then everything that can still be read is shown.

    Exit code: 0 shown, 2 not possible, or something is missing.

    \b
    Examples:
      gpsfsm events run.db --format svg -o run.svg
      gpsfsm events run.db --format mcap -o run.mcap
      gpsfsm events run.db --queue
    """
    if not context.params["journal"]:
        raise click.UsageError(_NO_JOURNAL, context)
    values = read_values(context, EventsCommand)
    if values.show_queue and (values.list_runs or values.output_format == "svg"):
        other = "--list" if values.list_runs else "--format svg"
        raise UsageError(f"--queue and {other} cannot be used together")
    check_writable(values.output_file, [values.journal])
    if values.output_format == "mcap":
        _refuse_mcap(values)
        return _run(values, _recording, _write_recording)
    return _run(values, _output, _write)


def _refuse_mcap(values: EventsCommand) -> None:
    if values.list_runs or values.show_queue:
        other = "--list" if values.list_runs else "--queue"
        raise UsageError(f"{other} and --format mcap cannot be used together")
    if values.output_file == STDOUT and is_terminal(Stream.OUT):
        raise UsageError("--format mcap is binary; name a file with --output")
    from gpsfsm.watch.mcap_file import require_mcap

    require_mcap()


def _run(
    values: EventsCommand,
    output: Callable[[JournalReader, EventsCommand], Iterator[_Part]],
    write: Callable[[list[_Part], EventsCommand], None],
) -> int:
    from gpsfsm.execution.journal_read import JournalReader

    with JournalReader(values.journal) as reader:
        notes, damage = _checked(reader, values)
        parts, more = _readable(output(reader, values), damaged=bool(damage))
    damage = list(dict.fromkeys((*damage, *more)))
    for message in damage:
        complain(message)
    if parts or not damage:
        write(parts, values)
    for message in notes:
        complain(message)
    return _FAILED if damage else 0


def _write(parts: list[str], values: EventsCommand) -> None:
    write_private("".join(parts), values.output_file, form=form_of(values.output_format))


def _write_recording(parts: list[bytes], values: EventsCommand) -> None:
    if values.output_file == STDOUT:
        to_stdout(b"".join(parts), Form.EXACT)
    else:
        write_bytes(b"".join(parts), values.output_file, private=True)


def _checked(reader: JournalReader, values: EventsCommand) -> tuple[list[str], list[str]]:
    """The notes about the journal as a whole, and its damage.

    With ``--verify`` JournalError is raised instead.
    """
    from gpsfsm.execution.journal_errors import JournalError

    try:
        notes = [note] if (note := reader.check()) else []
        if values.verify:
            reader.verify_all()
        if (values.verify or values.wall_clock) and not reader.covers_wall_times:
            notes.append(
                f"{reader.path}: an earlier gpsfsm has written to this journal: no hash covers its "
                "dates, times and file names"
            )
    except JournalError as error:
        if values.verify:
            raise
        return [], [str(error)]
    return notes, []


def _readable(output: Iterator[_Part], *, damaged: bool) -> tuple[list[_Part], list[str]]:
    """The output, and what is wrong where it ends: what came before any damage is to stay."""
    from gpsfsm.execution.journal_errors import DamagedJournalError

    parts: list[_Part] = []
    try:
        for part in output:
            parts.append(part)
    except InputError as error:
        if not damaged and not isinstance(error, DamagedJournalError):
            raise
        return parts, [str(error)]
    return parts, []


def _output(reader: JournalReader, values: EventsCommand) -> Iterator[str]:
    """The output in parts. Raises DamagedJournalError once there is no more to show."""
    if values.list_runs:
        yield from _list(reader)
    elif values.show_queue:
        yield from _queue(reader, values)
    else:
        numbers = _numbers(reader, values)
        for place, number in enumerate(numbers):
            yield "\n" if place else ""
            run, wall_clock = reader.run(number), values.wall_clock
            yield from _shown(reader, run, values.output_format, wall_clock=wall_clock)


def _numbers(reader: JournalReader, values: EventsCommand) -> tuple[int, ...]:
    """The runs to show: one, or for people the whole chain of plans of which it is the last."""
    run = reader.run(values.number).number
    if values.number is not None or values.output_format != "table":
        return (run,)
    from gpsfsm.running.history import chain, queues

    return chain(queues(reader), run)


def _list(reader: JournalReader) -> Iterator[str]:
    empty = True
    for run in reader.each_run():
        empty = False
        yield _listed(run)
    reader.check_gaps()  # also of a file that is too large to be checked as a whole
    if empty:
        reader.check_end()  # maybe there was one
        raise InputError(f"{reader.path}: there is no run in this journal")


def _listed(run: StoredRun) -> str:
    from gpsfsm.model.printable import clip
    from gpsfsm.watch.moments import seconds

    return (
        f"{run.number:>4}  {run.status.value:<9}  {seconds(run.at_us):>12} s  "
        f"{run.events:>7} events  seed {run.seed}  {clip(run.mode, 40)}  {clip(run.file, 200)}\n"
    )


def _queue(reader: JournalReader, values: EventsCommand) -> Iterator[str]:
    """The decisions of the queue of a run, or of the last one."""
    from gpsfsm.execution.journal_rows import queue_jsonl
    from gpsfsm.running.history import queue_of, queues
    from gpsfsm.watch.tables import decision_lines, fates

    all_queues = queues(reader)
    if values.number is None:
        queue = all_queues[-1] if all_queues else None
    else:
        entry = queue_of(all_queues, reader.run(values.number).number)
        queue = None if entry is None else all_queues[entry[0] - 1]
    if queue is None:
        reader.check_end()  # maybe there was one
        raise InputError(
            f"{reader.path}: there is no plan queue in this journal, or not of this run"
        )
    place = all_queues.index(queue)
    wall_us = None
    if values.wall_clock:
        first = sum(len(each.rows) for each in all_queues[:place])
        wall_us = list(reader.queue_wall_us())[first : first + len(queue.rows)]
    if values.output_format == "jsonl":
        yield from queue_jsonl(queue.rows, wall_us)
        return
    yield f"queue {place + 1} of {len(all_queues)}: {fates(queue.rows)}\n"
    for line in decision_lines(queue.rows, wall_us):
        yield line + "\n"


def _shown(
    reader: JournalReader, run: StoredRun, output_format: str, *, wall_clock: bool
) -> Iterator[str]:
    if output_format == "jsonl":
        from gpsfsm.execution.journal_rows import journal_jsonl

        yield from journal_jsonl(reader, run, wall_clock=wall_clock)
        return
    from gpsfsm.running.prepare import stored
    from gpsfsm.watch.moments import stored_moments

    prepared = stored(reader, run)
    words = prepared.words()
    nodes = len(prepared.compiled.automaton.nodes)
    events = stored_moments(reader.events(run.number), nodes, len(words.runners))
    if output_format == "svg":
        yield from _picture(events, words, run.file or "a plan")
        return
    from gpsfsm.watch.tables import table_lines

    if not run.events:
        complain(f"run {run.number} has no event yet")
    before, after = _queue_lines(reader, run)
    yield before
    for line in table_lines(events, words, wall_clock=wall_clock):
        yield line + "\n"
    yield from after


def _queue_lines(reader: JournalReader, run: StoredRun) -> tuple[str, list[str]]:
    """The lines before and after a run: its plan of several in the queue, and plans that go on."""
    from gpsfsm.running.history import queue_of, queues
    from gpsfsm.watch.tables import model_lines

    all_queues = queues(reader)
    entry = queue_of(all_queues, run.number)
    if entry is None:
        return "", []
    (number, plan), queue = entry, all_queues[entry[0] - 1]
    after = [f"{line}\n" for line in model_lines(queue.rows, plan)]
    plans, continued = queue.plans(), queue.continues(plan)
    if plans == 1:
        return "", after
    because = f", generated because plan {continued} gave up" if continued else ""
    return f"plan {plan} of {plans} in queue {number}{because}\n", after


def _picture(events: Iterable[tuple[Row, Moment]], words: Words, name: str) -> Iterator[str]:
    from gpsfsm.execution.journal_errors import DamagedJournalError
    from gpsfsm.watch.moments import Tally
    from gpsfsm.watch.svg import timeline, to_svg

    moments: list[Moment] = []
    damage: DamagedJournalError | None = None
    try:
        for _, moment in events:
            moments.append(moment)
    except DamagedJournalError as error:
        damage = error
    tally = Tally()
    for moment in moments:
        tally.add(moment.at_us, [moment.record])
    yield to_svg(timeline(moments, words), f"{name}: {tally.summary}")
    if damage is not None:
        raise damage


def _recording(reader: JournalReader, values: EventsCommand) -> Iterator[bytes]:
    """The recording of one run. Raises DamagedJournalError behind what can still be read."""
    from gpsfsm.running.history import motions
    from gpsfsm.running.prepare import stored
    from gpsfsm.watch.mcap_file import recording

    run = reader.run(values.number)
    words = stored(reader, run).words()
    try:
        moved = motions(reader, run, complain)
    except InputError as error:
        complain(f"the recording has no poses of run {run.number}: {error}")
        moved = []
    events = reader.events_written(run.number)
    yield from recording(run, events, words, motions=moved, wall_clock=values.wall_clock)
