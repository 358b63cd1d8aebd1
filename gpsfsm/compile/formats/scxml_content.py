"""The executable content of an SCXML document: the events that it raises and sends.

What a block raises is known unless an expression decides it, or an error that somebody waits for.

    <onentry><raise event="x"/><log expr="y"/></onentry>    raises x; with a transition for "error",
                                                            nobody knows what comes then
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Final, NamedTuple

from gpsfsm.model.precision import Cause

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.compile.formats.scxml_chart import Chart
    from gpsfsm.model.tree import TreeNode

Tokens = tuple[str, ...]
Queue = tuple[Tokens, ...] | None
"""The internal events that have not been processed yet; None where they are not known."""
Doubt = tuple[str, "TreeNode", Cause]
"""A construct that a run passes through, after which the run may be none of the file."""

ERRORS: Final = (("error", "execution"), ("error", "communication"), ("error", "platform"))
"""The events of what goes wrong."""
EXPRESSIONS: Final = {
    "if": ("cond",),
    "elseif": ("cond",),
    "foreach": ("array", "item", "index"),
    "assign": ("expr", "location"),
    "log": ("expr",),
    "data": ("expr", "src"),
    "param": ("expr", "location"),
    "content": ("expr",),
    "cancel": ("sendidexpr",),
    "send": ("eventexpr", "targetexpr", "typeexpr", "delayexpr", "namelist", "idlocation"),
}
"""The attributes that are evaluated, by element."""
_FAILING: Final = ("assign", "script", "foreach", "invoke")
_INTERNAL: Final = "#_internal"
_OURS: Final = (
    "", "scxml", "http://www.w3.org/TR/scxml", "http://www.w3.org/TR/scxml/",
    "http://www.w3.org/TR/scxml/#SCXMLEventProcessor",
)  # fmt: skip
_MORE: Final = "\0"
_LONGEST_QUEUE: Final = 30


def tokens(descriptor: str) -> Tokens:
    """The tokens that the name of an event has to begin with.

    >>> tokens("nav.failed.*"), tokens("*")
    (('nav', 'failed'), ())
    """
    if descriptor in ("*", ".*"):
        return ()
    return tuple(descriptor.removesuffix("*").removesuffix(".").split("."))


def is_literal(text: str) -> bool:
    """True for an expression that cannot fail: a text, a number, or nothing.

    >>> [is_literal(text) for text in ("'a'", "1.5", "x + 1")]
    [True, True, False]
    """
    text = text.strip()
    inner = text[1:-1]
    if len(text) > 1 and text[0] == text[-1] and text[0] in "'\"":
        return text[0] not in inner and "\\" not in inner
    return not text or (text.isascii() and text.replace(".", "", 1).isdecimal())


class Effect(NamedTuple):
    """The events of a block of executable content."""

    queue: Queue = ()
    doubts: tuple[Doubt, ...] = ()
    raises: tuple[TreeNode, ...] = ()  # the elements that raise something somebody waits for

    def then(self, other: Effect) -> Effect:
        """One block after the other."""
        queue = None if self.queue is None or other.queue is None else self.queue + other.queue
        if queue is not None and len(queue) > _LONGEST_QUEUE:
            queue = None
        return Effect(queue, self.doubts + other.doubts, self.raises + other.raises)


class Contents:
    """The events that a chart sends itself, as far as a transition waits for them."""

    def __init__(self, chart: Chart) -> None:
        self.chart = chart
        self.raised: set[Tokens] = set()
        self.sent: set[Tokens] = set()
        self.raises_any = self.sends_any = self.fails = self.late = False
        self._effects: dict[int, Effect] = {}
        for node in chart.read:
            if node.tag in ("raise", "send"):
                self._sends(node)
            elif node.tag == "invoke":
                self.sends_any = self.late = True
            failing = self._can_fail(node)
            undecided = node.tag == "transition" and chart.may_fail(node)
            self.fails = self.fails or failing or undecided
            self.late = self.late or (failing and node.tag == "send")
        self.errors = self.fails and any(map(self.hears, ERRORS))
        """True if something may fail, and a transition waits for the error."""
        self.late = self.late and self.errors
        """True if an error may come at any time: what has been sent or invoked fails."""

    def _sends(self, node: TreeNode) -> None:
        inward = self.is_inward(node)
        if not node.text("event"):
            self.raises_any, self.sends_any = self.raises_any or inward, True
            return
        name = tuple(node.text("event").split("."))
        if self.hears(name):
            self.raised |= {name} if inward else set()
            self.sent |= {name} if not inward or self._is_either(node) else set()

    def is_inward(self, node: TreeNode) -> bool:
        """True for what may put an event into the internal queue."""
        own = node.tag == "raise" or node.text("target").strip() == _INTERNAL
        return own or self._is_either(node)

    @staticmethod
    def _is_either(node: TreeNode) -> bool:
        """True for a send of which an expression decides where to."""
        return bool(node.text("targetexpr"))

    def hears(self, name: Tokens) -> bool:
        """True if a transition waits for an event of this name."""
        return any(name[:length] in self.chart.by_name for length in range(len(name) + 1))

    def is_own(self, start: Tokens) -> bool:
        """True for what an event of the machine itself may begin with."""
        names = (*self.raised, *self.sent)
        return bool(start) and (
            self.sends_any or any(name[: len(start)] == start for name in names)
        )

    def _can_fail(self, node: TreeNode) -> bool:
        texts = [node.text(each) for each in EXPRESSIONS.get(node.tag, ())]
        if node.tag in ("if", "elseif"):
            return self.chart.may_fail(node)
        if node.tag == "send":
            target, kind = node.text("target").strip(), node.text("type").strip()
            inside = self.chart.elements.children(node)
            if (
                target not in ("", _INTERNAL)
                or kind not in _OURS
                or any(map(self._can_fail, inside))
            ):
                return True
        if node.tag == "data" and not node.text("expr"):
            return True  # its text is not looked at
        bare = self.chart.root.text("datamodel") == "null"  # which has no expressions
        sure = not any(texts) if bare else all(map(is_literal, texts))
        return node.tag in _FAILING or not sure

    # -- blocks -----------------------------------------------------------------------------

    def of(self, block: TreeNode) -> Effect:
        """The effect of a block: of a transition, of ``onentry`` or the like.

        An error ends it, so nobody knows what is raised after something that may fail.
        """
        if block.index not in self._effects:
            effect = Effect()
            failing: Doubt | None = None
            for each in self.chart.elements.children(block):
                last = self._one(each)
                if failing and last.queue != ():
                    last = Effect(None, (*last.doubts, failing), last.raises)
                effect = effect.then(last)
                if self._fails_within(each):
                    failing = (each.tag, each, Cause.EVENTS)
            self._effects[block.index] = effect
        return self._effects[block.index]

    def _fails_within(self, node: TreeNode) -> bool:
        inside = self.chart.elements.children(node) if node.tag in ("if", "foreach") else ()
        return self._can_fail(node) or any(map(self._fails_within, inside))

    def _one(self, node: TreeNode) -> Effect:
        """The effect of one element; an error that somebody waits for makes the queue unknown."""
        doubt: Doubt = (node.tag, node, Cause.EVENTS)
        effect = Effect()
        if node.tag in ("if", "foreach"):
            inner = self.of(node)
            certain = inner.queue == ()
            effect = Effect((), inner.doubts) if certain else Effect(None, (doubt,), inner.raises)
        elif node.tag in ("raise", "send"):
            effect = self._event(node, doubt)
        if (self.errors or effect.raises) and self._can_fail(node):
            effect = Effect(None, (*effect.doubts, doubt), effect.raises or (node,))
        return effect

    def _event(self, node: TreeNode, doubt: Doubt) -> Effect:
        name, inward = tuple(node.text("event").split(".")), self.is_inward(node)
        if not node.text("event"):
            return Effect(None, (doubt,), (node,)) if inward else Effect((), (doubt,))
        if not self.hears(name):
            return Effect()
        if self._is_either(node):
            return Effect(None, (doubt,), (node,))
        return Effect((name,), (), (node,)) if inward else Effect((), (doubt,))

    def entry(self, state: TreeNode) -> Effect:
        """The effect of entering a state, but for its ``done.state`` and its transitions."""
        effect, late = Effect(), self.chart.root.text("binding") == "late"
        children = self.chart.elements.children(state)
        tags = ("datamodel",) if late else ()
        for tag in (*tags, "onentry", "donedata"):
            for each in children:
                effect = effect.then(self.of(each)) if each.tag == tag else effect
        return effect

    def exit(self, state: TreeNode) -> Effect:
        """The effect of leaving a state."""
        effect = Effect()
        for each in self.chart.elements.children(state):
            effect = effect.then(self.of(each)) if each.tag == "onexit" else effect
        return effect

    def start(self) -> Effect:
        """The effect of the start, before the first state is entered."""
        effect = Effect()
        for each in self.chart.read:
            if each.tag == "datamodel":
                effect = effect.then(self.of(each))
            elif each.tag == "script" and self.chart.parent(each) is self.chart.root:
                effect = effect.then(self._one(each))
        return effect

    # -- what may happen --------------------------------------------------------------------

    @cached_property
    def internal(self) -> dict[Tokens, list[Tokens]]:
        """Internal events by each beginning that a transition names; one of those alike."""
        names: set[Tokens] = {*self.raised, *(ERRORS if self.errors else ())}
        names |= {self.chart.done_event(each) for each in self.chart.states}
        if self.raises_any:
            names |= {(*start, *more) for start in self.chart.by_name for more in ((), (_MORE,))}
        alike: dict[tuple[Tokens, ...], Tokens] = {}
        for name in sorted(names):
            starts = (name[:length] for length in range(len(name) + 1))
            alike.setdefault(tuple(each for each in starts if each in self.chart.by_name), name)
        rows: dict[Tokens, list[Tokens]] = {}
        for key, name in alike.items():
            for start in key:
                rows.setdefault(start, []).append(name)
        return rows

    @cached_property
    def may_go_on(self) -> bool:
        """True if a macrostep beside unknown states may raise events without end."""
        import networkx

        chart = self.chart
        if self.raises_any or not (self.raised or self.errors):
            return self.raises_any
        rows = [
            (node, row, self._raises(node, row))
            for node in chart.states
            for row in chart.live(node)
            if not row.text("event") or any(self.internal.get(each) for each in chart.events(row))
        ]
        graph: networkx.DiGraph[int] = networkx.DiGraph()
        eventless = [(node, row) for node, row, _ in rows if not row.text("event")]
        for source, row, raised in rows:
            domain = chart.domain_of(source, row)
            starts = {name[:length] for name in raised for length in range(len(name) + 1)}
            follow = [each for start in starts for each in chart.by_name.get(start, ())]
            follow += [
                then
                for node, then in eventless
                if chart.cond(then) or (row.text("target") and chart.contains(domain, node))
            ]
            graph.add_edges_from((row.index, each.index) for each in follow)
        return not networkx.is_directed_acyclic_graph(graph)

    def _raises(self, source: TreeNode, row: TreeNode) -> set[Tokens]:
        """All that a transition may raise by what it leaves and enters."""
        chart, states, left = self.chart, list["TreeNode"](), list["TreeNode"]()
        if row.text("target"):
            domain = chart.domain_of(source, row)
            states = [each for end in chart.targets(row) for each in self._span(domain, end)]
            outermost = source if domain is source else self._span(domain, source)[-1]
            left = [outermost, *self._span(domain, outermost)]
        effects = [self.of(row), *map(self.entry, states), *map(self.exit, left)]
        effects += [self.of(each) for state in states for each in chart.inwards(state)]
        names = {name for each in effects for name in each.queue or ()}
        names |= {chart.done_event(chart.parent(each)) for each in states if each.tag == "final"}
        names |= {chart.done_event(each) for each in states if each.tag == "parallel"}
        if any(each.queue is None for each in effects):
            names |= self.raised | set(ERRORS)
        return names | (set(ERRORS) if self.errors and chart.cond(row) else set())

    def _span(self, domain: TreeNode, state: TreeNode) -> list[TreeNode]:
        """The states that may become active with a state: those around it last, regions, inside."""
        chart, around = self.chart, list["TreeNode"]()
        state = chart.parent(state) if state.tag == "history" else state
        for each in chart.outwards(state):
            if each is domain or each is chart.root:
                break
            around.append(each)
        regions = [each for each in around if each.tag == "parallel"]
        top = (regions or around[:1] or [state])[-1]
        return [*chart.within(top), *around]


def begins(name: Tokens, starts: Iterable[Tokens]) -> bool:
    """True if one of the beginnings is that of the name."""
    return any(name[: len(start)] == start for start in starts)
