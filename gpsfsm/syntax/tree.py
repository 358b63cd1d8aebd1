"""From tokens to the plan tree: nesting, places, stray text, and what may stand where."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.late import pattern
from gpsfsm.model.finding import Related
from gpsfsm.model.plan import ControlType, Element, Kind, Plan, sharing_lines
from gpsfsm.syntax.elements import (
    ElementRules,
    Namespaces,
    behavior_tree,
    behavior_tree_hint,
    behavior_tree_root,
    is_completion,
    unknown_element,
)
from gpsfsm.syntax.scan import spaced_tag_hint
from gpsfsm.syntax.text import SPACED_TAG, WHITE, clip, strip
from gpsfsm.syntax.token_reader import Frame, Inside, TokenReader
from gpsfsm.syntax.tokens import Fault, StartTag, TextRun
from gpsfsm.syntax.values import decode

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.model.plan import Attribute, Location
    from gpsfsm.syntax.source import Limits
    from gpsfsm.syntax.token_reader import Collector
    from gpsfsm.syntax.tokens import EndTag, StartTag, TextRun, Token

_KINDS = {kind.value: kind for kind in Kind}
OF_PLANS = pattern(r"(?:<|&lt;)\s*/?\s*(?:[\w.-]+:)?(?:plan|control|runner|behaviou?r_?tree)", re.I)
"""What looks like a part of a plan; a text without any of it may be anything."""

_RESPONSE = "if this is a model's answer, check it with --from-response"


class Record(NamedTuple):
    """An element of the plan, before its children are known."""

    kind: Kind
    parent: int
    ordinal: int
    attributes: tuple[Attribute, ...]
    line: int
    column: int
    start: int
    end: int
    control_type: ControlType | None


class TreeBuilder(TokenReader):
    """Takes tokens in order; afterwards ``plan`` is the plan, if there is one."""

    noun = "plan"
    declares_namespaces = True

    def __init__(self, text: str, file: str, limits: Limits, collector: Collector) -> None:
        super().__init__(text, limits, collector)
        self.file = file
        self._rules = ElementRules(collector)
        self._strays = Strays(text, collector)
        self._namespaces = Namespaces(collector)
        self._root: StartTag | None = None
        self._with_id: StartTag | None = None
        self._inner_plan = -1
        self._early: list[EndTag] = []
        self._count = 0
        self._records: list[Record] = []
        self._children: dict[int, list[int]] = {}
        self._last_child = -1

    def build(self, tokens: Iterable[Token]) -> Plan | None:
        """Read all tokens; the plan, or None."""
        self._take(tokens)
        in_plan = self._root is not None and self._root.name == "Plan"
        of_tree = in_plan and self._strays.report_tree(self._with_id)
        self._strays.report(outside=in_plan)
        if self._with_id is not None:
            self._rules.plan(self._with_id, "/Plan", of_tree=of_tree)
        self._attach("")  # no element follows: they cover nothing
        dropped = self._dropped_completion()
        return None if self.fatal or self.over or not self._records else self._plan(dropped)

    def partial(self) -> Plan | None:
        """The readable part of a text that may be no plan: to be shown, never to be decided on.

        A control in it whose type is not known has none.
        """
        return self._plan(None) if self._records else None

    # ---- tokens ----------------------------------------------------------------------------

    def _start(self, tag: StartTag) -> None:
        frames = self._nesting.frames
        self._count += 1
        if self._too_many(tag, self._count):
            return
        if frames:
            parent = frames[-1]
            ordinal = parent.counts.get(tag.name, 0) + 1
            parent.counts[tag.name] = ordinal
            path = f"{parent.path}/{clip(tag.name)}[{ordinal}]"
            self._element(tag, parent, ordinal, path)
        else:
            self._outermost(tag)

    def _outermost(self, tag: StartTag) -> None:
        """The root, or an element after it."""
        name = tag.name
        if self._root is None:
            self._root = tag
            inside = Inside.PLAN if name.lower() in ("plan", "control", "runner") else Inside.QUIET
        else:
            self.broken = self.fatal = True
            self._strays.extra_root(tag.start, name)
            inside = Inside.QUIET
            if name == "Plan" and self._inner_plan < 0:
                self._inner_plan = tag.start
        outside = Frame(path="", tag="", start=tag.start, index=-1, inside=inside)
        self._element(tag, outside, 1, f"/{clip(name)}")

    def _element(self, tag: StartTag, parent: Frame, ordinal: int, path: str) -> None:
        """An element: its errors, its rules, its record; what is inside comes later."""
        attributes = self._attributes(tag, path)
        if self._pending:
            self._attach(path)
        kind = _KINDS.get(tag.name)
        # One search in the tag is cheaper than a look at every name; most tags have no colon.
        colon = self.text.find(":", tag.start, tag.end) >= 0
        if colon or len(attributes) < len(tag.attributes):
            self._namespaced(tag, kind, path)
        if kind is Kind.PLAN and path != "/Plan":
            if parent.inside is not Inside.QUIET:
                kind = None
            elif self._inner_plan < 0:
                self._inner_plan = tag.start
        parent.filled = True
        index = -1
        if kind is None:
            inside = self._unknown(tag, parent, path)
        else:
            index = self._record(kind, tag, attributes, parent, ordinal=ordinal, path=path)
            inside = _inside(kind, parent)
        if len(self._nesting.frames) == 1:
            self._last_child = index
        frame = Frame(path=path, tag=tag.name, start=tag.start, index=index, inside=inside)
        if tag.empty:
            self._nesting.closed(frame)
        else:
            self._nesting.open(frame)

    def _namespaced(self, tag: StartTag, kind: Kind | None, path: str) -> None:
        """An element with a colon or ``xmlns`` somewhere in its tag."""
        result = self._namespaces.check(tag, len(self._nesting.frames), path)
        self.broken |= result.broken
        self.fatal |= result.fatal
        if kind is Kind.RUNNER and not result.broken:
            self._rules.namespaced(tag, path)

    def _record(
        self,
        kind: Kind,
        tag: StartTag,
        attributes: tuple[Attribute, ...],
        parent: Frame,
        *,
        ordinal: int,
        path: str,
    ) -> int:
        """A plan, control or runner: check it, and record it where the plan has a place for it."""
        if parent.inside is Inside.RUNNER and parent.content is None:
            parent.content = (tag.start, 1 + len(tag.name), f"<{tag.name}>")
        control_type: ControlType | None = None
        if kind is Kind.RUNNER:
            self._rules.runner(tag, attributes, path)
        elif kind is Kind.PLAN:
            if not self._records and any(raw.name == "ID" for raw in tag.attributes):
                self._with_id = tag  # a tree's, perhaps: what follows shows it
            else:
                self._rules.plan(tag, path)
            control_type = ControlType.SEQUENTIAL
        else:
            control_type = self._rules.control(tag, attributes, path)
            self.fatal |= control_type is None
        if not self._records:
            if kind is not Kind.PLAN or path != "/Plan":
                return -1
        elif parent.index < 0 or parent.inside is not Inside.PLAN:
            return -1
        index = len(self._records)
        line, column = self.collector.lines.position(tag.start)
        self._records.append(
            Record(
                kind,
                parent.index,
                ordinal,
                attributes,
                line,
                column,
                tag.start,
                tag.end,
                control_type,
            )
        )
        if index:
            self._children.setdefault(parent.index, []).append(index)
        return index

    def _unknown(self, tag: StartTag, parent: Frame, path: str) -> Inside:
        """An element that no plan has; what may stand inside it."""
        self.fatal = True
        if tag is self._root:  # reported as such at the end; <plan> is read like <Plan>
            return Inside.PLAN if tag.name.lower() == "plan" else parent.inside
        if parent.inside is Inside.QUIET:
            return Inside.QUIET
        if self._namespaces.reported != tag.start:
            self._strays.unknown_element(tag, path)
        return Inside.OTHER

    def _end(self, tag: EndTag) -> None:
        self._faults(tag.faults)
        if self._pending:
            self._attach("")
        if self._root is None:
            self.broken = self.fatal = True
            if len(self._early) < self.limits.max_problems:
                self._early.append(tag)
        elif not self._nesting.end(tag):
            self.broken = self.fatal = True

    def _text(self, run: TextRun) -> None:
        frames = self._nesting.frames
        result = self._strays.text(run, frames[-1] if frames else None)
        self.broken |= result.broken
        self.fatal |= result.fatal

    # ---- the end ---------------------------------------------------------------------------

    def _finish(self) -> None:
        super()._finish()
        if self._root is None:
            self.broken = self.fatal = True
            if not self._swallowed:
                no_element(self.text, self.collector)
            return
        for tag in self._early:
            self._nesting.superfluous(tag)
        if self._root.name != "Plan":
            self.fatal = True
            other_root(self.text, self._root, self._inner_plan, self.collector)

    def _dropped_completion(self) -> Record | None:
        """The completion runner that the plan names as its last child, reported."""
        if self._last_child <= 0 or self._last_child >= len(self._records):
            return None
        last = self._records[self._last_child]
        interface = next((a.text for a in last.attributes if a.name == "interface"), "")
        if last.kind is not Kind.RUNNER or not is_completion(interface):
            return None
        self.collector.add(
            "GP113",
            last.start,
            last.end - last.start,
            message=(
                "this completion runner is unnecessary: a plan completes after its last element"
            ),
            hint="remove it; the check ignores it",
            element=f"/Plan/Runner[{last.ordinal}]",
        )
        return last

    def _plan(self, dropped: Record | None) -> Plan:
        records = self._records[:-1] if dropped else self._records
        children = self._children
        if dropped:
            children[0].pop()
        elements = sharing_lines(
            [
                _element(index, record, tuple(children.get(index, ())))
                for index, record in enumerate(records)
            ]
        )
        completion = _element(len(records), dropped, ()) if dropped else None
        return Plan(self.file, elements, completion)


def _inside(kind: Kind, parent: Frame) -> Inside:
    """The content that an element of a plan may have."""
    if kind is Kind.RUNNER:
        return Inside.RUNNER
    quiet = kind is Kind.CONTROL and parent.inside is Inside.QUIET
    return Inside.QUIET if quiet else Inside.PLAN


def _element(index: int, record: Record, children: tuple[int, ...]) -> Element:
    kind, parent, ordinal, attributes, line, column, start, end, control_type = record
    return Element(
        index, kind, parent, ordinal, children, attributes, line, column, start, end, control_type
    )


def no_element(text: str, collector: Collector) -> None:
    """Report that ``text`` has no element at all."""
    start = len(text) - len(text.lstrip(WHITE))
    if start == len(text):
        message = "the text is empty: there is no <Plan>"
        collector.add("GP104", 0, 0, message=message, hint="write a plan as <Plan>…</Plan>")
        return
    message = "the text contains no <Plan> and no other element"
    hint = "write a plan as <Plan>…</Plan>"
    if SPACED_TAG.match(text, start):
        hint = "remove the space after '<'"
    elif "&lt;Plan" in text:
        hint = "the plan is written with '&lt;' instead of '<': replace each '&lt;' with '<'"
    elif "```" in text or "<Plan" in text:
        hint = _RESPONSE
    collector.add("GP104", start, len(text) - start, message=message, hint=hint)


def other_root(text: str, tag: StartTag, inner_plan: int, collector: Collector) -> None:
    """Report an outermost element that is not ``<Plan>``.

    ``inner_plan`` is the offset of a ``<Plan>`` elsewhere in the text, -1 if there is none. Of a
    text in which nothing looks like a part of a plan, not even this name is shown.
    """
    names = [attribute.name for attribute in tag.attributes]
    trees = behavior_tree_root(tag.name, names)
    written = tag.name.rpartition(":")[2]
    meant = _OTHERS.get(written.lower(), "")
    if meant and tag.name != meant and (meant != "root" or "<BehaviorTree" in text):
        message = f"the outermost element is <{clip(tag.name)}>, which nothing reads"
        hint = f"write <{meant}>, in these letters"
        if written != tag.name:
            hint += " and without a prefix"
        collector.add("GP104", tag.start, 1 + len(tag.name), message=message, hint=hint)
        return
    if not (trees or OF_PLANS.search(text)):
        message = "the outermost element is not <Plan>: a plan is one <Plan> element"
        hint = f"write a plan as <Plan>…</Plan>; {_RESPONSE}"
        collector.add("GP104", tag.start, 1, message=message, hint=hint)
        return
    name = clip(tag.name)
    message = f"the outermost element is <{name}>, but a plan is one <Plan> element"
    if tag.name.lower() == "plan":
        hint = "write <Plan>: names of elements are case-sensitive"
    elif inner_plan >= 0:
        line = collector.location(inner_plan).line
        hint = f"make the <Plan> on line {line} the outermost element; {_RESPONSE}"
    elif tag.name in ("Control", "Runner"):
        hint = "put <Plan> before it and </Plan> after it"
    elif trees:
        message = (
            f"the outermost element is <{name}>: this is a BehaviorTree.CPP behaviour tree, "
            "not a plan"
        )
        hint = "write a plan as <Plan>…</Plan> with <Control> and <Runner> elements inside"
    else:
        hint = f"write a plan as <Plan>…</Plan>; {_RESPONSE}"
    length = 1 + len(tag.name)
    collector.add("GP104", tag.start, length, message=message, hint=hint, element=f"/{name}")


_OTHERS = {each.lower(): each for each in ("root", "scxml", "StateMachine", "graphml")}
"""The outermost elements of what is no plan, by their names in small letters."""
_MAX_RELATED = 20
_MAX_NAMED = 6
_MAX_OF_TREE = 100
_LONG = 65_536
_OUTSIDE = "remove it; --from-response takes the plan out of a model's answer"


class TextResult(NamedTuple):
    """The consequences of a text for the whole: see ``TreeBuilder``."""

    broken: bool = False
    fatal: bool = False


class _Unknown:
    """An unknown name of elements: offset and path of the first, and the first places of all."""

    __slots__ = ("attributes", "count", "path", "places", "start")

    def __init__(self, start: int, path: str, attributes: list[str]) -> None:
        self.start, self.path, self.attributes = start, path, attributes
        self.places: list[Location] = []
        self.count = 0

    @property
    def times(self) -> str:
        """``" (3 times)"``; "" for a single one."""
        return f" ({self.count:,} times)" if self.count > 1 else ""


class Strays:
    """Collects strays; ``report`` tells those that need the whole text to be judged."""

    def __init__(self, text: str, collector: Collector) -> None:
        self._text, self._collector = text, collector
        self._unknown: dict[str, _Unknown] = {}
        self._outside: list[TextRun] = []
        self._extra: list[tuple[int, str]] = []

    # ---- elements --------------------------------------------------------------------------

    def unknown_element(self, tag: StartTag, path: str) -> None:
        """An element that no plan has; reported once per name."""
        unknown = self._unknown.get(tag.name)
        if unknown is None:
            names = [attribute.name for attribute in tag.attributes]
            unknown = self._unknown[tag.name] = _Unknown(tag.start, path, names)
        unknown.count += 1
        if len(unknown.places) <= _MAX_RELATED:
            unknown.places.append(self._collector.location(tag.start, path))

    def extra_root(self, start: int, name: str) -> None:
        """An element after the outermost one."""
        if len(self._extra) < _MAX_RELATED:
            self._extra.append((start, name))

    # ---- text ------------------------------------------------------------------------------

    def text(self, run: TextRun, frame: Frame | None) -> TextResult:
        """Text that is not blank as it is written; ``frame`` is the element around it."""
        if frame is None:
            if len(self._outside) <= 10 * _MAX_RELATED:
                self._outside.append(run)
            return TextResult(broken=True)
        faults = self._faults(run)
        unclosed = run.cdata and bool(run.faults)
        if not faults and self._is_blank(run):
            return TextResult()
        frame.filled = True
        spaced = not run.cdata and any(SPACED_TAG.match(self._text, f.start) for f in run.faults)
        if spaced:
            faults = [fault._replace(hint="remove the space after '<'") for fault in faults]
        if unclosed or spaced or (faults and frame.inside in (Inside.OTHER, Inside.QUIET)):
            self._collector.add_faults(faults, frame.path)
        elif frame.inside is Inside.RUNNER:
            if frame.content is None:
                shown = f"the text: {self._shown(run)}"
                frame.content = (run.start, self._first_line(run), shown)
        elif frame.inside is Inside.PLAN:
            hints = (spaced_tag_hint(self._text, fault.start) for fault in run.faults)
            hint = next(filter(None, hints), "remove it")
            self._stray(run, frame.path, f"text is not allowed in <{frame.tag}>", hint)
        return TextResult(broken=bool(faults), fatal=unclosed or spaced)

    def _faults(self, run: TextRun) -> list[Fault]:
        """The faults that make the text not well-formed."""
        if run.cdata:
            return run.faults
        faults = list(run.faults)
        # Of a long text the beginning is enough: it is an error in any case.
        raw = self._text[run.start : min(run.end, run.start + _LONG)]
        decode(raw, run.start, faults)
        place = raw.find("]]>")
        if place >= 0:
            message = "']]>' is not allowed in text"
            faults.append(Fault(run.start + place, 3, message, "write ']]&gt;', or remove it"))
        return faults

    def _is_blank(self, run: TextRun) -> bool:
        raw = self._text[run.start : run.end]
        if run.cdata:
            return not strip(raw[9:-3])
        # Text is not blank as written, so it can only be blank by references such as &#32;
        return raw[0] == "&" and len(raw) <= _LONG and not strip(decode(raw, 0, []))

    def _shown(self, run: TextRun) -> str:
        return clip(self._text[run.start : min(run.end, run.start + 200)])

    def _first_line(self, run: TextRun) -> int:
        return min(run.end - run.start, self._collector.lines.rest(run.start))

    def _stray(self, run: TextRun, path: str, what: str, hint: str) -> None:
        message = f"{what}: {self._shown(run)}"
        length = min(self._first_line(run), len(self._text[run.start : run.end].rstrip(WHITE)))
        if "```" in self._text[run.start : run.end]:
            hint = _OUTSIDE
        self._collector.add("GP108", run.start, length, message=message, hint=hint, element=path)

    # ---- at the end ------------------------------------------------------------------------

    def report_tree(self, with_id: StartTag | None) -> bool:
        """Report the elements of a behaviour tree at once, if there is one inside the plan.

        ``with_id``: the tag of the plan, if it has an ``ID``.
        """
        attributes = {tag: unknown.attributes for tag, unknown in self._unknown.items()}
        tags = behavior_tree(attributes, has_id=with_id is not None)
        if not tags:
            return False
        unknown = {tag: self._unknown.pop(tag) for tag in tags}
        first = unknown[tags[0]]
        place = first.places[0]
        others = [
            Related(other, f"<{clip(tag)}>")
            for tag, each in unknown.items()
            for other in each.places
        ]
        identities = with_id.attributes if with_id is not None else ()
        others += [
            Related(self._collector.location(raw.start, "/Plan"), "'ID' on <Plan>")
            for raw in identities
            if raw.name == "ID"
        ]
        others.sort(key=lambda other: (other.location.line, other.location.column))
        named = [f"<{clip(tag)}>{each.times}" for tag, each in unknown.items()]
        if len(named) > _MAX_NAMED:
            named[_MAX_NAMED - 1 :] = [f"{len(named) - _MAX_NAMED + 1} others"]
        listed = " or ".join(filter(None, (", ".join(named[:-1]), named[-1])))
        self._collector.add(
            "GP118",
            first.start,
            1 + len(tags[0]),
            message=f"this is a behaviour tree inside a <Plan>; a plan has no {listed}",
            hint=behavior_tree_hint(tags),
            element=first.path,
            related=[other for other in others if other.location != place][:_MAX_OF_TREE],
        )
        return True

    def report(self, *, outside: bool) -> None:
        """Report what was kept; text and elements around the plan only if ``outside``."""
        for tag, unknown in self._unknown.items():
            if self._collector.full("GP105"):
                self._collector.count("GP105")
            else:
                self._report_unknown(tag, unknown)
        if outside:
            for run in self._outside:
                self._stray(run, "", "text is not allowed around the plan", _OUTSIDE)
            self._report_extra()

    def _report_unknown(self, tag: str, unknown: _Unknown) -> None:
        times = unknown.times
        message = f"<{clip(tag)}> is not an element of a plan{times}"
        if tag == "Plan":
            message = f"a plan must not contain a <Plan>{times}"
        hint = unknown_element(tag, unknown.attributes)
        if tag == "Plan":
            hint = 'write <Control type="sequential"> instead, or remove the inner <Plan>'
        self._collector.add(
            "GP105",
            unknown.start,
            1 + len(tag),
            message=message,
            hint=hint,
            element=unknown.path,
            related=[Related(place, "another") for place in unknown.places[1:]],
        )

    def _report_extra(self) -> None:
        if not self._extra:
            return
        start, name = self._extra[0]
        self._collector.add(
            "GP101",
            start,
            1 + len(name),
            message=f"a plan is a single <Plan>, but <{clip(name)}> comes after its end",
            hint="move it into the plan, or keep one plan per file; " + _OUTSIDE[11:]
            if name == "Plan"
            else "move it into the plan or remove it",
            related=[
                Related(self._collector.location(offset), f"<{clip(other)}>")
                for offset, other in self._extra[1:]
            ],
        )
