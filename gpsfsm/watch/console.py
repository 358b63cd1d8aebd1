"""Views of a run while it runs: a live tree, plain lines, or lines of JSON."""

from __future__ import annotations

import os
from contextlib import ExitStack
from typing import TYPE_CHECKING

from gpsfsm.execution.records import Input
from gpsfsm.streams import (
    Form,
    Stream,
    complain,
    drawing,
    emit,
    form_of,
    give_up_stdout,
    is_open,
    is_terminal,
    lose,
    wants_color,
)
from gpsfsm.watch.moments import Tally
from gpsfsm.watch.record_text import Detail, Lines, Words

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from types import TracebackType
    from typing import Self

    from gpsfsm.execution.journal import Heading
    from gpsfsm.execution.journal_rows import Row, RowMaker
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.records import Record
    from gpsfsm.watch.keys import Interruption, Keys


def header(heading: Heading) -> str:
    """The first line of an export, as the journal has it."""
    import json

    from gpsfsm.execution.journal_rows import canonical

    return canonical({"journal": 1, **json.loads(heading.text())})


class _Printer:
    """Writes lines to standard output. A reader that leaves does not stop the run."""

    def __init__(self, form: Form, *, at_once: bool) -> None:
        self._form = form
        self._open = is_open(Stream.OUT)
        self._at_once = at_once

    def __call__(self, text: str) -> None:
        if not self._open:
            return
        try:
            emit(f"{text}\n", self._form, flush=self._at_once)
        except OSError as error:
            self._give_up(error)

    def finish(self) -> None:
        """Write what is still in a buffer."""
        try:
            if self._open:
                emit("", self._form)
        except OSError as error:
            self._give_up(error)

    def _give_up(self, error: OSError) -> None:
        self._open = False
        give_up_stdout()
        if not isinstance(error, BrokenPipeError):
            lose(Stream.OUT)
            complain(
                f"cannot write to standard output: {error.strerror or error}; the run continues"
            )


class View:
    """A watcher of one run; use it in a ``with`` statement.

    ``at_once``: lines are written when they happen, else now and then. ``header`` is the first line
    of JSON, ``title`` that of everything else. ``is_new`` says whether an event is news; what is
    not is counted but not told. ``keys`` are told of in the live tree.
    """

    def __init__(
        self,
        output_format: str,
        kernel: Kernel,
        *,
        header: str = "",
        title: str = "",
        verbose: bool = False,
        at_once: bool = False,
        is_new: Callable[[], bool] = lambda: True,
        keys: Keys | None = None,
    ) -> None:
        self.tally = Tally()
        self._ticks: list[Callable[[int], object]] = []
        self._is_new = is_new
        self._stack = ExitStack()
        self._json = output_format == "json"
        self._printer = _Printer(form_of(output_format), at_once=at_once)
        self._maker: RowMaker | None = None  # of lines of JSON
        self._watchers: list[Callable[[int, Input, Sequence[Record]], None]] = []
        self._late: list[Callable[[int, Input, Sequence[Record]], None]] = []
        words = Words(kernel.automaton, kernel.runners)
        if title and not self._json:
            self._printer(title)
            self._printer.finish()
        if self._json:
            self._add_json(kernel, header)
        elif is_live(output_format):
            from gpsfsm.watch.live import LiveTree

            live = LiveTree(words, drawing(Stream.OUT), color=wants_color("auto"))
            self._ticks.append(live.tick)
            self._watchers.append(live)
            self._stack.enter_context(live)
            if keys is not None:
                keys.screen = live
                live.hint = lambda: keys.hint
                self._stack.callback(setattr, keys, "screen", None)
        else:
            detail = Detail.ALL if verbose else Detail.RUN
            self._late.append(Lines(words, self._printer, detail=detail))

    def _add_json(self, kernel: Kernel, header: str) -> None:
        from gpsfsm.execution.journal_rows import RowMaker, line

        maker = self._maker = RowMaker(kernel)
        if header:
            self._printer(header)

        def watch(at_us: int, happened: Input, records: Sequence[Record]) -> None:
            rows = maker.make(at_us, happened, records)
            if self._is_new():
                for row in rows:
                    self._printer(line(row))

        self._watchers.append(watch)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stack.close()
        self._printer.finish()

    def __call__(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Take in what has happened."""
        self.tally.add(at_us, records)
        for watcher in self._watchers:
            watcher(at_us, happened, records)
        if self._is_new():
            for watcher in self._late:
                watcher(at_us, happened, records)

    def tick(self, now_us: int) -> None:
        """Nothing happens at this time of the run."""
        for tick in self._ticks:
            tick(now_us)

    def recall(self, rows: Sequence[Row], kernel: Kernel) -> None:
        """Take in what another process has journaled of the run; nothing of it is told again."""
        from gpsfsm.watch.moments import stored_moments

        for _, moment in stored_moments(rows, len(kernel.automaton.nodes), len(kernel.runners)):
            record = moment.record
            self.tally.add(moment.at_us, [record])
            if self._maker is None:  # what is taken in here is less than what a line tells
                for watcher in self._watchers:
                    watcher(moment.at_us, Input(record.kind), [record])
        if self._maker is not None and rows:
            self._maker.seq = rows[-1].seq

    def say(self, text: str) -> None:
        """Write a line for people; not among lines of JSON."""
        self._stack.close()
        if not self._json:
            self._printer(text)


def write_line(output_format: str, text: str) -> None:
    """Write a line for people between two runs; not among lines of JSON."""
    if output_format != "json":
        printer = _Printer(form_of(output_format), at_once=True)
        printer(text)


def is_live(output_format: str) -> bool:
    """True if a run is shown as a tree that is drawn again and again."""
    return output_format == "auto" and is_terminal(Stream.OUT) and os.environ.get("TERM") != "dumb"


def keyboard(output_format: str, interruption: Interruption, stack: ExitStack) -> Keys | None:
    """The keys of a live tree, until the end of ``stack``; None where there is nobody to press."""
    if not is_live(output_format):
        return None
    from gpsfsm.watch.keys import Keys, has_keyboard

    return stack.enter_context(Keys(interruption)) if has_keyboard() else None
