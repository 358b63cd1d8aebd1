"""Behaviour trees as they are written, and the built-in nodes of BehaviorTree.CPP (3 and 4).

A forest is flat, in document order; the compiler unfolds it into a plan. The table of nodes says
what each means and which ports it takes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, StrEnum, auto
from typing import TYPE_CHECKING

from gpsfsm.model.plan import Location

if TYPE_CHECKING:
    from gpsfsm.model.plan import Attribute

CATEGORIES = frozenset({"Action", "Condition", "Decorator", "Control"})
"""Tags of nodes that are written with their ID."""


class PortKind(StrEnum):
    """The direction of a port. The value is its tag in a TreeNodesModel."""

    INPUT = "input_port"
    OUTPUT = "output_port"
    BOTH = "inout_port"


@dataclass(frozen=True, slots=True, eq=False)
class TreeNode:
    """One element below ``<root>``, or ``<root>`` itself.

    ``index`` is its place in ``Forest.nodes`` (document order, parents first); ``parent`` is -1
    for the root of a file; ``start`` and ``end`` are code point offsets of the start tag; ``path``
    is the element path, ``/root/BehaviorTree[1]/Sequence[1]``, and ``file`` that of a location.
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
    file: str = ""

    @property
    def location(self) -> Location:
        """The place of its start tag."""
        return Location(self.line, self.column, self.path, self.file)

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
        return self.tag in CATEGORIES

    @property
    def identity(self) -> str:
        """The ID of the kind of node that this is ("" where it is missing)."""
        return self.text("ID") if self.explicit else self.tag


@dataclass(frozen=True, slots=True)
class NodeModel:
    """A kind of node in a TreeNodesModel; ``line`` is its line, 0 if it stands elsewhere.

    ``file`` is that of its location.
    """

    category: str
    ports: Mapping[str, PortKind]
    line: int
    file: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Forest:
    """A file of behaviour trees, with those that it includes.

    ``nodes`` are the elements of the file and then those of each included one; elements without a
    parent are the roots of these. ``version`` is 3 or 4, 0 where the file does not say it.
    ``trees`` are the indices of the BehaviorTree elements by their ID; ``main`` is the one that
    runs, -1 where it cannot be known. ``models`` is None where no file has a TreeNodesModel.
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
    """The meaning of a node that is known by its name: those of BehaviorTree.CPP, and Nav2's.

    The first ones become a plan (``compile/trees.py``); with any of those behind ``LEAF`` a tree
    becomes a machine (``compile/tree_machine.py``). GATE: the child, which waits for a clock or a
    distance. PASS: the child. MAYBE: the child, or success. OTHER: a node of one's own that has
    children.
    """

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
    WHILE = auto()
    FALLBACK_MEMORY = auto()
    KEEP_RUNNING = auto()
    TIMEOUT = auto()
    RUN_ONCE = auto()
    SWITCH = auto()
    PRECONDITION = auto()
    CHECK = auto()
    ENTRY = auto()
    LOOP = auto()
    MANUAL = auto()
    TRY_CATCH = auto()
    PIPELINE = auto()
    RECOVERY = auto()
    ROUND_ROBIN = auto()
    NONBLOCKING = auto()
    GATE = auto()
    PASS = auto()
    MAYBE = auto()
    SINGLE_TRIGGER = auto()
    OTHER = auto()


class Origin(Enum):
    """The library that a node comes from."""

    BTCPP = auto()
    NAV2 = auto()


@dataclass(frozen=True, slots=True)
class Builtin:
    """A node of a library: its meaning, how many children it has (``most`` -1: any number), ports.

    ``integers`` are the ports that hold a whole number. ``version`` is 3 or 4 where only that
    version has the node; ``since`` is the release that it came with, where that matters.
    """

    meaning: Meaning
    least: int
    most: int
    ports: frozenset[str] = frozenset()
    integers: frozenset[str] = frozenset()
    version: int = 0
    since: str = ""
    origin: Origin = Origin.BTCPP


def _leaf(meaning: Meaning, *ports: str, version: int = 0) -> Builtin:
    return Builtin(meaning, 0, 0, frozenset(ports), version=version)


def _control(meaning: Meaning, *, least: int = 1, most: int = -1, version: int = 0) -> Builtin:
    return Builtin(meaning, least, most, version=version)


def _around(meaning: Meaning, *ports: str, version: int = 0) -> Builtin:
    """A decorator whose ports are numbers."""
    return Builtin(meaning, 1, 1, frozenset(ports), frozenset(ports), version)


def _of_values(meaning: Meaning, *ports: str, version: int = 0) -> Builtin:
    """A decorator whose ports are values."""
    return Builtin(meaning, 1, 1, frozenset(ports), version=version)


def _nav2(
    meaning: Meaning, *ports: str, least: int = 1, most: int = 1, integers: tuple[str, ...] = ()
) -> Builtin:
    return Builtin(meaning, least, most, frozenset(ports), frozenset(integers), origin=Origin.NAV2)


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
    "FallbackStar": _control(Meaning.FALLBACK_MEMORY, version=3),
    "ReactiveFallback": _control(Meaning.REACTIVE_FALLBACK),
    "Parallel": Builtin(Meaning.PARALLEL, 1, -1, frozenset(_COUNTS), frozenset(_COUNTS)),
    "ParallelAll": Builtin(Meaning.PARALLEL_ALL, 1, -1, _MAX_FAILURES, _MAX_FAILURES, version=4),
    "IfThenElse": _control(Meaning.BRANCH, least=2, most=3),
    "WhileDoElse": _control(Meaning.WHILE, least=2, most=3),
    "TryCatch": Builtin(
        Meaning.TRY_CATCH, 2, -1, frozenset({"catch_on_halt"}), version=4, since="4.9.0"
    ),
    "ManualSelector": Builtin(Meaning.MANUAL, 1, -1, frozenset({"repeat_last_selection"})),
    "Inverter": _around(Meaning.INVERT),
    "ForceSuccess": _around(Meaning.FORCE_SUCCESS),
    "ForceFailure": _around(Meaning.FORCE_FAILURE),
    "RetryUntilSuccessful": _around(Meaning.RETRY, "num_attempts"),
    "RetryUntilSuccesful": _around(Meaning.RETRY, "num_attempts", version=3),
    "Repeat": _around(Meaning.REPEAT, "num_cycles"),
    "Delay": _around(Meaning.DELAY, "delay_msec"),
    "Timeout": _around(Meaning.TIMEOUT, "msec"),
    "KeepRunningUntilFailure": _around(Meaning.KEEP_RUNNING),
    "RunOnce": _of_values(Meaning.RUN_ONCE, "then_skip", version=4),
    "Precondition": _of_values(Meaning.PRECONDITION, "if", "else", version=4),
    "EntryUpdated": Builtin(Meaning.ENTRY, 0, 1, frozenset({"entry"}), version=4),
    "SkipUnlessUpdated": _of_values(Meaning.ENTRY, "entry", version=4),
    "WaitValueUpdate": _of_values(Meaning.ENTRY, "entry", version=4),
    "SubTree": _leaf(Meaning.SUBTREE, "ID"),
    "SubTreePlus": Builtin(Meaning.SUBTREE, 0, 0, frozenset({"ID"}), version=3),
    "AlwaysSuccess": _leaf(Meaning.SUCCEED),
    "AlwaysFailure": _leaf(Meaning.FAIL),
    "SetBlackboard": _leaf(Meaning.SUCCEED, "value", "output_key"),
    "UnsetBlackboard": _leaf(Meaning.SUCCEED, "key", version=4),
    "Script": _leaf(Meaning.SUCCEED, "code", version=4),
    "ScriptCondition": _leaf(Meaning.LEAF, "code", version=4),
    "Sleep": Builtin(Meaning.LEAF, 0, 0, frozenset({"msec"}), frozenset({"msec"}), version=4),
    "WasEntryUpdated": _leaf(Meaning.LEAF, "entry", version=4),
    **{
        f"Switch{cases}": Builtin(
            Meaning.SWITCH, cases + 1, cases + 1, frozenset(_SWITCH[: cases + 1])
        )
        for cases in range(2, 7)
    },
    **{
        f"BlackboardCheck{kind}": _of_values(Meaning.CHECK, *_CHECK, version=3)
        for kind in ("Int", "Double", "String", "Bool")
    },
    **{
        f"Loop{kind}": _of_values(Meaning.LOOP, "queue", "if_empty", "value", version=4)
        for kind in ("Int", "Bool", "Double", "String")
    },
}
"""All built-in nodes of BehaviorTree.CPP by their tag."""

NAV2: dict[str, Builtin] = {
    "PipelineSequence": _nav2(Meaning.PIPELINE, most=-1),
    "RecoveryNode": _nav2(
        Meaning.RECOVERY, "number_of_retries", least=2, most=2, integers=("number_of_retries",)
    ),
    "RoundRobin": _nav2(Meaning.ROUND_ROBIN, "wrap_around", most=-1),
    "NonblockingSequence": _nav2(Meaning.NONBLOCKING, most=-1),
    "PersistentSequence": _nav2(Meaning.MEMORY, "current_child_idx", most=-1),
    "RateController": _nav2(Meaning.GATE, "hz"),
    "DistanceController": _nav2(Meaning.GATE, "distance", "global_frame", "robot_base_frame"),
    "SpeedController": _nav2(
        Meaning.GATE, "min_rate", "max_rate", "min_speed", "max_speed", "filter_duration"
    ),
    "GoalUpdatedController": _nav2(Meaning.GATE),
    "GoalUpdater": _nav2(Meaning.PASS, "input_goal", "output_goal", "input_goals", "output_goals"),
    "PathLongerOnApproach": _nav2(Meaning.MAYBE, "path", "prox_len", "length_factor"),
    "SingleTrigger": _nav2(Meaning.SINGLE_TRIGGER, "is_global"),
}
"""The control nodes and decorators of Nav2 by their tag. With another number of children such
a name is a node of one's own."""

NAV2_CONDITIONS = frozenset(
    {
        *("GoalReached", "GoalUpdated", "GlobalUpdatedGoal", "IsGoalNearby", "ArePosesNear"),
        *("IsStuck", "IsStopped", "IsBatteryLow", "IsBatteryCharging", "IsPathValid"),
        *("TransformAvailable", "DistanceTraveled", "TimeExpired", "PathExpiringTimer"),
        *("InitialPoseReceived", "AreErrorCodesPresent", "IsWithinPathTrackingBounds"),
        *("WouldAControllerRecoveryHelp", "WouldAPlannerRecoveryHelp"),
        *("WouldASmootherRecoveryHelp", "WouldARouteRecoveryHelp"),
    }
)
"""The conditions of Nav2, which answer at once. A model in the file says otherwise."""


def builtin_of(name: str, children: int) -> Builtin | None:
    """The meaning of a name that a library has, for a node with so many children."""
    if name in BUILTINS:
        return BUILTINS[name]
    own = NAV2.get(name)
    fits = own is not None and own.least <= children and (own.most < 0 or children <= own.most)
    return own if fits else None


RESERVED = frozenset({"root", "Root", *BUILTINS})
"""Names that no tree and no node of one's own can have."""


def is_reference(text: str) -> bool:
    """True if a value is read from the blackboard: ``{goal}``.

    >>> is_reference("{goal}"), is_reference("go to {goal}")
    (True, False)
    """
    stripped = text.strip()
    return len(stripped) > 2 and stripped[0] == "{" and stripped[-1] == "}"
