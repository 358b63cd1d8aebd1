"""The keyboard of a live view: space pauses a run and lets it go on, q cancels it."""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Protocol

with suppress(ImportError):  # not on every system
    import termios

if TYPE_CHECKING:
    from types import FrameType, TracebackType
    from typing import Self


_HAS_TERMIOS = "termios" in sys.modules
_PATIENCE_S = 0.2
_ESCAPE = b"\x1b"


class Interruption(Protocol):
    """The receiver of a wish that the run stops or pauses."""

    requested: bool
    paused: bool

    def toggle(self) -> None:
        """Pause, or go on."""


class Screen(Protocol):
    """The drawing on the terminal meanwhile."""

    def rest(self) -> None:
        """Somebody else uses the terminal."""

    def go_on(self) -> None:
        """The terminal is ours again."""


def has_keyboard() -> bool:
    """True if keys can be read: standard input is a terminal, and this is the main thread."""
    if not _HAS_TERMIOS or threading.current_thread() is not threading.main_thread():
        return False
    try:
        return sys.stdin is not None and os.isatty(sys.stdin.fileno())
    except (OSError, ValueError):  # closed, or none at all
        return False


class Keys:
    """While it is entered, keys go to the run and not to the screen.

    The terminal is as it was whenever this process does not run in its foreground: after the end,
    however it comes, while it is stopped with Ctrl-Z, and in the background. Ctrl-C stays a signal.
    """

    def __init__(self, interruption: Interruption) -> None:
        self._interruption = interruption
        self._number = sys.stdin.fileno()
        self._before: list[Any] | None = None  # how the terminal was, while it is ours
        self._first: list[Any] | None = None  # how it was when we first took it
        self._standing = False  # from Ctrl-Z on until the process goes on
        self._handlers: dict[int, Any] = {}
        self._thread = threading.Thread(target=self._listen, name="keys", daemon=True)
        self._lock = threading.RLock()
        self._closed = False
        self.screen: Screen | None = None

    @property
    def hint(self) -> str:
        """The present effect of the keys; nothing in the background."""
        if self._before is None:
            return ""
        if self._interruption.requested:
            return "being cancelled"
        if self._interruption.paused:
            return "paused: space continues, q cancels"
        return "space pauses, q cancels"

    def __enter__(self) -> Self:
        self._woken, self._waker = os.pipe()
        for number, handler in (
            (signal.SIGTSTP, self._stopped),
            (signal.SIGCONT, self._continued),
            (signal.SIGQUIT, self._ended),
        ):
            self._handlers[number] = signal.signal(number, handler)
        self._take()
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with self._lock:
            self._closed = True
            self._release()
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        os.close(self._waker)  # the thread is told by that
        self._thread.join(2 * _PATIENCE_S)

    # -- the terminal -----------------------------------------------------------------------

    def _in_foreground(self) -> bool:
        """False in the background, from where a change of the terminal stops a process."""
        try:
            return os.tcgetpgrp(self._number) == os.getpgrp()
        except OSError:  # a terminal that controls no processes
            return True

    def _take(self) -> None:
        with self._lock, suppress(termios.error, OSError):
            if self._closed or self._standing or self._before is not None:
                return
            if not self._in_foreground():
                return
            before = termios.tcgetattr(self._number)
            if self._first is None:
                self._first = before
            elif not before[3] & termios.ICANON:  # that was us
                before = self._first
            ours = termios.tcgetattr(self._number)
            ours[3] &= ~(termios.ECHO | termios.ICANON)
            ours[6][termios.VMIN], ours[6][termios.VTIME] = 1, 0
            termios.tcsetattr(self._number, termios.TCSANOW, ours)
            self._before = before
            if self.screen is not None:
                self.screen.go_on()

    def _release(self) -> None:
        before, self._before = self._before, None
        if before is not None and self._in_foreground():
            with suppress(termios.error, OSError):
                termios.tcsetattr(self._number, termios.TCSANOW, before)

    def _stopped(self, _number: int, _frame: FrameType | None) -> None:
        if self.screen is not None:
            self.screen.rest()
        self._standing = True
        self._release()
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        signal.raise_signal(signal.SIGTSTP)  # it is here that the process stands still
        signal.signal(signal.SIGTSTP, self._stopped)
        # The other thread may have taken the terminal once more right before the process stood
        # still, and the shell has changed it since.
        self._before = None
        self._standing = False
        if self.screen is not None:
            self.screen.rest()
        self._take()

    def _continued(self, _number: int, _frame: FrameType | None) -> None:
        self._take()

    def _ended(self, number: int, _frame: FrameType | None) -> None:
        if self.screen is not None:
            self.screen.rest()
        self._release()
        signal.signal(number, signal.SIG_DFL)
        signal.raise_signal(number)

    # -- the keys ---------------------------------------------------------------------------

    def _listen(self) -> None:
        # Who reads a terminal from the background is stopped; this thread gets an error instead.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTTIN})
        with suppress(OSError):
            while (ready := self._until_pressed()) is not None:
                if not self._is_ours():
                    self._take()
                elif ready:
                    pressed = self._read()
                    if not pressed:  # the terminal is gone
                        break
                    if not pressed.startswith(_ESCAPE):  # an arrow, say
                        self._press(pressed)
        os.close(self._woken)

    def _until_pressed(self) -> bool | None:
        """Wait for a key, but not for long; None at the end.

        A shell need not tell a process that it is in the foreground again: one that was running in
        the background gets no signal, and a key is what the shell has read.
        """
        watched = [self._number, self._woken] if self._is_ours() else [self._woken]
        ready = select.select(watched, [], [], _PATIENCE_S)[0]
        return None if self._woken in ready else bool(ready)

    def _is_ours(self) -> bool:
        """True if keys are for the run."""
        if self._before is None:
            return False
        if self._in_foreground():
            return True
        with self._lock:  # somebody has taken the terminal away, and may change it
            self._before = None
            if self.screen is not None and not self._closed:
                self.screen.rest()
        return False

    def _read(self) -> bytes:
        try:
            return os.read(self._number, 64)
        except OSError:
            if self._in_foreground():
                raise
            return _ESCAPE  # no key

    def _press(self, pressed: bytes) -> None:
        for key in pressed:
            if key == ord(" ") and not self._interruption.requested:
                self._interruption.toggle()
            elif key in b"qQ" and not self._interruption.requested:
                # as Ctrl-C does it; a key that is held down must not abort the run
                signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
                return
