"""Elements: names, forms of other years and languages, nesting, and the root."""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import (
    escaped,
    indentation,
    line_end,
    removed,
    rename,
    whole_lines,
    without_attribute,
    wrapped,
)
from gpsfsm.model.plan import ControlType
from gpsfsm.syntax.text import is_namespace_declaration, strip
from gpsfsm.syntax.tokens import TextRun

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft, Node


_NAMES = {"plan": "Plan", "control": "Control", "runner": "Runner"}


def _element_names(draft: Draft) -> Iterator[Fix]:
    """Names that are misspelt or have a prefix: one fix per element."""
    for node in draft.outline.nodes.values():
        meant = _meant_name(draft, node)
        edits = list(rename(node, meant)) if meant else []
        if (meant or node.name) in _NAMES.values():
            edits += (
                without_attribute(draft, raw)
                for raw in node.tag.attributes
                if is_namespace_declaration(raw.name)
            )
        if not edits:
            continue
        rule = "GP105"
        if node.parent is None and node.name != "Plan" and draft.wants("GP104"):
            rule = "GP104"
        elif ":" in node.name or not draft.wants("GP105"):
            rule = "GP101"
        title = f"<{node.name[:40]}> changed to <{meant}>" if meant else "namespace removed"
        yield Fix(rule, title, node.start, tuple(edits))


def _meant_name(draft: Draft, node: Node) -> str:
    """The name that an element should have; "" if it has it, or nobody can tell."""
    name = node.name.rpartition(":")[2].lower()[:40]
    if node.name in _NAMES.values():
        return ""
    meant = _NAMES.get(name)
    if meant is None:
        close = get_close_matches(name, _NAMES, n=2, cutoff=0.8)
        # A name that is like two of them means neither for sure.
        meant = _NAMES[close[0]] if len(close) == 1 else None
    if meant == "Runner" and not node.attribute("interface") and not node.attribute("provider"):
        return ""
    if meant == "Plan" and node.parent is not None and draft.plan is not None:
        return ""
    return meant or ""


def _old_elements(draft: Draft) -> Iterator[Fix]:
    """The elements of 2024, ``<Event name=…>`` and ``<Control name=…>``: one fix each."""
    for node in draft.outline.nodes.values():
        label = node.attribute("name")
        if label is None:
            continue
        end = label.start + len(label.name)
        if node.name == "Event" and node.attribute("interface") is None:
            edits = (*rename(node, "Runner"), Edit(label.start, end, "interface"))
            yield Fix("GP105", "<Event name=…> changed to <Runner interface=…>", node.start, edits)
        elif node.name == "Control" and node.attribute("type") is None:
            value = strip(draft.text[label.value_start : label.value_end])
            if value in tuple(ControlType):
                edit = Edit(label.start, end, "type")
                yield Fix("GP107", f'name="{value}" changed to type="{value}"', node.start, (edit,))


_SEQUENCES = frozenset({"sequence", "sequencestar", "reactivesequence"})
_FALLBACKS = frozenset({"fallback", "selector", "reactivefallback"})
_MOVES = frozenset({"movebase", "moveto", "navigatetopose", "gotowaypoint", "goto", "navigate"})
_KEPT = frozenset({"name", "x", "y", "goal", "target", "position", "waypoint", "location"})
_WAYPOINT = "WaypointRunner"


def _tree_words(draft: Draft) -> Iterator[Fix]:
    """The words of behaviour trees that say the same as an element of a plan.

    One fix for all of a text, since the front end names each word once only.
    """
    edits: list[Edit] = []
    at = -1
    for node in draft.outline.nodes.values():
        word = node.name.lower()
        rewritten: tuple[Edit, ...] = ()
        if word in _SEQUENCES:
            rewritten = _control(draft, node)
        elif word in _FALLBACKS:
            rewritten = _fallback(draft, node)
        elif word in _MOVES or word == "action":
            rewritten = _move(draft, node, word)
        if rewritten:
            at = node.start if at < 0 else at
            edits += rewritten
    if edits:
        rule = "GP118" if any(draft.findings("GP118")) else "GP105"
        edits += _identity(draft) if rule == "GP118" else ()
        yield Fix(rule, "behaviour tree elements translated", at, tuple(edits), Safety.UNSAFE)


def _identity(draft: Draft) -> Iterator[Edit]:
    """The ``ID`` of the plan, which only trees have, as its name."""
    (plan,) = draft.outline.roots[:1]
    identity = plan.attribute("ID")
    if identity is not None and plan.attribute("name") is None:
        yield Edit(identity.start, identity.start + len(identity.name), "name")
    elif identity is not None:
        yield without_attribute(draft, identity)


def _control(draft: Draft, node: Node) -> tuple[Edit, ...]:
    """The element as a sequential control; of its attributes only the name stays."""
    start = node.start + 1
    written = Edit(start, start + len(node.name), 'Control type="sequential"')
    others = (raw for raw in node.tag.attributes if raw.name != "name")
    dropped = tuple(without_attribute(draft, raw) for raw in others)
    return (written, *rename(node, "Control")[1:], *dropped)


def _fallback(draft: Draft, node: Node) -> tuple[Edit, ...]:
    """The edits of a fallback: its first child is the goal, the others are its recovery."""
    # Elements that are rewritten themselves cannot be moved by the same fix: later, then.
    if not node.children or any(each.name not in ("Runner", "Control") for each in node.children):
        return ()
    others = node.children[1:]
    recovery = wrapped(draft, others, '<Control type="recovery">') if others else ()
    return (*_control(draft, node), *recovery)


def _move(draft: Draft, node: Node, word: str) -> tuple[Edit, ...]:
    if node.children:
        return ()
    identity = node.attribute("ID") or node.attribute("id")
    if word == "action":
        named = draft.text[identity.value_start : identity.value_end] if identity else ""
        if named.lower().replace("_", "") not in _MOVES:
            return ()
    waypoints = [name for name in draft.library.interface_names if name.endswith("/" + _WAYPOINT)]
    providers = draft.library.providers_of(waypoints[0]) if len(waypoints) == 1 else ()
    others = [raw for raw in node.tag.attributes if raw is not identity]
    if not providers or any(raw.name not in _KEPT for raw in others):
        return ()
    interface, provider = escaped(waypoints[0]), escaped(providers[0].name)
    edits = list(rename(node, "Runner"))
    start = node.start + 1 + len(node.name)
    edits.append(Edit(start, start, f' interface="{interface}" provider="{provider}"'))
    if identity is not None:
        edits.append(without_attribute(draft, identity))
    return tuple(edits)


def _missing_root(draft: Draft) -> Iterator[Fix]:
    """A missing ``<Plan>``: one fix, if every outermost element is a control or a runner."""
    roots = draft.outline.roots
    if not roots or any(root.name not in ("Control", "Runner") for root in roots):
        return
    if any(root.unfinished or not root.tag.closed for root in roots):
        return
    text = draft.text
    start, stop = roots[0].start, roots[-1].stop
    before = indentation(text, start)
    end = line_end(text) if before is not None else ""
    edits = (
        Edit(start, start, f"<Plan>{end}{before or ''}"),
        Edit(stop, stop, f"{end}{before or ''}</Plan>"),
    )
    yield Fix("GP104", "plan wrapped in <Plan>", start, edits)


def _empty_controls(draft: Draft) -> Iterator[Fix]:
    """Empty controls: one fix each, with the controls around it that hold nothing else."""
    for finding in draft.findings("GP109"):
        node = draft.node(draft.offset(finding))
        if node is None or node.name != "Control":
            continue
        start = node.start
        while node.parent is not None and node.parent.parent and len(node.parent.children) == 1:
            node = node.parent
        if not _inside(draft, node):
            edits = (removed(draft, node),)
            yield Fix("GP109", "empty control removed", start, edits, Safety.UNSAFE)


def _inside(draft: Draft, node: Node) -> bool:
    """True if a recovery behind the control would guard something else without it."""
    parent = node.parent
    if parent is None:
        return True
    if _type(draft, node) == ControlType.RECOVERY:
        return False
    following = parent.children[parent.children.index(node) + 1 :][:1]
    return any(_type(draft, each) == ControlType.RECOVERY for each in following)


def _type(draft: Draft, node: Node) -> str:
    raw = node.attribute("type")
    return draft.text[raw.value_start : raw.value_end] if raw else ""


def _runner_content(draft: Draft) -> Iterator[Fix]:
    """One fix per runner with content: close it, so that the content stands behind it."""
    for finding in draft.findings("GP114"):
        at = draft.offset(finding)
        node = next(
            (
                each
                for each in draft.outline.nodes.values()
                if each.name == "Runner" and each.tag.end <= at < each.stop and _innermost(each, at)
            ),
            None,
        )
        if node is None or node.closing is None:
            continue
        yield _closed(draft, node, at)


def _innermost(node: Node, at: int) -> bool:
    return not any(c.name == "Runner" and c.tag.end <= at < c.stop for c in node.children)


def _closed(draft: Draft, node: Node, at: int) -> Fix:
    text, closing = draft.text, node.closing
    assert closing is not None
    end = node.tag.end - 1
    edits = [Edit(end, end, "/")]
    inside = [each for each in draft.tokens if node.tag.end <= each.start < closing.start]
    if not node.children and all(isinstance(each, TextRun) for each in inside):
        edits = [Edit(end, closing.end, "/>")]
        title = "text inside a runner removed"
        return Fix("GP114", title, at, tuple(edits), Safety.UNSAFE)
    edits.append(Edit(*whole_lines(text, closing.start, closing.end)))
    outer = indentation(text, node.start)
    for child in node.children:
        before = indentation(text, child.start)
        if outer is not None and before is not None and len(before) > len(outer):
            edits.append(Edit(child.start - len(before), child.start, outer))
    title = "runner closed, its content moved behind it"
    return Fix("GP114", title, at, tuple(edits), Safety.UNSAFE)


FIXERS = (
    Fixer(
        name="element-names",
        rules=("GP101", "GP104", "GP105"),
        propose=_element_names,
        safe=(
            "corrects `<plan>`, `<Contrl>` or `<x:Runner>`, and removes XML namespaces: there are "
            "only three elements, and each of these names resembles just one of them"
        ),
    ),
    Fixer(
        name="old-elements",
        rules=("GP105", "GP107"),
        propose=_old_elements,
        safe=(
            "rewrites the elements of 2024 in today's form: current executors do not read the old "
            "form, and it has only one meaning"
        ),
    ),
    Fixer(
        name="tree-words",
        rules=("GP105", "GP118"),
        propose=_tree_words,
        unsafe=(
            "rewrites a behaviour tree's `Sequence` as a sequential control, `Fallback` as a step "
            "with a recovery, and `MoveBase` as a waypoint: these mean almost the same"
        ),
    ),
    Fixer(
        name="missing-root",
        rules=("GP104",),
        propose=_missing_root,
        safe=(
            "puts `<Plan>` around controls and runners that have none: nothing else can enclose "
            "them, and a plan runs them one after the other"
        ),
    ),
    Fixer(
        name="empty-controls",
        rules=("GP109",),
        propose=_empty_controls,
        unsafe=(
            "removes an empty control: steps may have been forgotten, and in a parallel_any an "
            "empty unit succeeds at once"
        ),
    ),
    Fixer(
        name="runner-content",
        rules=("GP114",),
        propose=_runner_content,
        unsafe=(
            "closes the runner, so that the elements inside it follow it, and removes text inside "
            "it: elements that never ran will run"
        ),
    ),
)
