"""From the elements of a plan to connections, as the engines do it.

Elements are numbered in the order in which they are read; a control without elements takes a number
as well, and leaves a gap. A runner is connected to the number before its own, by the event that the
enclosing control stands for. Behind the last child of a control that is not sequential comes a
join, and every success of the whole plan that leads nowhere so far leads to it, its own included.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.compile.fabric.typing import integer, raw_parameters, string, typed_parameters
from gpsfsm.model.engine import NO_NODE, Connection, EngineNode
from gpsfsm.model.event import Event
from gpsfsm.model.plan import ControlType

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.compile.fabric.profiles import Profile
    from gpsfsm.model.engine import EngineDocument, EngineElement

__all__ = ["walk"]

_COMPLETION_CONTROL = "fabric_completion_control"
_TYPES = {kind.value: kind for kind in ControlType}
_EVENTS = {
    ControlType.SEQUENTIAL: Event.SUCCEEDED,
    ControlType.PARALLEL_ANY: Event.STARTED,
    ControlType.PARALLEL_ALL: Event.STARTED,
    ControlType.RECOVERY: Event.FAILED,
}


def walk(
    document: EngineDocument, root: EngineElement, profile: Profile, plan_id: str
) -> tuple[Connection, ...]:
    """The connections of what is in ``<Plan>``, by ascending id."""
    walker = _Walker(document, profile)
    finished = walker.children(root)
    if finished:
        walker.completion(plan_id)
    return walker.connections()


@dataclass(slots=True)
class _Draft:
    """A connection that is not finished."""

    source: EngineNode
    description: str = ""
    control: int | None = None
    completion: bool = False
    on_start: EngineNode | None = None
    on_success: EngineNode | None = None
    on_failure: EngineNode | None = None


@dataclass(slots=True)
class _Level:
    """A control whose children are being read: None at the outermost level.

    ``description`` is what the next connection made of a child is called: the control's name, up
    to the first runner.
    """

    element: EngineElement | None
    kind: ControlType
    ahead: Iterator[EngineElement]
    description: str


class _Walker:
    def __init__(self, document: EngineDocument, profile: Profile) -> None:
        self._document = document
        self._profile = profile
        self._drafts: dict[int, _Draft] = {}
        self._open: dict[int, _Draft] = {}  # those whose success leads nowhere yet
        self._next = 0  # the id of the next element
        self._instances = 0
        self._level = _Level(None, ControlType.SEQUENTIAL, iter(()), _COMPLETION_CONTROL)

    def children(self, root: EngineElement) -> bool:
        """Read all that is in ``<Plan>``; False if it broke off at the outermost level."""
        outermost = self._level
        outermost.ahead = iter(self._document.elements(root.children))
        levels = [outermost]
        while True:
            self._level = level = levels[-1]
            element = next(level.ahead, None)
            if element is None:
                levels.pop()
                if not levels:
                    return True
                self._leave(level)
            elif element.tag == "Runner":
                self._runner(element)
            elif element.tag == "Control":
                entered = self._enter(element)
                if entered:
                    levels.append(entered)
                else:
                    self._next += 1
            elif len(levels) == 1:
                return False
            else:
                # An unknown element ends its level. It takes a number, but for a join's.
                self._next += 1
                level.ahead = iter(())

    def completion(self, plan_id: str) -> None:
        """Append the runner that completes the plan."""
        interface = self._profile.completion
        parameters = (string("plan_id", plan_id),) if self._profile.has_plan_id else ()
        draft = self._place(EngineNode(interface, interface, parameters, self._instances, None))
        draft.completion = True

    def connections(self) -> tuple[Connection, ...]:
        """All connections made."""
        return tuple(
            Connection(
                number,
                draft.source,
                draft.on_start,
                None,
                draft.on_success,
                draft.on_failure,
                draft.description,
                draft.control,
                draft.completion,
            )
            for number, draft in sorted(self._drafts.items())
        )

    # ---- controls --------------------------------------------------------------------------

    def _enter(self, element: EngineElement) -> _Level | None:
        """The level of a control's children; None if the engine sees none there."""
        kind = _TYPES.get(element.text("type") or "")
        children = self._document.elements(element.children)
        if kind is None or not children:
            return None
        return _Level(element, kind, iter(children), element.text("name") or "")

    def _leave(self, level: _Level) -> None:
        join = self._profile.joins.get(level.kind)
        if join is None:
            return
        assert level.element is not None
        count = len(self._open) if join.counts else 1
        parameters = (integer("input_count", count),)
        node = EngineNode(join.interface, join.interface, parameters, self._instances, None)
        draft = self._add(node, join.description)
        draft.control = level.element.index
        for each in self._open.values():
            each.on_success = node
        self._open.clear()

    # ---- runners ---------------------------------------------------------------------------

    def _runner(self, element: EngineElement) -> None:
        instance = self._instances
        typed = self._profile.typed
        self._place(
            EngineNode(
                element.text("interface") or "",
                element.text("provider") or "",
                typed_parameters(element) if typed else raw_parameters(element, instance),
                instance,
                element.index,
            )
        )

    def _place(self, node: EngineNode) -> _Draft:
        """Give a runner the next number, and connect it to the one before."""
        number = self._next
        draft = self._add(node, self._level.description)
        self._level.description = ""
        if number:
            self._connect(number - 1, _EVENTS[self._level.kind], node)
        return draft

    def _add(self, node: EngineNode, description: str) -> _Draft:
        draft = _Draft(node, description)
        self._drafts[self._next] = self._open[self._next] = draft
        self._next += 1
        self._instances += 1
        return draft

    def _connect(self, number: int, event: Event, node: EngineNode) -> None:
        draft = self._drafts.get(number)
        if draft is None:  # a gap: asking for it makes an entry
            draft = self._drafts[number] = self._open[number] = _Draft(NO_NODE)
        if event is Event.STARTED:
            draft.on_start = node
        elif event is Event.FAILED:
            draft.on_failure = node
        else:
            draft.on_success = node
            if node.named:
                self._open.pop(number, None)
            else:  # the engine asks for the name of what follows
                self._open[number] = draft
