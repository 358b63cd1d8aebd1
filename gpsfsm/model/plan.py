"""The plan tree: immutable, flat, in document order (semantics, section 1).

Elements are kept in one tuple and refer to each other by index, so that no depth of nesting can
exhaust the interpreter's stack and every pass is a loop.
"""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from functools import cached_property
from math import isnan
from typing import TYPE_CHECKING, ClassVar, Protocol

from gpsfsm.late import dataclass
from gpsfsm.model.printable import clip
from gpsfsm.model.showing import shown
from gpsfsm.model.story import Vocabulary

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

NOT_PARAMETERS = frozenset({"interface", "provider", "name", "id"})
"""The attributes of a runner that are no parameters: what it is, and its labels."""

_MOST_OF_A_NAME = 200

Value = bool | int | float | str
"""The type of an attribute value: true/false, then integer, then float, else text."""


def value_key(value: Value) -> tuple[object, ...]:
    """A hashable key that is equal exactly for equal values (semantics, section 4).

    Integers and floats compare numerically, a Boolean never equals a number, and every nan equals
    every other.

    >>> value_key(1) == value_key(1.0), value_key(1) == value_key(True)
    (True, False)
    """
    # A nan would equal itself only, and only the same object: None stands for all of them.
    number_or_text = None if isinstance(value, float) and isnan(value) else value
    return isinstance(value, bool), isinstance(value, str), number_or_text


class Kind(StrEnum):
    """The kind of an element. The value is its tag."""

    PLAN = "Plan"
    CONTROL = "Control"
    RUNNER = "Runner"


class ControlType(StrEnum):
    """The four types of control. ``<Plan>`` counts as SEQUENTIAL."""

    SEQUENTIAL = "sequential"
    RECOVERY = "recovery"
    PARALLEL_ANY = "parallel_any"
    PARALLEL_ALL = "parallel_all"


@dataclass(frozen=True, slots=True)
class Location:
    """A place in a plan; ``line`` and ``column`` count from 1, in code points.

    ``element`` is the element path, such as ``/Plan/Control[1]/Runner[2]``, or "" if there is none.
    ``file`` is "" for the main file, or the name of an included file.
    """

    line: int
    column: int
    element: str = ""
    file: str = ""

    @property
    def order(self) -> tuple[str, int, int]:
        """The sort key of places; those in the main file come first."""
        return self.file, self.line, self.column

    @property
    def words(self) -> str:
        """The line, for people, with the name of the file if it is an included one.

        Without a line it is the element, as in a graph.

        >>> Location(5, 1).words, Location(5, 1, file="arm.xml").words
        ('line 5', 'line 5 of arm.xml')
        """
        return line_words(f"line {self.line}", self.file) if self.line else self.element


def line_words(line: str, file: str) -> str:
    """The words for a line, with the name of the file behind them if that is an included one."""
    return f"{line} of {clip(file, _MOST_OF_A_NAME)}" if file else line


@dataclass(frozen=True, slots=True)
class Attribute:
    """One attribute. ``text`` is the decoded source text, ``value`` its typed reading."""

    name: str
    text: str
    value: Value
    line: int
    column: int


class Written(Protocol):
    """The attributes of a tag as they are written: most of them nobody asks for."""

    def attributes(self, line: int, column: int) -> tuple[Attribute, ...]:
        """The attributes of the tag that begins at ``line`` and ``column``."""


@dataclass(frozen=True, slots=True, eq=False)
class Element:
    """One ``<Plan>``, ``<Control>`` or ``<Runner>``.

    ``index`` is its place in ``Plan.elements`` (document order); ``parent`` is the index of its
    parent, -1 for the root; ``children`` are indices, in document order; ``ordinal`` counts
    same-named siblings from 1. ``start`` and ``end`` are code point offsets of the start tag in
    the source text (``end`` is exclusive). ``tag`` is set for nodes of behaviour trees: what the
    file calls them. ``shares_line``: something called alike begins on the same line, so that the
    line alone does not tell which one is meant (``sharing_lines``). ``written``: what
    ``attributes`` are made of when they are first asked for, where the reader left them unset.
    ``file`` is that of its location, in whose text the offsets are. ``node`` is the name of a node
    of a machine; without a text, as in a graph, ``line`` is 0.
    """

    index: int
    kind: Kind
    parent: int
    ordinal: int
    children: tuple[int, ...]
    attributes: tuple[Attribute, ...]
    line: int
    column: int
    start: int
    end: int
    control_type: ControlType | None = None
    tag: str = ""
    shares_line: bool = False
    written: Written | None = None
    file: str = ""
    node: str = ""

    if not TYPE_CHECKING:  # else any name would be taken for one of an element's

        def __getattr__(self, name: str) -> tuple[Attribute, ...]:
            if name != "attributes" or self.written is None:
                message = f"{type(self).__name__!r} object has no attribute {name!r}"
                raise AttributeError(message, name=name, obj=self)
            attributes = self.written.attributes(self.line, self.column)
            object.__setattr__(self, "attributes", attributes)
            object.__setattr__(self, "written", None)
            return attributes

    @property
    def where(self) -> str:
        """Its place: ``line 5``, or ``line 5 column 9`` if it is not alone there.

        A node of a machine that has no line of its own is called by its name: ``node 'drive'``.
        """
        if self.lineless:
            return f"node '{self.node}'"
        line = f"line {self.line}" + (f" column {self.column}" if self.shares_line else "")
        return line_words(line, self.file) if self.file else line

    @property
    def lineless(self) -> bool:
        """True for a node of a machine that has no line of its own, so that its name tells more."""
        return bool(self.node) and (self.shares_line or not self.line)

    @property
    def spot(self) -> tuple[str, int]:
        """The file and the offset where it is written, as all uses of a node of a tree are."""
        return self.file, self.start

    @property
    def words(self) -> str:
        """The name that people have for a control: its tag in a behaviour tree, else its type."""
        return self.tag or (self.control_type.value if self.control_type else "")

    def text(self, name: str) -> str | None:
        """The source text of the attribute ``name``, or None."""
        for attribute in self.attributes:
            if attribute.name == name:
                return attribute.text
        return None

    @property
    def interface(self) -> str:
        """The interface of a runner ("" if it has none)."""
        return self.text("interface") or ""

    @property
    def provider(self) -> str:
        """The provider of a runner ("" if it has none)."""
        return self.text("provider") or ""

    @property
    def parameters(self) -> dict[str, Value]:
        """The parameters of a runner by name, typed; ``name`` and ``id`` are labels, not these."""
        return {
            attribute.name: attribute.value
            for attribute in self.attributes
            if attribute.name not in NOT_PARAMETERS
        }

    @property
    def action(self) -> tuple[object, ...]:
        """A hashable key that is equal exactly for equal actions (semantics, section 4).

        Interface and parameters count, provider and labels do not; values compare as
        ``value_key`` says, and the order of attributes does not matter.
        """
        typed = ((name, value_key(value)) for name, value in self.parameters.items())
        return (self.interface, *sorted(typed, key=lambda item: item[0]))


def sharing_lines(elements: Sequence[Element]) -> tuple[Element, ...]:
    """The elements, ``shares_line`` set where another runner, or a control called alike, is there.

    The copies of one node of a behaviour tree, which begin at the same place, are not others.
    """
    return tuple(
        replace(element, shares_line=True) if shared else element
        for shared, element in zip(on_shared_lines(elements), elements, strict=True)
    )


def on_shared_lines(elements: Sequence[Element]) -> list[bool]:
    """Of each element, whether ``shares_line`` is to be set."""
    keys = [(element.kind, element.words, element.file, element.line) for element in elements]
    starts: dict[tuple[Kind, str, str, int], int] = {}
    shared = {
        key
        for key, element in zip(keys, elements, strict=True)
        if starts.setdefault(key, element.start) != element.start
    }
    return [key in shared for key in keys]


@dataclass(frozen=True, slots=False, eq=False)
class Plan:
    """A plan: its elements in document order, the first of which is ``<Plan>``.

    ``dropped_completion`` is the completion runner that the plan named as its last child; it is not
    among ``elements``.
    """

    file: str
    elements: tuple[Element, ...]
    dropped_completion: Element | None = None

    vocabulary: ClassVar[Vocabulary] = Vocabulary.PLAN
    nested: ClassVar[bool] = True  # it has controls, and is no list of nodes

    @cached_property
    def runners(self) -> tuple[Element, ...]:
        """All runner instances in document order."""
        return tuple(element for element in self.elements if element.kind is Kind.RUNNER)

    def path(self, element: Element | int) -> str:
        """The element path, ``/Plan/Control[1]/Runner[2]``."""
        current = self.elements[element] if isinstance(element, int) else element
        steps: list[str] = []
        while current.parent >= 0:
            steps.append(f"{current.kind}[{current.ordinal}]")
            current = self.elements[current.parent]
        steps.append(current.kind)
        return "/" + "/".join(reversed(steps))

    def location(self, element: Element | int, attribute: Attribute | None = None) -> Location:
        """The place of an element's start tag, or of an attribute in it."""
        at = self.elements[element] if isinstance(element, int) else element
        written = attribute or at
        return Location(written.line, written.column, self.path(at), at.file)

    def _repr_svg_(self) -> str | None:
        """The picture of its automaton, for notebooks."""
        return shown("plan_svg", self)

    def children(self, element: Element) -> Iterator[Element]:
        """The children of ``element``, in document order."""
        return (self.elements[index] for index in element.children)
