"""An automaton as a picture in SVG that needs nothing but itself.

It follows the reader's choice of light or dark. Events differ in colour, in the dashes of their
lines and in their words, so that it can be read without colours. All text is escaped and clipped.
The style sheet stands at the end: its colours are custom properties, which a page may set anew.
"""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.drawing import STOPS
from gpsfsm.model.event import Event
from gpsfsm.model.labels import control_label, is_machine, node_label
from gpsfsm.picture.cells import failing_joins
from gpsfsm.picture.layout import FlatEdge, Group, Layout, draws_stops, flat_layout, layout
from gpsfsm.picture.routing import Merging, Point, Router, dangling, event_port
from gpsfsm.picture.shapes import LINE, Box, node_lines, text_width

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from gpsfsm.model.automaton import Automaton, Node

_CORNER = 6.0
_LEAST = 8.0
"""The room left of a flag."""
_END = 4.0
_CAPTION = 11 / 12
"""The size of the letters of a caption by that of others."""
_NOTE, _NOTE_GAP = 24.0, 8.0
"""The height of the note below a picture, and the room around it."""
_WORDS = {
    Event.SUCCEEDED: "ok",
    Event.FAILED: "bad",
    Event.STARTED: "begun",
    Event.STOPPED: "halted",
}
_ARROWS = ("ok", "bad", "begun", "halted")


def automaton_to_svg(
    automaton: Automaton, marks: Mapping[int, str] | None = None, *, all_stops: bool = False
) -> str:
    """Draw an automaton; the same bytes for the same plan.

    ``marks`` are remarks by node, such as the rule of a finding: the node gets a ring and the text.
    Connections of a machine that stop their target are left out where they are many,
    except with ``all_stops``: a note below the picture counts them, and the tooltip of each node
    lists its own.
    """
    return "\n".join(_Drawing(automaton, marks or {}, all_stops=all_stops).lines()) + "\n"


class _Drawing:
    def __init__(self, automaton: Automaton, marks: Mapping[int, str], *, all_stops: bool) -> None:
        self.automaton = automaton
        self.marks = marks
        self.stops = all_stops or draws_stops(automaton)
        self.flat = flat_layout(automaton, stops=self.stops) if is_machine(automaton) else None
        self.layout: Layout = self.flat.layout if self.flat else layout(automaton)
        self.hidden_stops = {} if self.stops else _stop_words(automaton)
        self.failing = failing_joins(automaton)
        self.stub = 42.0 if automaton.traits.gives_up else 82.0  # as long as what is written

    def lines(self) -> Iterator[str]:
        least = min((flag.x for _, flag, _ in self._flags()), default=_LEAST) - _LEAST
        size_x, size_y = self.layout.size
        left = min(0.0, least)  # flags may need room on the left
        note = "" if self.stops else _left_out(len(self.automaton.stops))
        width = _number(max(size_x - left, text_width(note) + 2 * _NOTE_GAP if note else 0.0))
        height = _number(size_y + (_NOTE if note else 0.0))
        runners = len(self.automaton.runners)
        whole = self.automaton.plan.vocabulary.terms.whole if self.flat else "plan"
        title = (
            f"{runners} runner{'s' if runners != 1 else ''} in a {whole}, and what leads to what"
        )
        yield (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
            f'viewBox="{_number(left)} 0 {width} {height}" role="img" class="gpsfsm-picture">'
        )
        yield f"<title>{title}</title>"
        more = (_MACHINE_STYLE if self.flat else "") + (_MARK_STYLE if self.marks else "")
        yield f"<style>{STYLE}{more}</style>"
        yield "<defs>"
        for name in _ARROWS:
            yield (
                f'<marker id="gpsfsm-{name}" viewBox="0 0 10 10" refX="9" refY="5" '
                f'markerWidth="7" markerHeight="7" orient="auto"><path class="head {name}" '
                'd="M0 1L10 5L0 9z"/></marker>'
            )
        if self.flat and self.stops:
            yield _BAR
        yield "</defs>"
        place = f'x="{_number(left)}" ' if left else ""
        yield f'<rect class="background" {place}width="{width}" height="{height}"/>'
        for group in self.layout.groups:
            yield self._border(group)
        yield from self._edges() if self.flat is None else self._connections(self.flat.edges)
        for group in self.layout.groups:
            yield self._caption(group)
        for node in self.automaton.nodes:
            if self.layout.nodes[node.index].width:
                yield from self._node(node)
        yield from self._marks()
        if note:
            place = f'x="{_number(left + _NOTE_GAP)}" y="{_number(size_y + _NOTE_GAP)}"'
            yield f'<text class="note" {place}>{_text(note)}</text>'
        yield "</svg>"

    # -- controls and nodes ----------------------------------------------------------------------

    def _border(self, group: Group) -> str:
        return f'<rect class="group g{group.depth % 2}" {_corners(group.box)} rx="8"/>'

    def _caption(self, group: Group) -> str:
        element = self.automaton.plan.elements[group.element]
        return (
            f'<g>{_title(control_label(element))}<text class="caption" '
            f'x="{_number(_caption_at(group))}" y="{_number(group.box.y + 17)}">'
            f"{_text(group.label)}</text></g>"
        )

    def _node(self, node: Node) -> Iterator[str]:
        box = self.layout.nodes[node.index]
        yield f'<g class="{node.kind.value}">{_title(self._tooltip(node))}'
        if node.kind is NodeKind.JOIN:
            x, y = map(_number, box.middle)
            polarity = "bad" if node.index in self.failing else "ok"
            radius = box.width / 2
            yield f'<circle class="join {polarity}" cx="{x}" cy="{y}" r="{_number(radius)}"/>'
        else:
            radius = 6.0 if node.kind is NodeKind.RUNNER else box.height / 2
            yield f'<rect class="node" {_corners(box)} rx="{_number(radius)}"/>'
            if node.kind in (NodeKind.COMPLETE, NodeKind.GIVE_UP):
                inner = Box(box.x + 3, box.y + 3, box.width - 6, box.height - 6)
                yield f'<rect class="node" {_corners(inner)} rx="{_number(inner.height / 2)}"/>'
        yield from self._lines(node, box)
        yield "</g>"

    def _flags(self) -> Iterator[tuple[Box, Box, str]]:
        """For each mark the ring around its node, the flag left of it, and the remark on that."""
        for index, remark in self.marks.items():
            x, y, width, height = self.layout.nodes[index]
            ring = Box(x - 4, y - 4, width + 8, height + 8)
            wide = text_width(remark) * 1.15 + 16  # it is bold
            yield ring, Box(ring.x - wide - 4, ring.middle[1] - 10, wide, 20), remark

    def _marks(self) -> Iterator[str]:
        for ring, flag, remark in self._flags():
            radius = _number(8 if ring.width > ring.height else ring.height / 2)
            x, y = map(_number, flag.middle)
            yield f'<rect class="ring" {_corners(ring)} rx="{radius}"/>'
            yield f'<rect class="flag" {_corners(flag)} rx="4"/>'
            yield f'<text class="remark" x="{x}" y="{y}" dy="4">{_text(remark)}</text>'

    def _lines(self, node: Node, box: Box) -> Iterator[str]:
        lines = node_lines(self.automaton, node)
        step = LINE * 0.85 if node.kind is NodeKind.JOIN else LINE
        x, middle = box.middle
        first = middle - step * (len(lines) - 1) / 2 + 4
        for number, line in enumerate(lines):
            kind = "name" if number == 0 else "detail"
            y = _number(first + number * step)
            yield f'<text class="{kind}" x="{_number(x)}" y="{y}">{_text(line)}</text>'

    def _tooltip(self, node: Node) -> str:
        """The text that a browser shows when the pointer rests on a node."""
        words = [*node_label(self.automaton, node)]
        if node.kind is NodeKind.RUNNER:
            words.append(self.automaton.name(node.index))
        return " · ".join([*words, *self.hidden_stops.get(node.index, ())])

    # -- edges -----------------------------------------------------------------------------------

    def _edges(self) -> Iterator[str]:
        router = Router(self.layout, self.failing)
        merging = Merging()
        for source, event, target in self.automaton.edges:
            if self.layout.nodes[target].width:
                kind = self._kind(source, event)
                points, merged = merging.cut((target, kind), router.route(source, event, target))
                if len(points) > 1:
                    yield self._line(points, kind, _WORDS[event], head=not merged)
                if merged:
                    x, y = map(_number, points[-1])
                    yield f'<circle class="dot {kind}" cx="{x}" cy="{y}" r="2.2"/>'
        for node in self.automaton.nodes:
            if node.kind in (NodeKind.RUNNER, NodeKind.JOIN):
                yield from self._signals(node)

    def _connections(self, edges: Sequence[FlatEdge]) -> Iterator[str]:
        """The connections of a machine, each once, and then the names of their events."""
        names: dict[Point, str] = {}
        for edge in edges:
            kind = "stop" if edge.stops else self._kind(edge.source, edge.event)
            yield self._line(edge.route, kind, _WORDS[edge.event], head=edge.target >= 0)
            if edge.target < 0:
                x, y = map(_number, edge.route[-1])
                yield f'<circle class="open {kind}" cx="{x}" cy="{y}" r="{_number(_END)}"/>'
            if edge.named:
                place = f'x="{_number(edge.named[0])}" y="{_number(edge.named[1] + 3)}"'
                names[edge.named] = f'<text class="event named {kind}" {place}>{edge.name}</text>'
        yield from names.values()

    def _kind(self, source: int, event: Event) -> str:
        """The kind of signal that an edge carries: from a join of failures, a failure."""
        return "bad" if source in self.failing else _WORDS[event]

    def _line(self, points: Sequence[Point], kind: str, word: str, *, head: bool = True) -> str:
        end = f' marker-end="url(#gpsfsm-{kind})"' if head else ""
        return f'<path class="edge {kind} is-{word}" d="{_path(points)}"{end}/>'

    def _signals(self, node: Node) -> Iterator[str]:
        """The names of a node's events, and those that lead nowhere."""
        automaton = self.automaton
        looping = node.index in automaton.traits.looping
        if looping:
            yield from self._loop(node.index)
        for event in Event:
            specified = (node.index, event) in automaton.outputs
            expected = event is Event.SUCCEEDED or (
                event is Event.FAILED and node.kind is NodeKind.RUNNER
            )
            if not specified and expected and not looping:
                points = dangling(self.layout, node.index, event, self.stub)
                kind = self._kind(node.index, event)
                yield self._line(points, kind, _WORDS[event], head=False)
                x, y = map(_number, points[-1])
                yield f'<circle class="open {kind}" cx="{x}" cy="{y}" r="{_number(_END)}"/>'
            # A join and start have one event only, and need not name it.
            named = node.kind is NodeKind.RUNNER or event is not Event.SUCCEEDED
            if named and (specified or expected):
                yield self._event(node, event, specified=specified)

    def _event(self, node: Node, event: Event, *, specified: bool) -> str:
        join = node.kind is NodeKind.JOIN
        x, y = event_port(self.layout, node.index, event, is_round=join)
        x, y = (x + 5, y + 14) if event is Event.SUCCEEDED else (x + 4, y - 4)
        remark = ""
        if not specified and not self.automaton.traits.gives_up:
            remark = ": nothing"
        elif join or (event is Event.STARTED and node.index in self.automaton.traits.silent):
            remark = ": never"
        return (
            f'<text class="event {_WORDS[event]}" x="{_number(x)}" y="{_number(y)}">'
            f"{event.value}{remark}</text>"
        )

    def _loop(self, node: int) -> Iterator[str]:
        """A join that is wired to itself."""
        box = self.layout.nodes[node]
        x, y, radius = box.x, box.middle[1], box.width / 2
        top, into = box.y - 8, x + radius * 0.4
        points = [(x, y), (x - 14, y), (x - 14, top), (into, top), (into, box.y + radius * 0.2)]
        yield self._line(points, "ok", "ok")
        place = f'x="{_number(x - 18)}" y="{_number(y - 8)}"'
        yield f'<text class="event loop bad" {place}>ABORT</text>'


_BAR = (
    '<marker id="gpsfsm-stop" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="10" '
    'markerHeight="10" orient="auto"><path class="head stop" d="M6 0L9 0L9 10L6 10z"/></marker>'
)
"""The end of a connection that stops what it leads to."""


def _caption_at(group: Group) -> float:
    """The left end of a caption: behind the line into its group where that would cross it.

    It stays at the left border if there is no room for it behind the line. A recovery is entered
    from its side.
    """
    start, wide = group.box.x + 10, text_width(group.label) * _CAPTION
    above = not group.label.startswith("recovery")
    crossed = above and start - _LEAST < group.spine < start + wide
    behind = group.spine + _LEAST
    return behind if crossed and behind + wide < group.box.right else start


_MOST_NAMES = 8
"""Names of stopped nodes in a tooltip."""


def _stop_words(automaton: Automaton) -> dict[int, list[str]]:
    """Per node what its events stop: ``FAILED stops DriveOn, Look and 3 more``."""
    targets: dict[tuple[int, Event], list[int]] = {}
    for source, event, target in automaton.stops:
        targets.setdefault((source, event), []).append(target)
    words: dict[int, list[str]] = {}
    for (source, event), ends in targets.items():
        names = [node_label(automaton, automaton.nodes[end])[0] for end in ends[:_MOST_NAMES]]
        more = f" and {len(ends) - _MOST_NAMES} more" if len(ends) > _MOST_NAMES else ""
        words.setdefault(source, []).append(f"{event.value}{STOPS} {', '.join(names)}{more}")
    return words


def _left_out(stops: int) -> str:
    """The note below a picture without the connections that stop a node."""
    return f"Not drawn: {stops:,} connections that stop a node."


def _path(points: Sequence[Point]) -> str:
    """A line with round corners."""
    parts = [f"M{_number(points[0][0])} {_number(points[0][1])}"]
    for before, corner, after in zip(points, points[1:], points[2:], strict=False):
        radius = min(_CORNER, _distance(before, corner) / 2, _distance(corner, after) / 2)
        one, other = _toward(corner, before, radius), _toward(corner, after, radius)
        parts.append(f"L{_pair(one)}Q{_pair(corner)} {_pair(other)}")
    parts.append(f"L{_pair(points[-1])}")
    return "".join(parts)


def _distance(one: Point, other: Point) -> float:
    return abs(one[0] - other[0]) + abs(one[1] - other[1])


def _toward(point: Point, other: Point, length: float) -> Point:
    whole = _distance(point, other) or 1.0
    share = length / whole
    return (
        point[0] + (other[0] - point[0]) * share,
        point[1] + (other[1] - point[1]) * share,
    )


def _pair(point: Point) -> str:
    return f"{_number(point[0])} {_number(point[1])}"


def _number(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0")


def _corners(box: Box) -> str:
    x, y, width, height = map(_number, box)
    return f'x="{x}" y="{y}" width="{width}" height="{height}"'


def _title(text: str) -> str:
    return f"<title>{_text(text)}</title>"


def _text(text: str) -> str:
    """Text that is printable already; what XML has no way to say cannot be in it."""
    return escape(text, quote=False)


_FONT = "ui-sans-serif,system-ui,'DejaVu Sans',Helvetica,Arial,sans-serif"

_LIGHT = {
    "paper": "#ffffff",
    "text": "#1f2328",
    "soft": "#59636e",
    "line": "#8c959f",
    "node": "#ffffff",
    "even": "#f6f8fa",
    "odd": "#ffffff",
    "border": "#d1d9e0",
    "ok": "#1a7f37",
    "bad": "#cf222e",
    "begun": "#6e7781",
    "halted": "#9a6700",
    "good-end": "#dafbe1",
    "bad-end": "#ffebe9",
}
_DARK = {
    "paper": "#0d1117",
    "text": "#f0f6fc",
    "soft": "#9198a1",
    "line": "#656c76",
    "node": "#151b23",
    "even": "#131922",
    "odd": "#0d1117",
    "border": "#30363d",
    "ok": "#3fb950",
    "bad": "#ff7b72",
    "begun": "#9198a1",
    "halted": "#d29922",
    "good-end": "#12261e",
    "bad-end": "#2d1115",
}

_RULES = f"""\
.gpsfsm-picture{{font:12px {_FONT}}}
.gpsfsm-picture .background{{fill:var(--paper)}}
.gpsfsm-picture text{{fill:var(--text);paint-order:stroke;stroke-linejoin:round}}
.gpsfsm-picture .name,.gpsfsm-picture .detail{{text-anchor:middle}}
.gpsfsm-picture .name{{font-weight:600}}
.gpsfsm-picture .detail{{fill:var(--soft)}}
.gpsfsm-picture .join .name,.gpsfsm-picture .join .detail{{font-size:10px;font-weight:400}}
.gpsfsm-picture .caption{{fill:var(--soft);font-size:11px;stroke:var(--paper);stroke-width:3px}}
.gpsfsm-picture .group{{stroke:var(--border);stroke-width:1}}
.gpsfsm-picture .g0{{fill:var(--even)}}
.gpsfsm-picture .g1{{fill:var(--odd)}}
.gpsfsm-picture .node{{fill:var(--node);stroke:var(--line);stroke-width:1.25}}
.gpsfsm-picture .start .node{{fill:var(--even)}}
.gpsfsm-picture .complete .node{{fill:var(--good-end);stroke:var(--ok)}}
.gpsfsm-picture .give_up .node{{fill:var(--bad-end);stroke:var(--bad)}}
.gpsfsm-picture circle.join{{fill:var(--node);stroke-width:1.5}}
.gpsfsm-picture .edge{{fill:none;stroke-width:1.5}}
.gpsfsm-picture .is-bad{{stroke-dasharray:6 3}}
.gpsfsm-picture .is-begun{{stroke-dasharray:1.5 3}}
.gpsfsm-picture .is-halted{{stroke-dasharray:1.5 3}}
.gpsfsm-picture .open{{fill:var(--paper);stroke-width:1.5}}
.gpsfsm-picture .loop{{text-anchor:end}}
.gpsfsm-picture .event{{font-size:9px;stroke:var(--paper);stroke-width:2.5px}}"""


def _variables(colours: dict[str, str]) -> str:
    properties = "".join(f"--{name}:{value};" for name, value in colours.items())
    return f".gpsfsm-picture{{{properties}}}"


def _kinds(kinds: Sequence[str] = _ARROWS) -> str:
    return "\n".join(
        f".gpsfsm-picture .edge.{kind},.gpsfsm-picture .join.{kind},.gpsfsm-picture .open.{kind}"
        f"{{stroke:var(--{kind})}}\n"
        f".gpsfsm-picture .event.{kind},.gpsfsm-picture .head.{kind},"
        f".gpsfsm-picture .dot.{kind}{{fill:var(--{kind})}}"
        for kind in kinds
    )


STYLE = "\n".join(
    (
        "",
        _variables(_LIGHT),
        f"@media (prefers-color-scheme:dark){{{_variables(_DARK)}}}",
        _RULES,
        _kinds(),
        "",
    )
)
"""Custom properties hold the colours, so that a page that embeds a picture may set its own."""

_MACHINE_STYLE = "\n".join(
    (
        _variables({"stop": "#8250df"}),
        f"@media (prefers-color-scheme:dark){{{_variables({'stop': '#ab7df8'})}}}",
        ".gpsfsm-picture .edge.stop{stroke-dasharray:8 2 2 2}",
        ".gpsfsm-picture .named{text-anchor:middle}",
        ".gpsfsm-picture .note{fill:var(--soft);font-size:11px}",
        _kinds(("stop",)),
        "",
    )
)
"""What only pictures of machines have: connections that stop."""

_MARK_DARK = _variables({"mark": "#f0883e", "on-mark": "#0d1117"})
_MARK_STYLE = "\n".join(
    (
        _variables({"mark": "#bc4c00", "on-mark": "#ffffff"}),
        f"@media (prefers-color-scheme:dark){{{_MARK_DARK}}}",
        ".gpsfsm-picture .ring{fill:none;stroke:var(--mark);stroke-width:3}",
        ".gpsfsm-picture .flag{fill:var(--mark)}",
        ".gpsfsm-picture .remark{fill:var(--on-mark);font-weight:600;text-anchor:middle}",
        "",
    )
)
"""What only pictures with marks have."""
