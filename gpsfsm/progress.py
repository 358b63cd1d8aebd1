"""Progress of work on many items: a bar on a terminal or in a notebook, or a caller's function."""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager
from html import escape
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from gpsfsm.errors import misused
from gpsfsm.streams import Stream, drawing, is_terminal

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

_Result = TypeVar("_Result")

Tick: TypeAlias = "Callable[[int, int | None], object]"
"""Takes how many items are done, after each, and how many there are in all (None: unknown)."""

Progress: TypeAlias = "Tick | bool"
"""``True`` shows a bar, on a terminal or in a notebook; a ``Tick`` is called instead."""


def counted(
    results: Iterable[_Result], total: int | None, progress: Progress | None, what: str = "items"
) -> Iterator[_Result]:
    """The results; ``progress`` counts them. Raises UsageError if it makes no sense.

    >>> list(counted("ab", 2, lambda done, total: print(f"{done} of {total}")))
    1 of 2
    2 of 2
    ['a', 'b']
    """
    with ticking(progress, what, total) as tick:
        for done, result in enumerate(results, start=1):
            tick(done, total)
            yield result


@contextmanager
def ticking(progress: Progress | None, what: str, total: int | None) -> Iterator[Tick]:
    """A function to call after each item, for all that ``progress`` may be.

    Raises UsageError for what cannot be called.
    """
    refuse_progress(progress)
    if progress is True:
        with progress_bar(what, total) as tick:
            yield tick
        return
    yield progress if callable(progress) else _no_tick


def _no_tick(_done: int, _total: int | None) -> None:
    """Count nothing."""


def refuse_progress(progress: object) -> None:
    """Raise UsageError for a progress that is neither a choice nor can be called."""
    if progress is not None and not isinstance(progress, bool) and not callable(progress):
        raise misused(
            "progress",
            "True, or a function of two numbers: how many items are done, and of how many",
            progress,
        )


_EVERY = 10
_SOON_S = 3.0
_REDRAWN_S = 0.2
MANY = 21
"""So many inputs take long enough for a progress bar."""


@contextmanager
def progress_bar(what: str, total: int | None, *, at_least: int = 0) -> Iterator[Tick]:
    """A bar that shows how many of ``total`` are done, as long as somebody looks.

    In a notebook it is an element of the page, which stays; on a terminal it is drawn on standard
    error and goes. Elsewhere there is none. A total below ``at_least`` has one on a terminal only,
    after ``_SOON_S`` seconds. ``total`` None: as many as the time allows.
    """
    few = total is not None and total < at_least
    if _in_notebook():
        yield _no_tick if few else _notebook_bar(what, total)
    elif _is_drawn():
        with (_late_bar if few else _terminal_bar)(what, total) as tick:
            yield tick
    else:
        yield _no_tick


@contextmanager
def _terminal_bar(what: str, total: int | None) -> Iterator[Tick]:
    from rich import progress as bars
    from rich.console import Console

    columns = (bars.TextColumn("{task.description}"), bars.BarColumn(), bars.MofNCompleteColumn())
    console = Console(file=drawing(Stream.ERR))
    with bars.Progress(
        *columns, bars.TimeElapsedColumn(), console=console, transient=True
    ) as progress:
        task = progress.add_task(what, total=total)
        every = 1 if total is not None and total < MANY else _EVERY

        def tick(done: int, of: int | None) -> None:
            if done % every == 0 or done == of:
                progress.update(task, completed=done, total=of or total)

        yield tick


@contextmanager
def _late_bar(what: str, total: int | None) -> Iterator[Tick]:
    """A bar on the terminal that begins when it has taken a while."""
    import threading

    over = threading.Event()
    state: tuple[int, int | None] = (0, total)

    def draw() -> None:
        if not over.wait(_SOON_S):
            with _terminal_bar(what, total) as tick:
                while not over.wait(_REDRAWN_S):
                    tick(*state)

    def note(done: int, of: int | None) -> None:
        nonlocal state
        state = done, of

    thread = threading.Thread(target=draw, daemon=True)
    thread.start()
    try:
        yield note
    finally:
        over.set()
        thread.join()


def _is_drawn() -> bool:
    return is_terminal(Stream.ERR) and os.environ.get("TERM") != "dumb"


def _in_notebook() -> bool:
    """True if a kernel runs this for a page; IPython on a terminal has none."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return getattr(shell, "kernel", None) is not None


def _notebook_bar(what: str, total: int | None) -> Tick:
    """An element ``progress`` of HTML: every page that shows notebooks draws it, without widgets.

    A message is sent for each percent, so that a million items do not send a million.
    """
    from IPython.display import display

    handle = display(_Bar(what, 0, total), display_id=True)

    def tick(done: int, of: int | None) -> None:
        whole = of or total
        step = _EVERY if whole is None else max(1, whole // 100)
        if handle is not None and (done % step == 0 or done == whole):
            handle.update(_Bar(what, done, whole))

    return tick


class _Bar:
    """The state of a bar, as a notebook shows it."""

    def __init__(self, what: str, done: int, total: int | None) -> None:
        self._what, self._done, self._total = what, done, total

    def __repr__(self) -> str:
        """The text for where nothing is drawn."""
        return f"{self._what}: {self._done:,}" + (f" of {self._total:,}" if self._total else "")

    def _repr_html_(self) -> str:
        amount = f' value="{self._done}" max="{self._total}"' if self._total else ""
        return f"<div><progress{amount}></progress> {escape(repr(self))}</div>"
