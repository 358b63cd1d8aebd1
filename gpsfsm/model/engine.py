"""A plan's text as an original engine takes it: its tree, its connections, or why it has none.

The engines are two published versions of the Fabric server. They read plans with a parser of their
own, which takes texts that are not XML, and compile them by an algorithm of their own
(``compile/fabric.py``). Everything is flat and refers by index, so that no depth of nesting can
exhaust the interpreter's stack.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, StrEnum

# ---- the text as the engine's parser sees it ---------------------------------------------------


class ContentKind(StrEnum):
    """The kind of a child that is no element."""

    TEXT = "text"
    CDATA = "cdata"
    COMMENT = "comment"
    UNKNOWN = "unknown"
    DECLARATION = "declaration"


@dataclass(frozen=True, slots=True)
class EngineAttribute:
    """One attribute; ``value`` is what the engine reads.

    ``start`` and ``end`` are code point offsets of name, sign and quotes (``end`` is exclusive). A
    value may hold lone surrogates: bytes that are no UTF-8, which the engine takes and even makes.
    """

    name: str
    value: str
    start: int
    end: int


@dataclass(frozen=True, slots=True, eq=False)
class EngineElement:
    """One element. ``children`` are indices of all child nodes, not of elements only.

    ``index`` is its place in ``EngineDocument.nodes``, which is document order; ``parent`` is -1
    at the outermost level. ``start`` and ``end`` are offsets of the start tag.
    """

    index: int
    tag: str
    attributes: tuple[EngineAttribute, ...]
    parent: int
    children: tuple[int, ...]
    start: int
    end: int

    def text(self, name: str) -> str | None:
        """The value of the attribute ``name``, or None."""
        for attribute in self.attributes:
            if attribute.name == name:
                return attribute.value
        return None


@dataclass(frozen=True, slots=True, eq=False)
class Content:
    """A child that is no element; ``value`` is what stands between its marks, decoded."""

    index: int
    kind: ContentKind
    value: str
    parent: int
    start: int
    end: int


@dataclass(frozen=True, slots=True, eq=False)
class EngineDocument:
    """All nodes of a text in document order; ``roots`` are those at the outermost level."""

    nodes: tuple[EngineElement | Content, ...]
    roots: tuple[int, ...]

    def element(self, index: int) -> EngineElement:
        """The element with this index."""
        node = self.nodes[index]
        assert isinstance(node, EngineElement)
        return node

    def elements(self, indices: tuple[int, ...]) -> list[EngineElement]:
        """Those of some nodes that are elements."""
        nodes = (self.nodes[index] for index in indices)
        return [node for node in nodes if isinstance(node, EngineElement)]


@dataclass(frozen=True, slots=True)
class Unreadable:
    """The engine's parser refuses the text.

    ``name`` is the parser's name of the error and ``line`` the line that it tells (0 for none);
    ``offset`` is where the text is wrong, in code points, and ``message`` says how.
    """

    name: str
    line: int
    offset: int
    message: str


# ---- connections -------------------------------------------------------------------------------


class OptionType(IntEnum):
    """The engine's types of parameters, as it numbers them."""

    BOOL = 0
    DOUBLE = 1
    INT = 2
    STRING = 3
    UNCONVERTED = 4


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter: what the engine stores (``value``) and what it passes on (``text``)."""

    name: str
    type: OptionType
    value: bool | int | float | str
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class EngineNode:
    """The end of a connection, from or to which it leads.

    ``instance`` numbers runners in the order in which the engine makes them. ``element`` is the
    index of the runner's element; None for what the engine adds, which is joins and completion.
    """

    interface: str
    provider: str
    parameters: tuple[Parameter, ...]
    instance: int
    element: int | None

    @property
    def named(self) -> bool:
        """True if the engine takes it for something: it asks for the interface only."""
        return self.interface != ""


NO_NODE = EngineNode("", "", (), -1, None)
"""The source of an entry that the engine makes by the way, where the plan has a gap."""


@dataclass(frozen=True, slots=True, eq=False)
class Connection:
    """One entry: what follows its source, per event. None: nothing follows.

    A target without an interface is one that the engine itself takes for none. No engine sets
    ``on_stop``. ``control`` is the element index of the control that a join closes, else None;
    ``completion`` marks the runner that the engine appends.
    """

    id: int
    source: EngineNode
    on_start: EngineNode | None
    on_stop: EngineNode | None
    on_success: EngineNode | None
    on_failure: EngineNode | None
    description: str
    control: int | None = None
    completion: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class EnginePlan:
    """An accepted plan: its connections by ascending id. ``root`` is the element ``<Plan>``."""

    profile: str
    connections: tuple[Connection, ...]
    root: int


@dataclass(frozen=True, slots=True, eq=False)
class Rejected:
    """The engine refuses the plan.

    ``message`` is the engine's, ``offset`` the place that it is about, ``reason`` what is wrong
    there. ``elements`` are the elements that it lists as refused; None if it lists none because the
    text was not even read. ``hint`` says what to do, if that is another structure of the plan.
    """

    message: str
    offset: int
    reason: str
    elements: tuple[int, ...] | None = None
    hint: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Crashed:
    """The engine's process dies. ``signal`` says how, ``reason`` why, ``offset`` at what."""

    signal: str
    offset: int
    reason: str


EngineResult = EnginePlan | Rejected | Crashed
