"""The calls by which SMACH and FlexBE build machines, and the states that they leave.

Containers keep the very dictionaries of transitions and outcomes that they are handed, as both
libraries do: what the program does to them later changes the machine.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, TypeGuard

from gpsfsm.compile.formats.python_values import UNKNOWN, Bound, Function, Instance, Library
from gpsfsm.compile.formats.states import State
from gpsfsm.model.plan import Location
from gpsfsm.model.precision import Approximation, Cause, Reading

if TYPE_CHECKING:
    import ast
    from collections.abc import Iterator

    from gpsfsm.compile.machines import Place

MOST_COPIES: Final = 5_000
SEQUENTIAL = ("StateMachine", "OperatableStateMachine", "PriorityContainer", "Sequence")
PARALLEL = ("Concurrence", "ConcurrencyContainer")
CONTAINERS = (*SEQUENTIAL, *PARALLEL)
FLEXBE = ("OperatableStateMachine", "PriorityContainer", "ConcurrencyContainer")
PREEMPTED = "preempted"
_ACTION = ("succeeded", "aborted", "preempted")
STATES: Final[Mapping[str, tuple[str, ...]]] = {
    "State": (),
    "CBState": (),
    "SimpleActionState": _ACTION,
    "ServiceState": _ACTION,
    "MonitorState": ("valid", "invalid", "preempted"),
    "ConditionState": ("true", "false", "preempted"),
    "EventState": (),
    "MockState": (),
}
"""The states of the libraries, and the outcomes that they have besides those of their call."""
_KEYS = ("input_keys", "output_keys")
_CONCURRENCE = (
    *("outcomes", "default_outcome", *_KEYS),
    *("outcome_map", "outcome_cb", "child_termination_cb"),
)
_SIGNATURES: Final[Mapping[str, tuple[str, ...]]] = {
    "StateMachine": ("outcomes", *_KEYS),
    "OperatableStateMachine": ("outcomes", *_KEYS),
    "PriorityContainer": ("outcomes", *_KEYS),
    "Sequence": ("outcomes", "connector_outcome", *_KEYS),
    "Concurrence": _CONCURRENCE,
    "ConcurrencyContainer": ("conditions", "outcomes", *_KEYS),
    "StateMachine.add": ("label", "state", "transitions", "remapping", "constants"),
    "Sequence.add": ("label", "state", "transitions", "remapping"),
    "Concurrence.add": ("label", "state", "remapping"),
    "OperatableStateMachine.add": ("label", "state", "transitions", "autonomy", "remapping"),
    "StateMachine.add_auto": (
        *("label", "state", "connector_outcomes", "transitions", "remapping", "constants"),
    ),
}
_SKIPPED = ("remapping", "autonomy", "constants", *_KEYS)
HARMLESS_METHODS = frozenset(
    {"execute", "async_execute", "request_preempt", "preempt_requested", "service_preempt"}
    | {"recall_preempt", "is_running", "get_active_states", "is_opened", "set_name", "userdata"}
    | {"get_registered_outcomes", "get_initial_states", "check_consistency", "name", "confirm"}
    | {"register_start_cb", "register_transition_cb", "register_termination_cb"}
    | {"initialize_ros", "initialize_flexbe_core"}
)
"""Attributes of a container by which a program does not change it."""


Arguments = tuple[list[Any] | None, dict[str, Any]]
"""The arguments of a call; None where a star hides which they are."""


@dataclass(slots=True, eq=False, kw_only=True)
class Container(Instance):
    """A container and its entries in the order in which they are added."""

    place: Place
    entries: list[Entry] = field(default_factory=list)
    policy: dict[str, Any] = field(default_factory=dict)
    initial: str = ""
    connectors: tuple[str, ...] = ()  # of add_auto: they lead to the next state
    branch: tuple[int, ...] = ()  # where only a run knows whether it is made
    torn: ast.AST | None = None  # a try statement that may leave before all is added
    lost: bool = False

    @property
    def parallel(self) -> bool:
        """True for a concurrence."""
        return self.kind in PARALLEL

    def within(self) -> Iterator[Container]:
        """The container and all in it."""
        pending = [self]
        while pending:
            each = pending.pop()
            yield each
            pending += [e.state for e in each.entries if isinstance(e.state, Container)]


@dataclass(slots=True, eq=False)
class Entry:
    """A state in its container."""

    label: str
    place: Place
    state: Any
    kind: str
    transitions: dict[str, Any]
    preempts: bool = False


class Builder(ABC):
    """The containers of a program. The interpreter says of each call where it is."""

    def __init__(self) -> None:
        self.branch: tuple[int, ...] = ()  # the paths around that only a run decides
        self.containers: list[Container] = []  # in the order in which they are made
        self.lost: dict[int, Any] = {}  # what code may have changed that is not followed
        self.sources: dict[
            int, tuple[Any, ...]
        ] = {}  # views and iterators, and what they go through
        self.executed: list[Container] = []
        self.open: list[Container] = []  # those to which states are added, the innermost last
        self.shared: set[int] = set()  # dictionaries that were transitions of a state of FlexBE
        self.notes: dict[tuple[str, Cause], Approximation] = {}
        self.copies = 0

    @abstractmethod
    def fault(self, node: ast.AST, message: str, hint: str) -> None:
        """Refuse the program, at a place."""

    @abstractmethod
    def place(self, node: ast.AST) -> Place:
        """The place of a node of the syntax tree."""

    @abstractmethod
    def later(self, value: Any) -> None:
        """A value may be a function that is called later."""

    @abstractmethod
    def certain(self, value: Any) -> bool:
        """True if the program gets here wherever it makes a value."""

    def note(self, reading: Reading, construct: str, node: ast.AST | Place, cause: Cause) -> None:
        """Something that is skipped or assumed; of each kind, the first place is enough."""
        self.notes.setdefault((construct, cause), _approximation(reading, construct, node, cause))

    def stale(self, rows: Any) -> bool:
        """True if what a loop goes through is not certain any more."""
        return any(id(each) in self.lost for each in (rows, *self.sources.get(id(rows), ())))

    def settled(self, value: Any) -> Any:
        """A value in which all is UNKNOWN that a call may have changed."""
        if id(value) in self.lost:
            return UNKNOWN
        if isinstance(value, list | tuple):
            return [self.settled(each) for each in value]
        if isinstance(value, dict):
            return {key: self.settled(each) for key, each in value.items()}
        return value

    def _arguments(
        self, name: str, node: ast.Call, arguments: list[Any], keywords: dict[str, Any]
    ) -> dict[str, Any] | None:
        """The arguments by name; None if they do not fit."""
        names = _SIGNATURES[name]
        strange = [each for each in keywords if each not in names]
        if len(arguments) > len(names) or strange or {*names[: len(arguments)]} & {*keywords}:
            what = f"the argument {strange[0]!r}" if strange else "the arguments"
            self.fault(node, f"{what} of {name} cannot be read", "write them as documented")
            return None
        values = {**dict(zip(names, arguments, strict=False)), **keywords}
        for each in (*_SKIPPED, "outcome_cb", "child_termination_cb"):
            if each in _SKIPPED and values.get(each):
                self.note(Reading.SKIPPED, each, node, Cause.NO_MEANING)
            self.later(values.get(each))
        return values

    def describe(
        self, made: Container, node: ast.Call, arguments: list[Any], keywords: dict[str, Any]
    ) -> None:
        """Read the call of a container's class."""
        if made.kind == "ConcurrencyContainer" and "conditions" in keywords:
            arguments = [keywords.pop("conditions"), *arguments]
        values = self._arguments(made.kind, node, arguments, keywords)
        if values is None:
            return
        made.policy = values
        outcomes = self.settled(values.get("outcomes", []))
        if not texts(outcomes):
            message = "the outcomes of this container are not written in the source"
            self.fault(node, message, "write them as a list of texts")
            return
        made.outcomes, made.open = tuple(dict.fromkeys(outcomes)), False
        if made.kind == "Sequence" and not isinstance(values.get("connector_outcome"), str):
            message = "the outcome that connects this sequence is not written in the source"
            self.fault(node, message, "write it out")

    def reachable(self, node: ast.AST, owner: Container, what: str) -> bool:
        """True if the program certainly gets here wherever it makes the container."""
        if owner.branch[: len(self.branch)] != self.branch:
            message = f"whether {what} is decided only when the program runs"
            self.fault(node, message, "add it without a condition, for each one by itself")
        elif any(owner in each.within() for each in self.executed):
            self.fault(node, "this machine is changed after it is executed", "build it before")
        else:
            return True
        return False

    def begin_with(self, node: ast.Call, owner: Container, arguments: list[Any]) -> None:
        """``set_initial_state``."""
        first = self.settled(arguments[0]) if arguments else UNKNOWN
        first = first[0] if isinstance(first, list) and first else first
        if not isinstance(first, str):
            self.fault(node, "the first state is not written in the source", "write it")
        elif self.reachable(node, owner, f"the first state is {first!r}"):
            owner.initial = first

    def initialised(self, made: Any, base: str, node: ast.Call, passed: Arguments) -> None:
        """``__init__`` of a class of the library."""
        arguments, keywords = passed
        if isinstance(made, Container) and base in CONTAINERS:
            if arguments is None:
                message = "the outcomes of this container are not written in the source"
                self.fault(node, message, "write them out")
            elif self.reachable(node, made, "the container has these outcomes"):
                self.describe(made, node, arguments, dict(keywords))
        elif isinstance(made, Instance) and base in STATES:
            self.declare(made, base, passed)

    def declare(self, made: Instance, base: str, passed: Arguments) -> None:
        """The outcomes that a state declares to its base class."""
        arguments, keywords = passed
        position = {"State": 0, "EventState": 0, "CBState": 3}.get(base, 9)
        rows = (arguments or [])[position : position + 1] or [[]]
        written = self.settled(keywords.get("outcomes", rows[0]))
        callback = keywords.get("cb", arguments[0] if arguments else UNKNOWN)
        callback = callback.function if isinstance(callback, Bound) else callback
        own = tuple(written) if texts(written) else ()
        made.outcomes = tuple(dict.fromkeys((*STATES[base], *own)))
        made.open = arguments is None or not texts(written) or not self.certain(made)
        made.open |= base == "CBState" and not isinstance(callback, Function)
        for each in (*(arguments or ()), *keywords.values()):
            self.later(each)

    def opened(self, owner: Container, name: str, node: ast.Call, arguments: list[Any]) -> Any:
        """A method of a container that opens or closes it, or says where it begins."""
        if name in ("set_initial_state", "initial_state"):
            self.begin_with(node, owner, arguments)
        elif name == "opened" and not node.keywords:
            return owner
        elif not self.reachable(node, owner, "this container is open"):
            pass
        elif name == "open":
            self.open.append(owner)
        elif name == "close" and self.open[-1:] == [owner]:
            self.open.pop()
        else:
            self.fault(node, f"{name}() does not fit here", "open containers with: with sm:")
        return UNKNOWN

    def add(self, name: str, node: ast.Call, arguments: list[Any], keywords: dict[str, Any]) -> Any:
        """A call of ``add`` or ``add_auto``, by the class that it is called of."""
        kind, _, method = name.partition(".")
        signature = f"OperatableStateMachine.{method}" if kind in FLEXBE else name
        signature = "StateMachine.add_auto" if method == "add_auto" else signature
        values = self._arguments(signature, node, arguments, keywords)
        if values is None:
            return UNKNOWN
        label, state = self.settled(values.get("label", UNKNOWN)), values.get("state", UNKNOWN)
        if not isinstance(label, str):
            self.fault(node, "the name of this state is not written in the source", "write it")
            return UNKNOWN
        if not self.open:
            self.fault(node, f"{label!r} is added while no container is open", "open one: with sm:")
            return UNKNOWN
        owner = self.open[-1]
        fits = owner.kind in FLEXBE if kind in FLEXBE else owner.kind == kind
        if not fits or (isinstance(state, Container) and owner in state.within()):
            message = f"{label!r} would contain itself" if fits else f"{kind}.add in a {owner.kind}"
            self.fault(node, message, "add another container" if fits else "use its own add")
            return UNKNOWN
        transitions = values.get("transitions")
        transitions = {} if transitions is None else transitions
        if not self._written(node, label, transitions, state):
            return UNKNOWN
        if self.reachable(node, owner, f"{label!r} is added"):
            entry = Entry(label, self.place(node), state, self._kind(node, label), transitions)
            self._register(node, owner, entry)
            if method == "add_auto":
                self._connect(node, owner, entry, self.settled(values.get("connector_outcomes")))
        return state

    def _written(self, node: ast.Call, label: str, transitions: Any, state: Any) -> bool:
        """True if the transitions and the state are written so that they can be read."""
        rows = self.settled(transitions)
        if not isinstance(rows, dict) or not all(
            isinstance(key, str) and (each is None or isinstance(each, str))
            for key, each in rows.items()
        ):
            message = f"the transitions of {label!r} are not written in the source"
            self.fault(node, message, "write them as a dictionary of texts")
        elif not isinstance(state, Instance | Library) and state is not UNKNOWN:
            self.fault(node, f"{label!r} is no state", "add an object of a class of states")
        elif isinstance(state, Instance) and not state.open:
            strange = next((each for each in rows if each not in state.outcomes), None)
            if strange is None or strange == PREEMPTED:
                return True
            message = f"{label!r} declares no outcome {strange!r}"
            self.fault(node, message, "declare it, or remove its transition")
        else:
            return True
        return False

    def _kind(self, node: ast.Call, label: str) -> str:
        import ast

        from gpsfsm.compile.formats.python_values import dotted

        made = node.args[1] if len(node.args) > 1 else None
        name = dotted(made.func).removeprefix("self.") if isinstance(made, ast.Call) else ""
        return name or label

    def _register(self, node: ast.Call, owner: Container, entry: Entry) -> None:
        """Change the dictionary of transitions in place, as the library does."""
        transitions, state = entry.transitions, entry.state
        open_state = not isinstance(state, Instance) or state.open
        if owner.kind in FLEXBE:
            written = PREEMPTED in transitions and id(transitions) not in self.shared
            entry.preempts = written or (not open_state and PREEMPTED in state.outcomes)
            transitions[PREEMPTED] = PREEMPTED
            self.shared.add(id(transitions))
        elif not owner.parallel and not open_state:
            for outcome in state.outcomes:
                transitions.setdefault(outcome, None)
        if owner.kind == "Sequence" and owner.entries:
            connector, before = owner.policy["connector_outcome"], owner.entries[-1].transitions
            if before.get(connector) is None:
                before[connector] = entry.label
        for connector in owner.connectors:
            before = owner.entries[-1].transitions
            if before.get(connector):  # the documentation and the code of SMACH say the opposite
                message = f"{connector!r} leads to the next state and to {before[connector]!r}"
                self.fault(node, message, "remove one of them")
            before[connector] = entry.label
        owner.connectors = ()
        owner.initial = owner.initial or entry.label
        owner.entries.append(entry)

    def _connect(self, node: ast.Call, owner: Container, entry: Entry, connectors: Any) -> None:
        if not texts(connectors):
            message = "the outcomes that connect this state to the next one are not written"
            self.fault(node, message, "write them as a list of texts")
            return
        state = entry.state
        if isinstance(state, Instance) and not state.open and {*connectors} - {*state.outcomes}:
            self.fault(node, f"{entry.label!r} does not declare {connectors}", "declare them")
        owner.connectors = tuple(connectors)

    # -- the result -------------------------------------------------------------------------

    def state_of(self, made: Container) -> State:
        """A container as a state, with all states in it."""
        result = State(made.kind, made.place, kind=made.kind, container=True)
        result.outcomes, result.parallel = made.outcomes, made.parallel
        result.initial, result.early = made.initial, made.kind == "ConcurrencyContainer"
        self._decide(made, result)
        for entry in made.entries:
            self.copies += 1
            if self.copies > MOST_COPIES:
                return result
            result.states.append(self._entry(made, result, entry))
        preempting = [each.name for each in result.states if PREEMPTED in each.transitions]
        if made.kind in FLEXBE and preempting:
            result.outcomes = tuple(dict.fromkeys((*result.outcomes, PREEMPTED)))
        if result.early:
            result.rules[:0] = [(PREEMPTED, {name: PREEMPTED}) for name in preempting]
        return result

    def _entry(self, made: Container, around: State, entry: Entry) -> State:
        state, transitions = entry.state, dict(entry.transitions)
        preempts = entry.preempts
        if isinstance(state, Container):
            result = self.state_of(state)
            result.name, result.place = entry.label, entry.place
            preempts |= PREEMPTED in result.outcomes
        else:
            result = State(entry.label, entry.place, kind=entry.kind)
            if isinstance(state, Instance):
                result.kind, result.outcomes = state.kind, state.outcomes
                result.parameters = dict(state.parameters)
        if made.kind in FLEXBE and not preempts:
            transitions.pop(PREEMPTED, None)
            self.note(Reading.DEFAULTED, PREEMPTED, made.place, Cause.PREEMPTION)
        if isinstance(state, Instance) and not state.open:
            transitions = {key: e for key, e in transitions.items() if e and key in result.outcomes}
        if not isinstance(state, Container):
            if made.kind in FLEXBE and not result.outcomes:
                result.outcomes = tuple(transitions)
            if result.kind.endswith("use_behavior"):
                result.marks = (_over("use_behavior", entry.place, Cause.ELSEWHERE),)
            elif made.kind not in FLEXBE and (not isinstance(state, Instance) or state.open):
                self._undeclared(made, around, result, transitions)
        result.transitions = {} if made.kind == "Concurrence" else transitions
        return result

    def _undeclared(
        self, made: Container, around: State, result: State, transitions: dict[str, Any]
    ) -> None:
        """The outcomes that only the class of a state declares, which is in another file."""
        if made.kind == "Concurrence":
            rules = around.rules
            spoken = [rows[result.name] for _, rows in rules if result.name in rows]
            result.undeclared = ("*",) if spoken else ()
            result.outcomes = tuple(dict.fromkeys((*result.outcomes, *spoken)))
            return
        wanted = {*result.outcomes, *transitions}
        result.undeclared = tuple(each for each in made.outcomes if each not in wanted)
        connector = made.policy.get("connector_outcome")
        if connector in transitions and connector not in result.outcomes:
            result.undeclared += (connector,)
        transitions |= {each: each for each in result.undeclared if each not in transitions}

    def _decide(self, made: Container, result: State) -> None:
        """Read the end of a concurrence."""
        policy = made.policy
        if made.kind == "Concurrence":
            default, rules = policy.get("default_outcome", ""), policy.get("outcome_map", {})
            rules = self.settled(rules)
            result.default = default if isinstance(default, str) else ""
            literal = isinstance(rules, dict) and all(
                isinstance(each, dict) and all(isinstance(e, str) for e in (key, *each.values()))
                for key, each in rules.items()
            )
            # Of several rules that hold ROS 2 takes the last; ROS 1 the first with most criteria.
            rows = list(rules.items()) if literal else []
            result.rules = rows[::-1]
            result.rules_before = sorted((e for e in rows if e[1]), key=lambda e: -len(e[1]))
            callbacks = [policy.get(each) for each in _CONCURRENCE[-2:]]
            result.open_end = (
                not literal or not result.default or any(each is not None for each in callbacks)
            )
            entries = made.entries
            if (
                not _decides_once(callbacks[1])
                and len(entries) > 2
                and any(isinstance(each.state, Container) for each in entries)
            ):
                message = "which children child_termination_cb stops is decided only in a run"
                self._refuse(made, message)
        elif made.kind == "ConcurrencyContainer":
            rows = self.settled(policy.get("conditions", []))
            for each in rows if isinstance(rows, list) else [None]:
                if not _is_condition(each):
                    message = "the conditions of this container are not written in the source"
                    self._refuse(made, message)
                    return
                result.rules.append((each[0], dict(each[1])))

    def _refuse(self, made: Container, message: str) -> None:
        import ast

        node = ast.Pass(lineno=made.place.line, col_offset=made.place.column - 1)
        self.fault(node, message, "write them out")


def texts(value: Any) -> TypeGuard[list[str]]:
    """True for a list of texts."""
    return isinstance(value, list) and all(isinstance(each, str) for each in value)


def _decides_once(callback: Any) -> bool:
    """True if a callback only says whether all others are stopped, never which of them."""
    import ast

    if callback is None:
        return True
    function = callback.function if isinstance(callback, Bound) else callback
    if not isinstance(function, Function):
        return False
    if isinstance(function.node, ast.Lambda):
        answers: list[Any] = [function.node.body]
    else:
        answers = [e.value for e in ast.walk(function.node) if isinstance(e, ast.Return)]
    plain = (bool, type(None))
    return all(
        each is None
        or isinstance(each, ast.Compare)
        or (isinstance(each, ast.Constant) and isinstance(each.value, plain))
        for each in answers
    )


def _is_condition(row: Any) -> TypeGuard[list[Any]]:
    return (
        isinstance(row, list)
        and len(row) == 2
        and isinstance(row[0], str)
        and isinstance(row[1], list)
        and all(
            isinstance(each, list) and len(each) == 2 and all(isinstance(e, str) for e in each)
            for each in row[1]
        )
    )


def _over(construct: str, place: Place, cause: Cause) -> Approximation:
    return _approximation(Reading.OVER, construct, place, cause)


def _approximation(
    reading: Reading, construct: str, at: ast.AST | Place, cause: Cause
) -> Approximation:
    line = getattr(at, "line", 0) or getattr(at, "lineno", 1)
    column = getattr(at, "column", 0) or getattr(at, "col_offset", 0) + 1
    return Approximation(reading, construct, Location(line, column, "/machine"), cause)
