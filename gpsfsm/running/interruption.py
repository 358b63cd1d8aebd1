"""Interruption of runs: somebody wants them to stop, or to pause."""

from __future__ import annotations

import signal
from typing import TYPE_CHECKING, Any

from gpsfsm.streams import urgent

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType, TracebackType
    from typing import Self

REASON = "interrupted"
"""Why a run is cancelled that was interrupted."""

_SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
_CANCELLING = "gpsfsm: the run is being cancelled"
_ABORTING = {
    number: f"{_CANCELLING} because of {number.name}; a second signal aborts it\n"
    for number in _SIGNALS
} | {signal.SIGINT: f"{_CANCELLING}; Ctrl-C again aborts it\n"}


class Interruption:
    """A request to stop (``requested``) or pause (``paused``) runs.

    Within a ``with`` block, Ctrl-C and SIGTERM request a stop, and so does the end of the terminal
    (SIGHUP), unless it is ignored; a second signal raises KeyboardInterrupt. Without a ``with``
    block, only the code that holds the object can request anything.
    """

    def __init__(self) -> None:
        self.requested = False
        self.paused = False
        self.on_request: Callable[[], object] | None = None
        self.on_pause: Callable[[bool], None] | None = None  # gets the new ``paused``
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        for number in _SIGNALS:
            if number != signal.SIGINT and signal.getsignal(number) is signal.SIG_IGN:
                continue  # by nohup, say
            try:
                self._before[number] = signal.signal(number, self._signalled)
            except ValueError:  # not in the main thread: somebody else sees to signals
                break
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for number, before in self._before.items():
            signal.signal(number, before)
        self._before.clear()

    def toggle(self) -> None:
        """Pause or continue; may be called from any thread."""
        self.paused = not self.paused
        if self.on_pause is not None:
            self.on_pause(self.paused)

    def request(self) -> None:
        """Cancel the active runs and start no others."""
        self.requested = True
        if self.on_request is not None:
            self.on_request()

    def let_go(self) -> None:
        """Detach from the runs, because nothing is left to stop or pause."""
        self.on_request = self.on_pause = None

    def _signalled(self, number: int, _frame: FrameType | None) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True  # before anything is written: another signal may come meanwhile
        urgent(_ABORTING.get(number, _ABORTING[signal.SIGINT]))
        self.request()
