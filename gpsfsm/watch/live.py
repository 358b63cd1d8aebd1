"""The live view: the tree of the plan with states, redrawn on a terminal a few times a second."""

from __future__ import annotations

import time
from contextlib import contextmanager
from enum import Enum
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.execution.records import Kind
from gpsfsm.model.drawing import plan_to_tree
from gpsfsm.model.plan import Kind as ElementKind
from gpsfsm.streams import urgent
from gpsfsm.watch.moments import Tally, moments, seconds
from gpsfsm.watch.record_text import Detail, Words, feedback_words, is_feedback

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from types import TracebackType
    from typing import Self, TextIO

    from rich.text import Text

    from gpsfsm.execution.records import Input, Record
    from gpsfsm.model.automaton import Automaton


class State(Enum):
    """The state of an element: a sign, and the same for terminals that know ASCII only."""

    WAITING = ("·", ".")
    LOADING = ("○", "o")
    HELD = ("‖", "=")
    ACTIVE = ("▶", ">")
    SUCCEEDED = ("✓", "+")
    FAILED = ("✗", "x")
    STOPPED = ("■", "#")

    @property
    def ended(self) -> bool:
        """True for a state that lasts."""
        return self in (State.SUCCEEDED, State.FAILED, State.STOPPED)


STATES = {
    Kind.TRIGGERED: State.LOADING,
    Kind.HELD: State.HELD,
    Kind.STARTED: State.ACTIVE,
    Kind.SUCCEEDED: State.SUCCEEDED,
    Kind.FAILED: State.FAILED,
    Kind.STOPPED: State.STOPPED,
}


class Line(NamedTuple):
    """One element: how it stands, its line of the tree, and how long it has acted ("": it has not).

    ``state`` is None for a control in which nothing acts. ``says`` is how far it is, as it says.
    """

    state: State | None
    text: str
    took: str
    says: str = ""


class Tree:
    """Follows a run. ``lines`` are in document order, one per element of the plan."""

    def __init__(self, automaton: Automaton) -> None:
        self._plan = automaton.plan
        self._elements = [node.origin for node in automaton.runners]
        self._texts = plan_to_tree(automaton.plan).splitlines()
        self._states: dict[int, State] = {}
        self._times: dict[int, tuple[int, int]] = {}
        self._says: dict[int, str] = {}
        self._inside: dict[int, int] = {}  # control: how many instances act inside it
        self.last = 0  # the element that has changed last

    def __len__(self) -> int:
        return len(self._plan.elements)

    def add(self, at_us: int, records: Iterable[Record]) -> None:
        """Take in what has happened."""
        for record in records:
            state = STATES.get(record.kind)
            if state is None or not 0 < record.node <= len(self._elements):
                continue
            element = self._elements[record.node - 1]
            before = self._states.get(element)
            if before is State.ACTIVE or state is State.ACTIVE:
                self._count(element, (state is State.ACTIVE) - (before is State.ACTIVE))
            self._states[element] = state
            self._says.pop(element, None)
            started = at_us if state is State.ACTIVE else self._times.get(element, (at_us, 0))[0]
            self._times[element] = (started, at_us)
            self.last = element

    def hear(self, record: Record) -> None:
        """Take in how far an instance is; the last that it says counts."""
        if 0 < record.node <= len(self._elements):
            self._says[self._elements[record.node - 1]] = feedback_words(record.data or {})

    def _count(self, element: int, change: int) -> None:
        parent = self._plan.elements[element].parent
        while change and parent >= 0:
            self._inside[parent] = self._inside.get(parent, 0) + change
            parent = self._plan.elements[parent].parent

    def lines(self, now_us: int, first: int = 0, count: int | None = None) -> list[Line]:
        """Some lines of the tree, or all."""
        end = len(self) if count is None else min(len(self), first + count)
        return [self._line(index, now_us) for index in range(first, end)]

    def _line(self, index: int, now_us: int) -> Line:
        if self._plan.elements[index].kind is not ElementKind.RUNNER:
            active = self._inside.get(index, 0) > 0
            return Line(State.ACTIVE if active else None, self._texts[index], "")
        state = self._states.get(index, State.WAITING)
        took = ""
        if state is State.ACTIVE:
            took = f"{seconds(now_us - self._times[index][0])} s"
        elif state.ended:
            started_us, ended_us = self._times[index]
            took = f"{seconds(ended_us - started_us)} s"
        return Line(state, self._texts[index], took, self._says.get(index, ""))


_PERIOD_S = 0.1
_NEWS = 5
_SHOW_CURSOR = "\x1b[?25h"
_STYLES = {
    State.LOADING: "yellow",
    State.HELD: "yellow",
    State.ACTIVE: "bold cyan",
    State.SUCCEEDED: "green",
    State.FAILED: "bold red",
    State.STOPPED: "magenta",
}


class LiveTree:
    """A watcher of a host that draws on a terminal; use it in a ``with`` statement.

    Where the tree is higher than the terminal, it shows the part where something happens. At the
    end the last picture stays.
    """

    def __init__(self, words: Words, stream: TextIO, *, color: bool = True) -> None:
        from rich.console import Console
        from rich.live import Live

        self._words = words
        self._tree = Tree(words.automaton)
        self._tally = Tally()
        self._news: list[str] = []
        self._drawn_s = 0.0
        self._now_us = 0
        self._console = Console(
            file=stream, no_color=not color, highlight=False, markup=False, emoji=False
        )
        self._ascii = 0 if _can_encode(stream) else 1
        self._live = Live(console=self._console, auto_refresh=False, transient=False)
        self._gone = False  # nobody sees the terminal any more
        self._resting = False
        self._covered = False  # the cursor has to be hidden once more
        self.hint: Callable[[], str] = str  # the last line, while it is drawn

    def __enter__(self) -> Self:
        with self._seen():
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.hint, self._resting = str, False
        self._draw()
        with self._seen():
            self._live.stop()

    def rest(self) -> None:
        """Leave the terminal to others for a while; may be called while something is drawn."""
        self._resting = True
        with self._seen():
            urgent(_SHOW_CURSOR, self._console.file.fileno())

    def go_on(self) -> None:
        """Draw again, below what others have written; may be called from any thread."""
        self._resting, self._covered = False, True

    def __call__(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Take in what has happened, and draw if it is time to."""
        self._now_us = at_us
        self._tree.add(at_us, records)
        self._tally.add(at_us, records)
        for moment in moments(at_us, happened, records):
            if is_feedback(moment.record):
                self._tree.hear(moment.record)
            if self._words.shown(moment.record, Detail.RUN) and moment.record.kind not in (
                Kind.STARTED,
                Kind.SUCCEEDED,
            ):
                self._news.append(f"{seconds(at_us):>10} s  {self._words.sentence(moment.record)}")
                del self._news[:-_NEWS]
        if time.monotonic() - self._drawn_s >= _PERIOD_S:
            self._draw()

    def tick(self, now_us: int) -> None:
        """Draw with this time, if it is time to."""
        self._now_us = max(self._now_us, now_us)
        if time.monotonic() - self._drawn_s >= _PERIOD_S:
            self._draw()

    def _draw(self) -> None:
        if not self._gone and not self._resting:
            with self._seen():
                if self._covered:
                    self._covered = False
                    self._console.show_cursor(False)
                self._live.update(self._picture(), refresh=True)
        self._drawn_s = time.monotonic()

    @contextmanager
    def _seen(self) -> Iterator[None]:
        """A terminal that is closed does not stop the run."""
        try:
            yield
        except OSError:
            self._gone = True

    def _picture(self) -> Text:
        from rich.text import Text

        hint = self.hint()
        room = max(3, self._console.height - len(self._news) - 4 - bool(hint))
        first = 0
        if len(self._tree) > room:
            first = min(max(0, self._tree.last - room // 2), len(self._tree) - room)
        picture = Text(no_wrap=True, overflow="ellipsis")
        for line in self._tree.lines(self._now_us, first, room):
            self._append(picture, line)
        if len(self._tree) > room:
            picture.append(f"… {room} of {len(self._tree)} elements are shown\n", "dim")
        for text in self._news:
            picture.append(f"{text}\n", "dim")
        picture.append(f"{seconds(self._now_us):>10} s  ", "bold")
        picture.append(f"{self._tally.started} started, {self._tally.succeeded} succeeded, ")
        picture.append(f"{self._tally.failed} failed", "red" if self._tally.failed else "")
        if hint:
            picture.append(f"\n{hint}", "dim")
        return picture

    def _append(self, picture: Text, line: Line) -> None:
        style = "" if line.state is None else _STYLES.get(line.state, "dim")
        sign = " " if line.state is None else line.state.value[self._ascii]
        picture.append(f"{sign} ", style)
        picture.append(f"{line.took:>10}  ", "dim")
        picture.append(line.text, style if line.state is State.ACTIVE else "")
        picture.append(f"  {line.says}\n" if line.says else "\n", "dim")


def _can_encode(stream: TextIO) -> bool:
    try:
        "├▶✓✗".encode(stream.encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        return False
    return True
