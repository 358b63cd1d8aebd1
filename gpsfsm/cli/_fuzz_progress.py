"""The progress bar of ``gpsfsm fuzz``, on standard error and only if that is a terminal."""

from __future__ import annotations

import os
from contextlib import contextmanager
from typing import TYPE_CHECKING

from gpsfsm.streams import Stream, drawing, is_terminal

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

__all__ = ["progress_bar"]

_EVERY = 10


@contextmanager
def progress_bar(what: str, total: int | None) -> Iterator[Callable[[int], None]]:
    """Show how many of ``total`` are done, when the function that it gives is told.

    ``total`` None: as many as the time allows.
    """
    if not _is_terminal():
        yield lambda _: None
        return
    from rich import progress as bars  # noqa: PLC0415  (slow to import)
    from rich.console import Console  # noqa: PLC0415

    columns = (bars.TextColumn("{task.description}"), bars.BarColumn(), bars.MofNCompleteColumn())
    console = Console(file=drawing(Stream.ERR))
    with bars.Progress(
        *columns, bars.TimeElapsedColumn(), console=console, transient=True
    ) as progress:
        task = progress.add_task(what, total=total)

        def tell(done: int) -> None:
            if done % _EVERY == 0 or done == total:
                progress.update(task, completed=done)

        yield tell


def _is_terminal() -> bool:
    return is_terminal(Stream.ERR) and os.environ.get("TERM") != "dumb"
