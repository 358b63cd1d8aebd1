"""A timeline of a run, and its picture, which needs nothing but itself.

A timeline has lanes with bars, links, joins and pauses, in document order. The picture follows the
reader's choice of light or dark, and every outcome has a form of its own, so that it can be read
without colours.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape  # only writes

from gpsfsm.execution.records import Kind, Status
from gpsfsm.model.printable import clip
from gpsfsm.watch.moments import seconds, status_of
from gpsfsm.watch.record_text import Detail

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from gpsfsm.watch.moments import Moment
    from gpsfsm.watch.record_text import Words


MAX_LANES = 500
"""A picture of more lanes helps nobody: those that begin first are drawn."""


@dataclass(frozen=True, slots=True)
class Bar:
    """One instance: times in microseconds since the run began, None for what never happened.

    ``outcome`` is SUCCEEDED, FAILED or STOPPED, or None if it was still active at the end;
    ``summary`` says it in words.
    """

    triggered_us: int
    started_us: int | None = None
    ended_us: int | None = None
    outcome: Kind | None = None
    summary: str = ""


@dataclass(frozen=True, slots=True)
class Mark:
    """Something that happens at an instant in a lane: a join fires, a runner is asked again."""

    at_us: int
    summary: str


@dataclass(slots=True)
class Lane:
    """The lane of an instance or of a control. ``cause`` is the index of the lane before it."""

    element: int
    label: str
    bar: Bar | None = None
    marks: list[Mark] = field(default_factory=list)
    cause: int | None = None

    @property
    def begin_us(self) -> int:
        """When anything happens here first."""
        times = [mark.at_us for mark in self.marks[:1]]
        return min([*times, self.bar.triggered_us] if self.bar else times)


@dataclass(frozen=True, slots=True)
class Timeline:
    """A run as a picture. ``hidden`` counts the lanes that are left out."""

    lanes: tuple[Lane, ...]
    pauses: tuple[tuple[int, int], ...]
    end_us: int
    status: Status
    hidden: int = 0


class _Builder:
    def __init__(self, words: Words) -> None:
        self.words = words
        self.lanes: dict[int, Lane] = {}  # by element
        self.causes: dict[int, int] = {}  # element: the element whose answer triggered it
        self.pauses: list[tuple[int, int]] = []
        self.paused_us: int | None = None
        self.end_us = 0
        self.status = Status.RUNNING

    def lane(self, node: int) -> Lane:
        element = self.words.element(node).index
        if element not in self.lanes:
            label = f"{self.words.line(node)}  {self.words.node(node)}"
            self.lanes[element] = Lane(element, label)
        return self.lanes[element]

    def add(self, moment: Moment) -> None:
        at_us, record = moment.at_us, moment.record
        self.end_us = max(self.end_us, at_us)
        kind = record.kind
        if kind is Kind.ENDED:
            self.status = status_of(record)
        elif kind is Kind.PAUSE and self.paused_us is None:
            self.paused_us = at_us
        elif kind is Kind.RESUME and self.paused_us is not None:
            self.pauses.append((self.paused_us, at_us))
            self.paused_us = None
        elif kind is Kind.JOINED or kind is Kind.RESTARTED:
            if self.words.shown(record, Detail.RUN):
                self.lane(record.node).marks.append(Mark(at_us, self.words.verb(record)))
        elif record.node > 0:
            self._instance(moment)

    def _instance(self, moment: Moment) -> None:
        at_us, record = moment.at_us, moment.record
        if record.kind in (Kind.TRIGGERED, Kind.HELD):
            lane = self.lane(record.node)
            lane.bar = lane.bar or Bar(at_us)
            if moment.cause > 0:
                self.causes[lane.element] = self.words.element(moment.cause).index
        elif record.kind is Kind.STARTED:
            lane = self.lane(record.node)
            lane.bar = replace(lane.bar or Bar(at_us), started_us=at_us)
        elif record.kind in (Kind.SUCCEEDED, Kind.FAILED, Kind.STOPPED):
            lane = self.lane(record.node)
            lane.bar = replace(
                lane.bar or Bar(at_us),
                ended_us=at_us,
                outcome=record.kind,
                summary=self.words.verb(record),
            )

    def finish(self) -> Timeline:
        if self.paused_us is not None:
            self.pauses.append((self.paused_us, self.end_us))
        lanes = sorted(self.lanes.values(), key=lambda lane: (lane.begin_us, lane.element))
        shown = sorted(lanes[:MAX_LANES], key=lambda lane: lane.element)
        place = {lane.element: index for index, lane in enumerate(shown)}
        for lane in shown:
            lane.cause = place.get(self.causes.get(lane.element, -1))
        return Timeline(
            tuple(shown), tuple(self.pauses), self.end_us, self.status, len(lanes) - len(shown)
        )


def timeline(moments: Iterable[Moment], words: Words) -> Timeline:
    """The lanes of a run: one per instance that was triggered and per parallel control's join."""
    builder = _Builder(words)
    for moment in moments:
        builder.add(moment)
    return builder.finish()


_LANE = 24
_BAR = 12
_TOP = 74
_CHART = 640
_RIGHT = 96
_MARGIN = 16
_CHARACTER = 6.7  # the width of one, in a font of 12 px
_TITLE_CHARACTER = 8.6  # in bold 14 px
_MAX_LABEL = 46
_TICKS = 8
_STEPS_US = (
    *(base * 10**power for power in range(0, 6) for base in (1, 2, 5)),
    *(unit * 1_000_000 for unit in (1, 2, 5, 10, 15, 30)),
    *(unit * 60_000_000 for unit in (1, 2, 5, 10, 15, 30)),
    *(unit * 3_600_000_000 for unit in (1, 2, 3, 6, 12, 24)),
)

_LIGHT = {
    "background": "fill:#ffffff",
    "text": "fill:#1f2328",
    "soft": "fill:#59636e;stroke:#ffffff;stroke-width:3;paint-order:stroke",
    "grid": "stroke:#d1d9e0;stroke-width:1",
    "band": "fill:#f3f5f7",
    "pause": "fill:#fff3c4",
    "link": "stroke:#8c959f;stroke-width:1;fill:none",
    "wait": "stroke:#59636e;stroke-width:2",
    "end": "stroke:#1f2328;stroke-width:1.5;stroke-dasharray:5 3",
    "ok": "fill:#2da44e;stroke:#116329;stroke-width:1",
    "bad": "fill:url(#gpsfsm-hatch);stroke:#a40e26;stroke-width:1.5",
    "hatch": "stroke:#cf222e;stroke-width:2.5",
    "hatched": "fill:#ffebe9",
    "stop": "fill:#ffffff;stroke:#59636e;stroke-width:1.5",
    "open": "fill:#ddf4ff;stroke:#0969da;stroke-width:1.5;stroke-dasharray:4 2",
    "sign": "fill:none;stroke:#1f2328;stroke-width:2",
    "join": "fill:#8250df;stroke:#ffffff;stroke-width:1",
}
_DARK = {
    "background": "fill:#0d1117",
    "text": "fill:#f0f6fc",
    "soft": "fill:#9198a1;stroke:#0d1117",
    "grid": "stroke:#30363d",
    "band": "fill:#151b23",
    "pause": "fill:#3a2f0b",
    "link": "stroke:#656c76",
    "wait": "stroke:#9198a1",
    "end": "stroke:#f0f6fc",
    "ok": "fill:#238636;stroke:#3fb950",
    "bad": "stroke:#ff7b72",
    "hatch": "stroke:#f85149",
    "hatched": "fill:#2d1115",
    "stop": "fill:#0d1117;stroke:#9198a1",
    "open": "fill:#121d2f;stroke:#4493f8",
    "sign": "stroke:#f0f6fc",
    "join": "fill:#ab7df8;stroke:#0d1117",
}
_FONT = "font-family:ui-sans-serif,system-ui,'DejaVu Sans',Helvetica,Arial,sans-serif"


def to_svg(shown: Timeline, title: str) -> str:
    """Draw a timeline; the same bytes for the same run."""
    return _Drawing(shown, title).draw()


class _Drawing:
    def __init__(self, shown: Timeline, title: str) -> None:
        self.shown = shown
        longest = max([len(clip(lane.label, _MAX_LABEL)) for lane in shown.lanes], default=0)
        self.left = _MARGIN + round(longest * _CHARACTER) + 12
        self.width = self.left + _CHART + _RIGHT
        self.title = clip(title, round((self.width - 2 * _MARGIN) / _TITLE_CHARACTER))
        self.bottom = _TOP + _LANE * len(shown.lanes)
        self.height = self.bottom + 58
        self.span_us = max(1, shown.end_us)

    def draw(self) -> str:
        lines = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self.width} {self.height}" '
            f'width="{self.width}" height="{self.height}" role="img" '
            f'aria-labelledby="gpsfsm-title">',
            f'<title id="gpsfsm-title">{escape(self.title)}</title>',
            f"<style>\n{_style()}</style>",
            '<defs><pattern id="gpsfsm-hatch" width="6" height="6" '
            'patternUnits="userSpaceOnUse" patternTransform="rotate(45)">'
            '<rect class="hatched" width="6" height="6"/>'
            '<line class="hatch" x1="0" y1="0" x2="0" y2="6"/></pattern></defs>',
            f'<rect class="background" width="{self.width}" height="{self.height}"/>',
            f'<text class="text title" x="{_MARGIN}" y="26">{escape(self.title)}</text>',
            *self._bands(),
            *self._end(),
            *self._axis(),
            *self._links(),
            *(part for row in range(len(self.shown.lanes)) for part in self._lane(row)),
            *self._legend(),
            "</svg>",
        ]
        return "\n".join(lines) + "\n"

    def x(self, at_us: int) -> float:
        """The horizontal place of a time."""
        return self.left + _CHART * at_us / self.span_us

    def _bands(self) -> Iterator[str]:
        """Every other lane is shaded; pauses are shaded from top to bottom."""
        for row in range(1, len(self.shown.lanes), 2):
            yield (
                f'<rect class="band" x="0" y="{_TOP + _LANE * row}" '
                f'width="{self.width}" height="{_LANE}"/>'
            )
        for begin_us, end_us in self.shown.pauses:
            width = max(1.0, self.x(end_us) - self.x(begin_us))
            yield (
                f'<rect class="pause" x="{self.x(begin_us):.1f}" y="{_TOP}" width="{width:.1f}" '
                f'height="{self.bottom - _TOP}"><title>paused</title></rect>'
            )

    def _axis(self) -> Iterator[str]:
        step = next(
            (each for each in _STEPS_US if self.span_us / each <= _TICKS),
            86_400_000_000 * (1 + self.span_us // (_TICKS * 86_400_000_000)),
        )
        for tick in range(0, self.span_us + 1, step):
            x = self.x(tick)
            yield (
                f'<line class="grid" x1="{x:.1f}" y1="{_TOP - 6}" x2="{x:.1f}" '
                f'y2="{self.bottom}"/>'
                f'<text class="soft middle" x="{x:.1f}" y="{_TOP - 10}">{_time(tick, step)}</text>'
            )

    def _links(self) -> Iterator[str]:
        """From what has ended to what it has triggered."""
        for row, lane in enumerate(self.shown.lanes):
            if lane.cause is None or lane.bar is None:
                continue
            x = self.x(lane.bar.triggered_us)
            above, below = sorted((lane.cause, row))
            yield (
                f'<line class="link" x1="{x:.1f}" y1="{self._middle(above)}" '
                f'x2="{x:.1f}" y2="{self._middle(below)}"/>'
            )

    def _middle(self, row: int) -> int:
        return _TOP + _LANE * row + _LANE // 2

    def _lane(self, row: int) -> Iterator[str]:
        lane, y = self.shown.lanes[row], self._middle(row)
        label = escape(clip(lane.label, _MAX_LABEL))
        yield f'<text class="text label" x="{_MARGIN}" y="{y + 4}">{label}</text>'
        if lane.bar is not None:
            yield from self._bar(lane, lane.bar, y)
        for mark in lane.marks:
            x = self.x(mark.at_us)
            tooltip = escape(f"{seconds(mark.at_us)} s: {mark.summary}")
            yield (
                f'<path class="join" d="M{x:.1f},{y - 7}l7,7l-7,7l-7,-7z"><title>{tooltip}</title>'
                f"</path>"
            )
            if lane.bar is None:
                yield self._beside(x + 11, y, mark.summary, soft=True)

    def _bar(self, lane: Lane, bar: Bar, y: int) -> Iterator[str]:
        end_us = self.shown.end_us if bar.ended_us is None else bar.ended_us
        begin_us = end_us if bar.started_us is None else bar.started_us
        begin, end = self.x(begin_us), self.x(end_us)
        end = max(end, begin + 2)
        tooltip = f"{lane.label}: {_story(bar, self.shown.end_us)}"
        if begin_us > bar.triggered_us:
            triggered = self.x(bar.triggered_us)
            yield (f'<line class="wait" x1="{triggered:.1f}" y1="{y}" x2="{begin:.1f}" y2="{y}"/>')
        yield (
            f'<rect class="{_CLASSES[bar.outcome]}" x="{begin:.1f}" y="{y - _BAR // 2}" '
            f'width="{end - begin:.1f}" height="{_BAR}"><title>{escape(tooltip)}</title></rect>'
        )
        yield _sign(bar.outcome, end + 5, y)
        yield self._beside(end + 19, y, f"{seconds(end_us - begin_us)} s", soft=True)

    def _beside(self, x: float, y: float, text: str, *, soft: bool) -> str:
        """A text right of a bar, or left of it where there is no room."""
        name = "soft" if soft else "text"
        shown = clip(text, 30)
        if x + len(shown) * _CHARACTER > self.width - 4:
            return (
                f'<text class="{name} end-here" x="{x - 28:.1f}" y="{y + 4}">{escape(shown)}</text>'
            )
        return f'<text class="{name}" x="{x:.1f}" y="{y + 4}">{escape(shown)}</text>'

    def _end(self) -> Iterator[str]:
        x = self.x(self.shown.end_us)
        yield (
            f'<line class="end" x1="{x:.1f}" y1="{_TOP - 34}" x2="{x:.1f}" y2="{self.bottom}"/>'
            f'<text class="text" x="{x + 5:.1f}" y="{_TOP - 27}">'
            f"{self.shown.status.value}</text>"
        )
        if self.shown.hidden:
            yield (
                f'<text class="soft" x="{_MARGIN}" y="{self.bottom + 16}">'
                f"{self.shown.hidden} more lanes are not drawn</text>"
            )

    def _legend(self) -> Iterator[str]:
        x, y = float(_MARGIN), self.bottom + 36
        for outcome, word in _LEGEND:
            yield (
                f'<rect class="{_CLASSES[outcome]}" x="{x:.1f}" y="{y - 6}" width="28" '
                f'height="{_BAR}"/>{_sign(outcome, x + 33, y)}'
                f'<text class="soft" x="{x + 47:.1f}" y="{y + 4}">{word}</text>'
            )
            x += 66 + len(word) * _CHARACTER
        yield (
            f'<line class="wait" x1="{x:.1f}" y1="{y}" x2="{x + 28:.1f}" y2="{y}"/>'
            f'<text class="soft" x="{x + 34:.1f}" y="{y + 4}">triggered, not started</text>'
        )
        x += 54 + 22 * _CHARACTER
        yield (
            f'<path class="join" d="M{x + 7:.1f},{y - 7}l7,7l-7,7l-7,-7z"/>'
            f'<text class="soft" x="{x + 20:.1f}" y="{y + 4}">join</text>'
        )


_CLASSES = {Kind.SUCCEEDED: "ok", Kind.FAILED: "bad", Kind.STOPPED: "stop", None: "open"}
_LEGEND = (
    (Kind.SUCCEEDED, "succeeded"),
    (Kind.FAILED, "failed"),
    (Kind.STOPPED, "stopped"),
    (None, "still active"),
)


def _sign(outcome: Kind | None, x: float, y: int) -> str:
    """A check mark, a cross, a square, an arrow: eight units wide."""
    if outcome is Kind.SUCCEEDED:
        form = f"M{x:.1f},{y}l3,4l6,-8"
    elif outcome is Kind.FAILED:
        form = f"M{x:.1f},{y - 4}l8,8m0,-8l-8,8"
    elif outcome is Kind.STOPPED:
        form = f"M{x:.1f},{y - 4}h8v8h-8z"
    else:
        form = f"M{x:.1f},{y - 4}l5,4l-5,4"
    return f'<path class="sign" d="{form}"/>'


def _story(bar: Bar, end_us: int) -> str:
    """A bar in words, as its tooltip."""
    if bar.started_us is None:
        begun = f"triggered at {seconds(bar.triggered_us)} s, not started"
    else:
        begun = f"started at {seconds(bar.started_us)} s"
    if bar.ended_us is None:
        return f"{begun}, still active at {seconds(end_us)} s"
    return f"{begun}, at {seconds(bar.ended_us)} s {bar.summary}"


def _time(at_us: int, step_us: int) -> str:
    for unit_us, name in (
        (86_400_000_000, "d"),
        (3_600_000_000, "h"),
        (60_000_000, "min"),
        (1_000_000, "s"),
        (1_000, "ms"),
        (1, "µs"),
    ):
        if step_us >= unit_us:
            return f"{at_us // unit_us if at_us % unit_us == 0 else at_us / unit_us:g} {name}"
    return f"{at_us} µs"


def _style() -> str:
    light = "".join(f".{name}{{{value}}}\n" for name, value in _LIGHT.items())
    dark = "".join(f".{name}{{{value}}}\n" for name, value in _DARK.items())
    return (
        f"text{{{_FONT};font-size:12px;white-space:pre}}\n"
        ".title{font-size:14px;font-weight:600}\n"
        ".middle{text-anchor:middle}\n.end-here{text-anchor:end}\n"
        f"{light}@media (prefers-color-scheme:dark){{\n{dark}}}\n"
    )
