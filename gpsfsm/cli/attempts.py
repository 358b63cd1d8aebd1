"""``gpsfsm attempts``: what models have answered, and what was wrong with it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._help import ANY_PATH, Command, Section, declare
from gpsfsm.cli._options import Values, format_option, output_option, read_values
from gpsfsm.cli.generate import JOURNAL
from gpsfsm.errors import GpsfsmError, InputError, UsageError
from gpsfsm.streams import check_writable, complain, form_of, write_private

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.execution.journal_read import JournalReader
    from gpsfsm.execution.queue_rows import QueueRow
    from gpsfsm.generation.attempt_log import KeptSession

_FORMAT_VERSION = 1


@dataclass(frozen=True, kw_only=True)
class AttemptsCommand(Values):
    """The options of ``gpsfsm attempts``."""

    journal: str
    output_format: str
    number: int | None
    show: int | None
    output_file: str


@click.command(
    "attempts", cls=Command, section=Section.GENERATE, short_help="Show the answers of models."
)
@click.argument("journal", default=JOURNAL, metavar="[JOURNAL]", type=ANY_PATH)
@format_option("table", "json", text="Output format.")
@declare(
    "--session",
    "number",
    type=click.IntRange(min=1),
    metavar="N",
    help="Show one session, a search for a plan. [default: all]",
)
@declare(
    "--show",
    type=click.IntRange(min=1),
    metavar="N",
    help="Show the Nth attempt of the session in full. [default session: the last]",
)
@output_option()
@click.pass_context
def command(context: click.Context, /, **_: Any) -> int:
    r"""Show the answers of models, as recorded in JOURNAL (default: gpsfsm.db).

    \b
    Examples:
      gpsfsm attempts
      gpsfsm attempts run.db --session 2 --show 1
    """
    values = read_values(context, AttemptsCommand)
    if values.show and values.output_format == "json":
        raise UsageError("--show cannot be used with --format json, which shows everything")
    check_writable(values.output_file, [values.journal])
    from gpsfsm.execution.journal_errors import JournalError
    from gpsfsm.execution.journal_read import JournalReader
    from gpsfsm.generation.attempt_log import attempt_text, sessions, sessions_text

    with JournalReader(values.journal) as reader:
        note = reader.check()
        try:
            searches = sessions(_rows(reader))
        except JournalError:
            raise
        except InputError as error:
            raise InputError(f"{values.journal}: {error}") from error
    chosen = _chosen(searches, values)
    if values.show:
        text = "".join(attempt_text(chosen[-1][1], values.show))
    elif values.output_format == "json":
        text = _json(chosen)
    else:
        text = "".join(sessions_text(chosen))
    write_private(text, values.output_file, form=form_of(values.output_format))
    if note:
        complain(note)
    return 0


def _rows(reader: JournalReader) -> Iterator[QueueRow]:
    from gpsfsm.execution.queue_rows import QueueRow

    for seq, _, kind, plan, by, data, message in reader.queue():
        try:
            row = QueueRow.stored(kind, plan, by, data, message)
            if not isinstance(row.data or {}, dict):
                raise ValueError("no object")
        except (ValueError, RecursionError):
            raise InputError(f"row {seq} of the plan queue is damaged") from None
        yield row


def _chosen(searches: list[KeptSession], values: AttemptsCommand) -> list[tuple[int, KeptSession]]:
    numbered = list(enumerate(searches, start=1))
    number = values.number
    if not numbered:
        raise GpsfsmError(f"{values.journal}: no model was asked in this journal")
    if number is None:
        return numbered
    if number > len(numbered):
        last = "session 1 alone" if len(numbered) == 1 else f"sessions 1 to {len(numbered)}"
        raise UsageError(f"there is no session {number} in {values.journal}; it holds {last}")
    return [numbered[number - 1]]


def _json(chosen: list[tuple[int, KeptSession]]) -> str:
    from gpsfsm.generation.attempt_log import attempt_data, session_data

    data = [
        {
            "session": number,
            "plan": kept.plan,
            **session_data(kept.session),
            "accepted": kept.accepted,
            "interrupted": kept.result is None,
            "reason": kept.reason,
            "attempts": [attempt_data(attempt) for attempt in kept.attempts],
        }
        for number, kept in chosen
    ]
    content = {"version": _FORMAT_VERSION, "sessions": data}
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"
