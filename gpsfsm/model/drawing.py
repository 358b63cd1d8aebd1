"""Automata and plans as text: Graphviz, Mermaid, a tree, JSON.

Every text that comes from a plan is made printable, clipped and escaped here, so that no plan can
write anything into a picture but labels. The output depends on the plan alone.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gpsfsm.model.automaton import Action, Automaton, Node, NodeKind
from gpsfsm.model.capability import OWN
from gpsfsm.model.event import Event
from gpsfsm.model.graph import SCHEMA
from gpsfsm.model.labels import (
    MAX_LABEL,
    action,
    control_label,
    drawn_nodes,
    is_machine,
    node_label,
    node_name,
    parameters_label,
)
from gpsfsm.model.plan import Element, Kind, Plan
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from gpsfsm.model.automaton import Traits

_MAX_VALUE = 200
"""The longest parameter in a tree, in code points."""

_COLORS = {
    Event.SUCCEEDED: "#1a7f37",
    Event.FAILED: "#cf222e",
    Event.STARTED: "#6e7781",
    Event.STOPPED: "#9a6700",
}
_DOT_STYLES = {
    Event.SUCCEEDED: "solid",
    Event.FAILED: "dashed",
    Event.STARTED: "dotted",
    Event.STOPPED: "dotted",
}
STOPS = " stops"
"""The word behind the event of a connection that stops what it leads to."""
_STOP_COLOR = "#8250df"


# --- what is drawn ------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Open:
    """A control begins: what follows, up to its _Close, is drawn inside it."""

    element: Element


@dataclass(frozen=True, slots=True)
class _Close:
    """The control that was opened last ends."""


@dataclass(frozen=True, slots=True)
class _OpenEnd:
    """An outcome without a connection; it is drawn as an arrow to an open point."""

    node: int
    event: Event


def _parts(automaton: Automaton) -> Iterator[_Open | _Close | Node | _OpenEnd]:
    """Yield controls, nodes and open ends in document order, each node inside its control."""
    if not is_machine(automaton):
        return _parts_of_plan(automaton)
    nodes = drawn_nodes(automaton)
    return (part for node in nodes for part in _with_open_ends(automaton, node))


def _parts_of_plan(automaton: Automaton) -> Iterator[_Open | _Close | Node | _OpenEnd]:
    plan = automaton.plan
    runners: dict[int, list[Node]] = {}
    inner: dict[int, list[Node]] = {}
    for node in automaton.nodes:
        if node.kind is NodeKind.RUNNER:
            runners.setdefault(node.origin, []).append(node)
        elif node.kind is NodeKind.JOIN:
            inner.setdefault(_control_of(plan, node.origin), []).append(node)
    yield automaton.nodes[0]
    for element, entering in _walk(plan):
        if element.kind is Kind.RUNNER:
            for node in runners.get(element.index, ()):
                yield from _with_open_ends(automaton, node)
        elif entering and element.parent >= 0:
            yield _Open(element)
        elif not entering:
            for node in inner.get(element.index, ()):
                yield from _with_open_ends(automaton, node)
            if element.parent >= 0:
                yield _Close()
    yield automaton.nodes[automaton.complete]
    if automaton.traits.gives_up:
        yield automaton.nodes[automaton.give_up]


def _control_of(plan: Plan, element: int) -> int:
    at = plan.elements[element]
    return at.parent if at.kind is Kind.RUNNER else at.index


def _walk(plan: Plan) -> Iterator[tuple[Element, bool]]:
    """Every element when it begins (True), and every control again when it ends (False).

    A stack of our own instead of recursion: plans may nest deeply.
    """
    stack = [(plan.elements[0], True)]
    while stack:
        element, entering = stack.pop()
        yield element, entering
        if entering and element.kind is not Kind.RUNNER:
            stack.append((element, False))
            stack.extend((plan.elements[child], True) for child in reversed(element.children))


def _with_open_ends(automaton: Automaton, node: Node) -> Iterator[Node | _OpenEnd]:
    yield node
    yield from (_OpenEnd(node.index, event) for event in open_events(automaton, node))


def open_events(automaton: Automaton, node: Node) -> Iterator[Event]:
    """The outcomes of a runner or join that lead nowhere."""
    events = _OPEN.get(node.kind, ()) if node.index not in automaton.traits.looping else ()
    for event in events:
        if (node.index, event) not in automaton.specified:
            yield event


_OPEN = {
    NodeKind.RUNNER: (Event.SUCCEEDED, Event.FAILED),
    NodeKind.JOIN: (Event.SUCCEEDED,),
}


# --- Graphviz -----------------------------------------------------------------------------------

_DOT_HEAD = """\
digraph plan {
  graph [compound=true, fontname="Helvetica", fontsize=10, rankdir=TB];
  node [fontname="Helvetica", fontsize=10];
  edge [fontname="Helvetica", fontsize=8];
"""
_DOT_SHAPES = {
    NodeKind.START: 'shape=oval, style=filled, fillcolor="#eaeef2"',
    NodeKind.RUNNER: "shape=box, style=rounded",
    NodeKind.JOIN: "shape=circle, width=0.4, margin=0.02, fontsize=8",
    NodeKind.COMPLETE: f'shape=oval, peripheries=2, color="{_COLORS[Event.SUCCEEDED]}"',
    NodeKind.GIVE_UP: f'shape=oval, peripheries=2, color="{_COLORS[Event.FAILED]}"',
}


def automaton_to_dot(automaton: Automaton) -> str:
    """Draw the automaton in Graphviz' language, one cluster per control.

    An outcome without a connection ends in an open point.
    """
    lines: list[str] = []
    depth = 1
    for part in _parts(automaton):
        pad = "  " * depth
        if isinstance(part, _Open):
            lines.append(f"{pad}subgraph cluster_{part.element.index} {{")
            depth += 1
            label = _dot_quote([control_label(part.element)])
            lines.append(f'{"  " * depth}label={label}; style=rounded; color="#8c959f";')
        elif isinstance(part, _Close):
            depth -= 1
            lines.append("  " * depth + "}")
        elif isinstance(part, _OpenEnd):
            point = _open_name(part)
            lines.append(f'{pad}{point} [shape=circle, label="", width=0.1, fixedsize=true];')
        else:
            label = _dot_quote(node_label(automaton, part))
            lines.append(f"{pad}n{part.index} [label={label}, {_DOT_SHAPES[part.kind]}];")
    for source, event, target, remark in _connections(automaton):
        color, look = _COLORS[event], f"style={_DOT_STYLES[event]}"
        if remark == STOPS:
            color, look = _STOP_COLOR, "style=dashed, arrowhead=tee"
        style = f'color="{color}", fontcolor="{color}", {look}'
        lines.append(f'  {source} -> {target} [label="{event.value}{remark}", {style}];')
    return _DOT_HEAD + "\n".join(lines) + "\n}\n"


def _connections(automaton: Automaton) -> Iterator[tuple[str, Event, str, str]]:
    """All arrows between the names of what is drawn: connections, then open ends.

    Behind the event stands what an engine makes of it, if there is anything to say.
    """
    for source, event, target in automaton.edges:
        yield f"n{source}", event, f"n{target}", _remark(automaton, source, event)
    for source, event, target in automaton.stops:
        yield f"n{source}", event, f"n{target}", STOPS
    for join in sorted(automaton.traits.looping):
        yield f"n{join}", Event.SUCCEEDED, f"n{join}", ": ABORT"
    for node in automaton.nodes:
        if node.kind in (NodeKind.RUNNER, NodeKind.JOIN):
            for part in _with_open_ends(automaton, node):
                if isinstance(part, _OpenEnd):
                    remark = "" if automaton.traits.gives_up else ": nothing"
                    yield f"n{part.node}", part.event, _open_name(part), remark


def _remark(automaton: Automaton, source: int, event: Event) -> str:
    if automaton.nodes[source].kind is NodeKind.JOIN:
        never = event is not Event.SUCCEEDED
    else:
        never = event is Event.STARTED and source in automaton.traits.silent
    return ": never" if never else ""


def _open_name(end: _OpenEnd) -> str:
    return f"open{end.node}_{end.event.value}"


def _dot_quote(lines: Iterable[str]) -> str:
    r"""Quote a label; Graphviz reads ``\x`` escapes and HTML entities in labels."""
    text = "\\n".join(
        line.replace("\\", "\\\\").replace('"', '\\"').replace("&", "&amp;") for line in lines
    )
    return f'"{text}"'


# --- Mermaid ------------------------------------------------------------------------------------

_MERMAID_SHAPES = {
    NodeKind.START: ("([", "])"),
    NodeKind.RUNNER: ("[", "]"),
    NodeKind.JOIN: ("((", "))"),
    NodeKind.COMPLETE: ("([", "])"),
    NodeKind.GIVE_UP: ("([", "])"),
}
_MERMAID_ARROWS = {
    Event.SUCCEEDED: "-->",
    Event.FAILED: "-.->",
    Event.STARTED: "-.->",
    Event.STOPPED: "-.->",
}
_MERMAID_PLAIN = frozenset(" .,=/_:()+-…“”")


def automaton_to_mermaid(automaton: Automaton, marks: Mapping[int, str] | None = None) -> str:
    """Draw the automaton as a Mermaid flowchart, one subgraph per control.

    ``marks`` are words for some elements, by index: they are written to their runners and controls,
    which are drawn with a thick border.
    """
    marks = marks or {}
    marked: list[str] = []
    lines = ["flowchart TD"]
    depth = 1
    open_ends: list[str] = []
    for part in _parts(automaton):
        pad = "  " * depth
        if isinstance(part, _Open):
            words = [control_label(part.element), *_marked(marks, part.element.index)]
            if len(words) > 1:
                marked.append(f"c{part.element.index}")
            label = _mermaid_quote([": ".join(words)])
            lines.append(f"{pad}subgraph c{part.element.index} [{label}]")
            depth += 1
        elif isinstance(part, _Close):
            depth -= 1
            lines.append("  " * depth + "end")
        elif isinstance(part, _OpenEnd):
            open_ends.append(_open_name(part))
            lines.append(f'{pad}{open_ends[-1]}((" "))')
        else:
            before, after = _MERMAID_SHAPES[part.kind]
            remarks = _marked(marks, part.origin) if part.kind is NodeKind.RUNNER else []
            if remarks:
                marked.append(f"n{part.index}")
            label = _mermaid_quote([*node_label(automaton, part), *remarks])
            lines.append(f"{pad}n{part.index}{before}{label}{after}")
    drawn: dict[str, list[int]] = {}
    for number, (source, event, target, remark) in enumerate(_connections(automaton)):
        stops = remark == STOPS
        drawn.setdefault(_STOP_COLOR if stops else _COLORS[event], []).append(number)
        arrow = "-.-x" if stops else _MERMAID_ARROWS[event]
        lines.append(f"  {source} {arrow}|{event.value}{remark}| {target}")
    lines += _mermaid_styles(automaton, drawn, {"open": open_ends, "found": marked})
    return "\n".join(lines) + "\n"


_MERMAID_CLASSES = {
    "open": "fill:none,stroke:#6e7781",
    "found": f"stroke:{_COLORS[Event.FAILED]},stroke-width:3px",
}


def _mermaid_styles(
    automaton: Automaton, drawn: Mapping[str, list[int]], classes: Mapping[str, list[str]]
) -> Iterator[str]:
    for color in (*(_COLORS[event] for event in Event), _STOP_COLOR):
        if color in drawn:
            yield f"  linkStyle {','.join(map(str, drawn[color]))} stroke:{color}"
    machine = is_machine(automaton)
    for end, event in ((automaton.complete, Event.SUCCEEDED), (automaton.give_up, Event.FAILED)):
        hidden = end == automaton.give_up and not automaton.traits.gives_up
        if not hidden and not (machine and not automaton.inputs[end]):
            yield f"  style n{end} stroke:{_COLORS[event]}"
    for name, members in classes.items():
        if members:
            yield f"  classDef {name} {_MERMAID_CLASSES[name]}"
            yield f"  class {','.join(members)} {name}"


def _marked(marks: Mapping[int, str], element: int) -> list[str]:
    return [clip(marks[element], MAX_LABEL)] if element in marks else []


def _mermaid_quote(lines: Iterable[str]) -> str:
    """Quote a label; what Mermaid or HTML could read as more than text becomes ``#code;``."""
    escaped = ("".join(map(_mermaid_character, line)) for line in lines)
    return '"' + "<br/>".join(escaped) + '"'


def _mermaid_character(character: str) -> str:
    if character in _MERMAID_PLAIN or character.isalnum() or ord(character) > 0x7F:
        return character
    return f"#{ord(character)};"


# --- tree ---------------------------------------------------------------------------------------


def plan_to_tree(plan: Plan) -> str:
    """Draw the plan as an indented tree, each element behind its line number.

    A runner shows its interface, its parameters and labels, and in parentheses its provider.
    """
    dropped = plan.dropped_completion
    last_line = max(element.line for element in plan.elements)
    width = len(str(max(last_line, dropped.line if dropped else 0)))
    lines: list[str] = []
    rails: list[str] = []  # for each open control the rail that its children continue
    for element, entering in _walk(plan):
        if not entering:
            rails.pop()
            continue
        branch = _branch(plan, element)
        label = _row_label(plan, element) + _file_note(plan, element)
        lines.append(f"{element.line:>{width}}  {''.join(rails)}{branch}{label}")
        if element.kind is not Kind.RUNNER:
            rails.append(_RAILS[branch])
    if dropped is not None:
        label = f"{clip(dropped.interface, _MAX_VALUE)} (left out: completion is implied)"
        lines.append(f"{dropped.line:>{width}}  {label}")
    return "\n".join(line.rstrip() for line in lines) + "\n"


_RAILS = {"": "", "├── ": "│   ", "└── ": "    "}


def _branch(plan: Plan, element: Element) -> str:
    if element.parent < 0:
        return ""
    last = plan.elements[element.parent].children[-1] == element.index
    return "└── " if last else "├── "


def _file_note(plan: Plan, element: Element) -> str:
    """The file of an element, where it is another than that of what is around it."""
    around = plan.elements[element.parent].file if element.parent >= 0 else ""
    if element.file == around:
        return ""
    return f" [{clip(element.file or plan.file, _MAX_VALUE)}]"


def _row_label(plan: Plan, element: Element) -> str:
    """The label of an element; choices and ticks, which nobody has written, have words."""
    if element.interface in OWN:
        return clip(action(element), _MAX_VALUE)
    return _tree_label(element, whole=plan.vocabulary.terms.whole)


def _tree_label(element: Element, *, named: bool = True, whole: str = "plan") -> str:
    if element.kind is Kind.RUNNER:
        words = [clip(element.interface, _MAX_VALUE) or "(no interface)"]
        words += parameters_label(element, _MAX_VALUE, named=named)
        if element.provider and element.provider != element.interface:
            words.append(f"({clip(element.provider, _MAX_VALUE)})")
        return " ".join(words)
    name = element.text("name")
    words = [element.words if element.kind is Kind.CONTROL else element.tag or whole]
    return " ".join([*words, f"“{clip(name, _MAX_VALUE)}”"] if name else words)


def machine_to_text(automaton: Automaton) -> str:
    """List a machine, which is no tree: its nodes as they are written, each with its events."""
    leading: dict[int, list[str]] = {}
    for edges, word in ((automaton.edges, ""), (automaton.stops, STOPS)):
        for source, event, target in edges:
            name = clip(node_name(automaton, automaton.nodes[target]), _MAX_VALUE)
            leading.setdefault(source, []).append(f"{event.value}{word} → {name}")
    plan = automaton.plan
    nodes = sorted(drawn_nodes(automaton), key=lambda node: plan.elements[node.origin].spot)
    width = len(str(max(plan.elements[node.origin].line for node in nodes)))
    lines: list[str] = []
    for node in nodes:
        element = plan.elements[node.origin]
        label = _machine_label(automaton, node) + _file_note(plan, element)
        lines.append(f"{element.line:>{width}}  {label}")
        rows = leading.get(node.index, [])
        rows += [f"{event.value} → nothing" for event in open_events(automaton, node)]
        for number, row in enumerate(rows, 1):
            branch = "└── " if number == len(rows) else "├── "
            lines.append(f"{'':>{width}}  {branch}{row}")
    return "\n".join(lines) + "\n"


def _machine_label(automaton: Automaton, node: Node) -> str:
    name = clip(node_name(automaton, node), _MAX_VALUE)
    if node.kind is NodeKind.RUNNER:
        return f"{name}: {_tree_label(automaton.plan.elements[node.origin], named=False)}"
    if node.kind is NodeKind.JOIN:
        return f"{name} (join, {node.need} of {len(automaton.inputs[node.index])})"
    return f"{name} ({node.kind.value})"


def automaton_to_json(automaton: Automaton) -> str:
    """Write the graph of the automaton as JSON: ``nodes`` and ``edges``, one per line.

    They stand in order of creation, with the attributes of docs/machines.md.

    For an engine there is also ``engine``, which tells its traits.
    """
    rows: list[dict[str, Any]] = []
    for index, attributes in automaton.graph.nodes(data=True):
        row = {"index": index, **attributes}
        if "parameters" in row:
            row["parameters"] = {key: _json_value(each) for key, each in row["parameters"].items()}
        rows.append(row)
    nodes = ",\n".join("  " + json.dumps(row) for row in rows)
    rows = [
        {"source": source, "event": event.value, "target": target}
        for source, event, target in automaton.edges
    ]
    rows += [
        {"source": source, "event": event.value, "target": target, "action": Action.STOP.value}
        for source, event, target in automaton.stops
    ]
    edges = ",\n".join("  " + json.dumps(row) for row in rows)
    traits = "" if automaton.traits.gives_up else f',\n "engine": {_engine(automaton.traits)}'
    return (
        f'{{\n "version": {SCHEMA},\n "nodes": [\n{nodes}\n ],\n "edges": [\n{edges}\n ],\n'
        f' "complete": {automaton.complete},\n "give_up": {automaton.give_up}{traits}\n}}\n'
    )


def _engine(traits: Traits) -> str:
    """The traits of an engine at run time; the lists hold indices of nodes."""
    return json.dumps(
        {
            "name": traits.engine,
            "silent": sorted(traits.silent),
            "breaking": sorted(traits.breaking),
            "looping": sorted(traits.looping),
        }
    )


def _json_value(value: object) -> object:
    """JSON has no infinity and no NaN: they are written as text."""
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value
