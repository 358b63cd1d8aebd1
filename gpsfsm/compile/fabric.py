"""The compilers of the original engines: a plan becomes connections, a rejection or a crash.

The text is read by ``gpsfsm.syntax.tinyxml``; the versions differ in data only (``PROFILES``).

The second version first checks the elements. The original is a recursion over first children and
next siblings: it stops a chain of siblings at the first bad one, but goes on behind a control whose
children were bad; what it says at last is what it found last.

Then elements are numbered in the order in which they are read; a control without elements takes a
number as well, and leaves a gap. A runner is connected to the number before its own, by the event
that the enclosing control stands for. Behind the last child of a control that is not sequential
comes a join, and every success of the whole plan that leads nowhere so far leads to it, its own
included.

``<Plan> A <Control type="parallel_all"> B C </Control></Plan>`` becomes (fabric-v2)
    0 A: start → B, success → 3    1 B: start → C, success → 3    2 C: success → 3
    3 join of 3 inputs: success → 4    4 the runner that completes the plan
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias

from gpsfsm.compile.fabric_parameters import integer, raw_parameters, string, typed_parameters
from gpsfsm.model.engine import (
    NO_NODE,
    Connection,
    Content,
    ContentKind,
    Crashed,
    EngineDocument,
    EngineElement,
    EngineNode,
    EnginePlan,
    OptionType,
    Rejected,
    Unreadable,
)
from gpsfsm.model.event import Event
from gpsfsm.model.plan import ControlType
from gpsfsm.model.story import FABRIC_V1, FABRIC_V2, FABRIC_V3

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.model.engine import EngineResult

PLAN_ID = "PLAN-ID"
"""Stands for the identifier that a server makes up for each plan."""

_NO_PLAN = "No <Plan> element found."
SEGMENTATION_FAULT = "signal 11"
_PREFIX = "XML plan parsing failed: "
_COMPLETION_CONTROL = "fabric_completion_control"
_TYPES = {kind.value: kind for kind in ControlType}
_EVENTS = {
    ControlType.SEQUENTIAL: Event.SUCCEEDED,
    ControlType.PARALLEL_ANY: Event.STARTED,
    ControlType.PARALLEL_ALL: Event.STARTED,
    ControlType.RECOVERY: Event.FAILED,
}
_Row: TypeAlias = dict[str, Any]


def compile_document(
    document: EngineDocument | Unreadable, profile: Profile, *, plan_id: str = PLAN_ID
) -> EngineResult:
    """The connections that the engine makes of a text, or its rejection or crash.

    Before anything is checked, the engine moves all that is in the first outermost ``<Plan>`` into
    a sequential control, and appends a runner to it that completes the plan.
    """
    if isinstance(document, Unreadable):
        reason = f"{document.name}: {document.message}"
        return Rejected(profile.unreadable, document.offset, reason)
    outermost = document.elements(document.roots)
    root = next((element for element in outermost if element.tag == "Plan"), None)
    if root is None:
        offset = outermost[0].start if outermost else 0
        reason = "there is no <Plan> at the outermost level, and the engine reads it unchecked"
        return Crashed(SEGMENTATION_FAULT, offset, reason)
    if outermost[0] is not root:
        return _not_first(outermost[0], profile)
    refusal = check(document, root) if profile.checked else None
    if refusal is not None:
        return refusal
    return EnginePlan(profile.name, walk(document, root, profile, plan_id), root.index)


def _not_first(first: EngineElement, profile: Profile) -> Rejected | Crashed:
    """Another element stands before ``<Plan>``."""
    reason = f"<{first.tag}> comes before <Plan>"
    if profile.checked:
        return Rejected(_NO_PLAN, first.start, reason, ())
    # The first version says so and then goes on with no element at all.
    return Crashed(SEGMENTATION_FAULT, first.start, reason)


def check(document: EngineDocument, root: EngineElement) -> Rejected | Crashed | None:
    """Check what is in ``<Plan>``; None if it passes."""
    rejected: list[EngineElement] = []
    # Chains of siblings, the innermost last.
    chains = [iter(document.elements(root.children))]
    while chains:
        element = next(chains[-1], None)
        if element is None:
            chains.pop()
            continue
        if _fault(element):
            rejected.append(element)
            chains.pop()
        elif element.tag == "Control" and element.children:
            inside = document.elements(element.children)
            if not inside:
                # It asks whether there are children, and then reads the first element of them.
                reason = "this control contains text, a comment or the like, but no element"
                return Crashed(SEGMENTATION_FAULT, element.start, reason)
            chains.append(iter(inside))
    return _rejection(document, rejected) if rejected else None


def _fault(element: EngineElement) -> str:
    """The fault of an element, for people; "" if it has none."""
    if element.tag == "Control":
        written = element.text("type")
        if written is None:
            return "the control has no type"
        return "" if written in _TYPES else f"'{written}' is not a type of control"
    if element.tag == "Runner":
        for name in ("interface", "provider"):
            if element.text(name) is None:
                return f"the runner has no {name}"
        return ""
    return f"<{element.tag}> is neither a control nor a runner"


def _rejection(document: EngineDocument, rejected: list[EngineElement]) -> Rejected:
    last = rejected[-1]
    return Rejected(
        _PREFIX + _message(document, last),
        last.start,
        _fault(last),
        tuple(element.index for element in rejected),
    )


def _message(document: EngineDocument, element: EngineElement) -> str:
    """The engine's words for a bad element."""
    if element.tag == "Control":
        written = element.text("type")
        if written is not None:
            return f"Control tag '{written}' not available in the valid list"
        return f"Control tag missing 'type' attribute: {printed(document, element.index)}"
    if element.tag == "Runner":
        missing = "interface" if element.text("interface") is None else "provider"
        return f"Runner tag missing '{missing}' attribute: {printed(document, element.index)}"
    return f"XML element is not valid :{printed(document, element.index)}"


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


def listing(result: EngineResult, profile: Profile) -> list[_Row] | _Row:
    """The connections of a plan, one row per connection, or its rejection or crash.

    A row names targets by their instance. Parameters are pairs of value and type; of the version
    without types only those that it sets itself are listed.
    """
    if isinstance(result, Crashed):
        return {"crash": result.signal}
    if isinstance(result, Rejected):
        row: _Row = {"error": result.message}
        if result.elements is not None:
            row["rejected"] = len(result.elements)
        return row
    return [_row(connection, typed=profile.typed) for connection in result.connections]


def _row(connection: Connection, *, typed: bool) -> _Row:
    source = connection.source
    return {
        "id": connection.id,
        "interface": source.interface,
        "inst": source.instance,
        "start": _target(connection.on_start),
        "success": _target(connection.on_success),
        "failure": _target(connection.on_failure),
        "desc": connection.description,
        "params": {
            parameter.name: [parameter.text if typed else parameter.value, int(parameter.type)]
            for parameter in source.parameters
            if parameter.type is not OptionType.UNCONVERTED
        },
    }


def _target(node: EngineNode | None) -> int | None:
    """The instance of a target; None for what the engine takes for none."""
    return node.instance if node is not None and node.named else None


_INDENT = "    "
_IN_TEXT = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;"})
_IN_VALUES = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "'": "&apos;"})
_MARKS = {
    ContentKind.CDATA: ("<![CDATA[", "]]>"),
    ContentKind.COMMENT: ("<!--", "-->"),
    ContentKind.UNKNOWN: ("<!", ">"),
    ContentKind.DECLARATION: ("<?", "?>"),
}
_NO_TEXT = -1


def printed(document: EngineDocument, *roots: int) -> str:
    """Some nodes of a document with all that is in them."""
    printer = _Printer(document)
    # A stack of what is still to be written; an element is entered at n and left at ~n.
    ahead = list(reversed(roots))
    while ahead:
        index = ahead.pop()
        if index < 0:
            printer.leave(document.element(~index))
            continue
        node = document.nodes[index]
        if isinstance(node, EngineElement):
            printer.enter(node)
            ahead.append(~index)
            ahead.extend(reversed(node.children))
        else:
            printer.content(node)
    return "".join(printer.out)


class _Printer:
    def __init__(self, document: EngineDocument) -> None:
        self.document = document
        self.out: list[str] = []
        self._depth = 0
        self._unsealed = False  # a start tag still lacks its '>'
        self._first = True
        self._text_depth = _NO_TEXT  # the depth of the element in which text was written last

    def enter(self, element: EngineElement) -> None:
        self._new_node()
        self.out.append(f"<{element.tag}")
        for attribute in element.attributes:
            self.out.append(f' {attribute.name}="{attribute.value.translate(_IN_VALUES)}"')
        self._unsealed = True
        self._depth += 1

    def leave(self, element: EngineElement) -> None:
        self._depth -= 1
        if self._unsealed:
            self.out.append("/>")
        else:
            if self._text_depth == _NO_TEXT:
                self.out.append("\n" + _INDENT * self._depth)
            self.out.append(f"</{element.tag}>")
        if self._text_depth == self._depth:
            self._text_depth = _NO_TEXT
        if not self._depth:
            self.out.append("\n")
        self._unsealed = False

    def content(self, node: Content) -> None:
        if node.kind in (ContentKind.TEXT, ContentKind.CDATA):
            self._text_depth = self._depth - 1
            self._seal()
        else:
            self._new_node()
        if node.kind is ContentKind.TEXT:
            self.out.append(node.value.translate(_IN_TEXT))
        else:
            begin, end = _MARKS[node.kind]
            self.out += (begin, node.value, end)

    def _new_node(self) -> None:
        self._seal()
        if self._first:
            self.out.append(_INDENT * self._depth)
        elif self._text_depth == _NO_TEXT:
            self.out.append("\n" + _INDENT * self._depth)
        self._first = False

    def _seal(self) -> None:
        if self._unsealed:
            self._unsealed = False
            self.out.append(">")


@dataclass(frozen=True, slots=True, kw_only=True)
class Join:
    """The runner that closes a control.

    ``description`` is that of its connection. ``counts`` says whether it waits for every open end
    of the plan; else it waits for one.
    """

    interface: str
    description: str
    counts: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """One version of the server.

    ``completion`` is the interface of the runner that it appends, ``has_plan_id`` whether that is
    given the id of the plan. ``joins`` maps types of controls to their joins; sequential ones have
    none. ``checked`` says whether elements are checked before they are compiled, ``typed`` whether
    parameters are. ``unreadable`` is its word for a text that its parser refuses. ``validated``: it
    asks, before it runs a plan, where the inputs of runners come from (``validation``).
    """

    name: str
    completion: str
    has_plan_id: bool
    joins: Mapping[ControlType, Join]
    checked: bool
    typed: bool
    unreadable: str
    validated: bool = False


_V1_ANY = "capabilities2_runner_system/InputMultiplexAnyRunner"
_V1_ALL = "capabilities2_runner_system/InputMultiplexAllRunner"
_V2_JOIN = "capabilities2_runner/InputMultiplexRunner"


def _joins(
    *, any_join: str, all_join: str, any_counts: bool, verb: str
) -> Mapping[ControlType, Join]:
    return {
        ControlType.PARALLEL_ANY: Join(
            interface=any_join, description=f"parallel_any_for_{verb}_outputs", counts=any_counts
        ),
        ControlType.PARALLEL_ALL: Join(
            interface=all_join, description=f"parallel_all_for_{verb}_outputs", counts=True
        ),
        ControlType.RECOVERY: Join(
            interface=any_join, description=f"parallel_any_for_{verb}_recovery", counts=any_counts
        ),
    }


_V1 = Profile(
    name=FABRIC_V1,
    completion="capabilities2_runner_fabric/FabricCompletionRunner",
    has_plan_id=False,
    joins=_joins(any_join=_V1_ANY, all_join=_V1_ALL, any_counts=True, verb="collecting"),
    # It checks names against what is installed on the robot, and goes on whatever it finds.
    checked=False,
    typed=False,
    unreadable="parse",
)
_V2 = Profile(
    name=FABRIC_V2,
    completion="fabric_capabilities/FabricCompletionRunner",
    has_plan_id=True,
    joins=_joins(any_join=_V2_JOIN, all_join=_V2_JOIN, any_counts=False, verb="muxing"),
    checked=True,
    typed=True,
    unreadable="check_compatibility failed",
)
_V3 = replace(_V2, name=FABRIC_V3, validated=True)

PROFILES: Mapping[str, Profile] = {profile.name: profile for profile in (_V1, _V2, _V3)}
"""By name."""
