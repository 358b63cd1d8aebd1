"""Behaviour trees as they are written, and the built-in nodes of BehaviorTree.CPP (3 and 4).

A forest is flat, in document order; the compiler unfolds it into a plan. The table of nodes says
what each means and which ports it takes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, StrEnum, auto
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gpsfsm.model.plan import Attribute

_CATEGORIES = frozenset({"Action", "Condition", "Decorator", "Control"})


class PortKind(StrEnum):
    """The direction of a port. The value is its tag in a TreeNodesModel."""

    INPUT = "input_port"
    OUTPUT = "output_port"
    BOTH = "inout_port"


@dataclass(frozen=True, slots=True, eq=False)
class TreeNode:
    """One element below ``<root>``, or ``<root>`` itself.

    ``index`` is its place in ``Forest.nodes`` (document order, parents first); ``parent`` is -1
    for the root; ``start`` and ``end`` are code point offsets of the start tag; ``path`` is the
    element path, ``/root/BehaviorTree[1]/Sequence[1]``.
    """

    index: int
    tag: str
    parent: int
    children: tuple[int, ...]
    attributes: tuple[Attribute, ...]
    line: int
    column: int
    start: int
    end: int
    path: str

    def attribute(self, name: str) -> Attribute | None:
        """The attribute with this name, or None."""
        for attribute in self.attributes:
            if attribute.name == name:
                return attribute
        return None

    def text(self, name: str) -> str:
        """The source text of the attribute ``name``, "" where there is none."""
        attribute = self.attribute(name)
        return "" if attribute is None else attribute.text

    @property
    def explicit(self) -> bool:
        """True if the node is written ``<Action ID="MoveTo"/>`` and not ``<MoveTo/>``."""
        return self.tag in _CATEGORIES

    @property
    def identity(self) -> str:
        """The ID of the kind of node that this is ("" where it is missing)."""
        return self.text("ID") if self.explicit else self.tag


@dataclass(frozen=True, slots=True)
class NodeModel:
    """A kind of node in a TreeNodesModel; ``line`` is its line, 0 if it stands elsewhere."""

    category: str
    ports: Mapping[str, PortKind]
    line: int


@dataclass(frozen=True, slots=True, eq=False)
class Forest:
    """A file of behaviour trees.

    ``version`` is 3 or 4, 0 where the file does not say it. ``trees`` are the indices of the
    BehaviorTree elements by their ID; ``main`` is the one that runs, -1 where it cannot be known.
    ``models`` is None where the file has no TreeNodesModel.
    """

    file: str
    version: int
    nodes: tuple[TreeNode, ...]
    trees: Mapping[str, int]
    main: int
    models: Mapping[str, NodeModel] | None

    def children(self, node: TreeNode) -> list[TreeNode]:
        """The children of a node, in document order."""
        return [self.nodes[child] for child in node.children]


class Meaning(Enum):
    """The meaning of a built-in node. LOST: not to be expressed; ``Builtin.reason`` tells why."""

    SEQUENCE = auto()
    FALLBACK = auto()
    MEMORY = auto()
    REACTIVE_SEQUENCE = auto()
    REACTIVE_FALLBACK = auto()
    PARALLEL = auto()
    PARALLEL_ALL = auto()
    BRANCH = auto()
    INVERT = auto()
    FORCE_SUCCESS = auto()
    FORCE_FAILURE = auto()
    RETRY = auto()
    REPEAT = auto()
    DELAY = auto()
    SUBTREE = auto()
    SUCCEED = auto()
    FAIL = auto()
    LEAF = auto()
    LOST = auto()


@dataclass(frozen=True, slots=True)
class Builtin:
    """A built-in node: its meaning, how many children it has (``most`` -1: any number), its ports.

    ``integers`` are the ports that hold a number. ``version`` is 3 or 4 where only that version
    has the node.
    """

    meaning: Meaning
    least: int
    most: int
    ports: frozenset[str] = frozenset()
    integers: frozenset[str] = frozenset()
    version: int = 0
    reason: str = ""


def _leaf(meaning: Meaning, *ports: str, version: int = 0) -> Builtin:
    return Builtin(meaning, 0, 0, frozenset(ports), version=version)


def _control(meaning: Meaning, *, least: int = 1, most: int = -1, version: int = 0) -> Builtin:
    return Builtin(meaning, least, most, version=version)


def _around(meaning: Meaning, *ports: str, version: int = 0) -> Builtin:
    """A decorator whose ports are numbers."""
    return Builtin(meaning, 1, 1, frozenset(ports), frozenset(ports), version)


def _lost(reason: str, *ports: str, least: int = 1, most: int = 1, version: int = 0) -> Builtin:
    return Builtin(Meaning.LOST, least, most, frozenset(ports), version=version, reason=reason)


_BLACKBOARD = "it depends on values on the blackboard, which are not known"
_ENDLESS = "it goes on until its child fails, so there is no bound to the number of rounds"
_TIMED = "it halts its child by the clock, and the automaton knows no clock"
_REACTIVE = "it ticks its condition again and again, so that a condition may change its answer"
_SWITCH = ("variable", "case_1", "case_2", "case_3", "case_4", "case_5", "case_6")
_CHECK = ("value_A", "value_B", "return_on_mismatch")
_COUNTS = ("success_count", "failure_count", "success_threshold", "failure_threshold", "threshold")
_MAX_FAILURES = frozenset({"max_failures"})

BUILTINS: dict[str, Builtin] = {
    "Sequence": _control(Meaning.SEQUENCE),
    "AsyncSequence": _control(Meaning.SEQUENCE, version=4),
    "SequenceStar": _control(Meaning.MEMORY, version=3),
    "SequenceWithMemory": _control(Meaning.MEMORY, version=4),
    "ReactiveSequence": _control(Meaning.REACTIVE_SEQUENCE),
    "Fallback": _control(Meaning.FALLBACK),
    "AsyncFallback": _control(Meaning.FALLBACK, version=4),
    "ReactiveFallback": _control(Meaning.REACTIVE_FALLBACK),
    "Parallel": Builtin(Meaning.PARALLEL, 1, -1, frozenset(_COUNTS), frozenset(_COUNTS)),
    "ParallelAll": Builtin(Meaning.PARALLEL_ALL, 1, -1, _MAX_FAILURES, _MAX_FAILURES, version=4),
    "IfThenElse": _control(Meaning.BRANCH, least=2, most=3),
    "WhileDoElse": Builtin(Meaning.LOST, 2, 3, reason=_REACTIVE),
    "ManualSelector": _lost("a person chooses the child", "repeat_last_selection", most=-1),
    "Inverter": _around(Meaning.INVERT),
    "ForceSuccess": _around(Meaning.FORCE_SUCCESS),
    "ForceFailure": _around(Meaning.FORCE_FAILURE),
    "RetryUntilSuccessful": _around(Meaning.RETRY, "num_attempts"),
    "RetryUntilSuccesful": _around(Meaning.RETRY, "num_attempts", version=3),
    "Repeat": _around(Meaning.REPEAT, "num_cycles"),
    "Delay": _around(Meaning.DELAY, "delay_msec"),
    "Timeout": _lost(_TIMED, "msec"),
    "KeepRunningUntilFailure": _lost(_ENDLESS),
    "RunOnce": _lost("what it does depends on whether it has run before", "then_skip", version=4),
    "Precondition": _lost(_BLACKBOARD, "if", "else", version=4),
    "EntryUpdated": _lost(_BLACKBOARD, "entry", least=0, version=4),
    "SkipUnlessUpdated": _lost(_BLACKBOARD, "entry", version=4),
    "WaitValueUpdate": _lost(_BLACKBOARD, "entry", version=4),
    "SubTree": _leaf(Meaning.SUBTREE, "ID"),
    "SubTreePlus": Builtin(Meaning.SUBTREE, 0, 0, frozenset({"ID"}), version=3),
    "AlwaysSuccess": _leaf(Meaning.SUCCEED),
    "AlwaysFailure": _leaf(Meaning.FAIL),
    "SetBlackboard": _leaf(Meaning.SUCCEED, "value", "output_key"),
    "UnsetBlackboard": _leaf(Meaning.SUCCEED, "key", version=4),
    "Script": _leaf(Meaning.SUCCEED, "code", version=4),
    "ScriptCondition": _leaf(Meaning.LEAF, "code", version=4),
    "Sleep": _leaf(Meaning.LEAF, "msec", version=4),
    "WasEntryUpdated": _leaf(Meaning.LEAF, "entry", version=4),
    **{
        f"Switch{cases}": _lost(_BLACKBOARD, *_SWITCH[: cases + 1], least=cases + 1, most=cases + 1)
        for cases in range(2, 7)
    },
    **{
        f"BlackboardCheck{kind}": _lost(_BLACKBOARD, *_CHECK, version=3)
        for kind in ("Int", "Double", "String", "Bool")
    },
    **{
        f"Loop{kind}": _lost(_BLACKBOARD, "queue", "if_empty", "value", version=4)
        for kind in ("Int", "Bool", "Double", "String")
    },
}
"""All built-in nodes by their tag."""

RESERVED = frozenset({"root", "Root", *BUILTINS})
"""Names that no tree and no node of one's own can have."""


def is_reference(text: str) -> bool:
    """True if a value is read from the blackboard: ``{goal}``.

    >>> is_reference("{goal}"), is_reference("go to {goal}")
    (True, False)
    """
    stripped = text.strip()
    return len(stripped) > 2 and stripped[0] == "{" and stripped[-1] == "}"
