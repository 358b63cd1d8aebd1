"""From tokens to the plan tree: nesting, places, and the rules of what may stand where."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.plan import ControlType, Element, Kind, Plan, sharing_lines
from gpsfsm.syntax.chars import clip
from gpsfsm.syntax.elements import ElementRules, is_completion
from gpsfsm.syntax.frames import Frame, Inside, Record
from gpsfsm.syntax.namespaces import Namespaces
from gpsfsm.syntax.outline import no_element, other_root
from gpsfsm.syntax.strays import Strays
from gpsfsm.syntax.token_reader import TokenReader

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.model.plan import Attribute
    from gpsfsm.syntax.collector import Collector
    from gpsfsm.syntax.limits import Limits
    from gpsfsm.syntax.tokens import EndTag, StartTag, TextRun, Token

__all__ = ["TreeBuilder"]

_KINDS = {kind.value: kind for kind in Kind}


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
        self._inner_plan = -1
        self._early: list[EndTag] = []
        self._count = 0
        self._records: list[Record] = []
        self._children: dict[int, list[int]] = {}
        self._last_child = -1

    def build(self, tokens: Iterable[Token]) -> Plan | None:
        """Read all tokens; the plan, or None."""
        self._take(tokens)
        self._strays.report(outside=self._root is not None and self._root.name == "Plan")
        self._attach("")  # no element follows: they cover nothing
        dropped = self._dropped_completion()
        return None if self.fatal or self.over or not self._records else self._plan(dropped)

    def partial(self) -> Plan | None:
        """What could be read of a text that may be no plan: to be shown, never to be decided on.

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
            index = self._known(kind, tag, attributes, parent, ordinal, path)
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

    def _known(  # noqa: PLR0917  (the parts of an element)
        self,
        kind: Kind,
        tag: StartTag,
        attributes: tuple[Attribute, ...],
        parent: Frame,
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
            message="a plan completes by itself; this completion runner at its end is left out",
            hint="remove it: completion follows the last element on its own",
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
    """What may stand inside an element of a plan."""
    if kind is Kind.RUNNER:
        return Inside.RUNNER
    quiet = kind is Kind.CONTROL and parent.inside is Inside.QUIET
    return Inside.QUIET if quiet else Inside.PLAN


def _element(index: int, record: Record, children: tuple[int, ...]) -> Element:
    kind, parent, ordinal, attributes, line, column, start, end, control_type = record
    return Element(
        index, kind, parent, ordinal, children, attributes, line, column, start, end, control_type
    )
