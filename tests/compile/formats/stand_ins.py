"""Stand-ins of SMACH and FlexBE that only record what a program builds, in a process of its own.

It reads programs from its input, one JSON text a line, runs each in three worlds, and writes what
was built in each, or null where the program raises an exception. In the worlds ``get_param``
answers differently, and code that is elsewhere (``foo``, ``my_pkg``) does the worst it can: it
changes what it is handed, adds a state to the container that is open, or raises an exception.

Written from the documentation of both libraries and from what they did when they were run; the
dictionaries of transitions are kept, not copied, as in the libraries.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import signal
import sys
from types import ModuleType, SimpleNamespace
from typing import Any, ClassVar


class EndlessError(BaseException):
    """A program that does not end."""


def _endless(*_: Any) -> None:
    raise EndlessError


class World:
    """A world: what is not in the program, and what has been built."""

    def __init__(self, number: int) -> None:
        self.number = number
        self.open: list[Any] = []
        self.made: list[Any] = []
        self.executed: list[Any] = []

    def param(self, *_: Any, **__: Any) -> Any:
        if self.number == 2:
            raise KeyError
        return self.number == 0

    def foo(self, *values: Any, **named: Any) -> Any:
        if self.number == 1:
            raise ValueError
        for value in (*values, *named.values()):
            if isinstance(value, list):
                value.reverse()
            elif isinstance(value, dict):
                for key in value:
                    value[key] = "A"
            elif callable(value) and not isinstance(value, type):
                with contextlib.suppress(TypeError):
                    value()
        if self.open:
            self.open[-1]._add("HELP", State(["succeeded"]), {"succeeded": "A"})
        return "A"


WORLD = World(0)


class State:
    """A state, by its outcomes."""

    def __init__(self, outcomes: Any = (), *_: Any, **__: Any) -> None:
        self._outcomes = list(dict.fromkeys(outcomes))

    def register_outcomes(self, outcomes: Any) -> None:
        self._outcomes += [each for each in outcomes if each not in self._outcomes]

    def get_registered_outcomes(self) -> tuple[str, ...]:
        return tuple(self._outcomes)


class CBState(State):
    def __init__(self, cb: Any, cb_args: Any = (), outcomes: Any = (), **_: Any) -> None:
        super().__init__(outcomes)


class SimpleActionState(State):
    more: ClassVar[list[str]] = ["succeeded", "aborted", "preempted"]

    def __init__(self, *_: Any, outcomes: Any = (), **__: Any) -> None:
        super().__init__([*self.more, *outcomes])


class ServiceState(SimpleActionState):
    pass


class MonitorState(SimpleActionState):
    more: ClassVar[list[str]] = ["valid", "invalid", "preempted"]


class X(State):
    """A state of a class that the program does not say."""

    def __init__(self, *_: Any, **__: Any) -> None:
        super().__init__(["succeeded", "failed", "reached"])


class Y(X):
    pass


class StateMachine(State):
    flexbe = False

    def __init__(self, outcomes: Any, input_keys: Any = (), output_keys: Any = ()) -> None:
        super().__init__(outcomes)
        self._states: dict[str, Any] = {}
        self._transitions: dict[str, Any] = {}
        self._initial: str | None = None
        self._connectors: Any = ()
        self._last: str | None = None
        self.userdata = ModuleType("userdata")
        WORLD.made.append(self)

    def __enter__(self) -> Any:
        WORLD.open.append(self)
        return self

    def __exit__(self, *_: Any) -> None:
        WORLD.open.pop()

    def open(self) -> None:
        self.__enter__()

    def close(self) -> None:
        self.__exit__()

    def set_initial_state(self, labels: Any, *_: Any) -> None:
        self._initial = labels[0]

    def execute(self, *_: Any) -> str:
        if not self._states:
            raise ValueError(self)
        WORLD.executed.append(self)
        return "succeeded"

    def _add(self, label: Any, state: Any, transitions: Any) -> Any:
        transitions = {} if transitions is None else transitions
        if not isinstance(label, str) or label in self._states or not isinstance(state, State):
            raise ValueError(label)
        if self.flexbe:
            transitions["preempted"] = "preempted"
        else:
            if not all(each in state.get_registered_outcomes() for each in transitions):
                raise ValueError(transitions)
            for each in state.get_registered_outcomes():
                transitions.setdefault(each, None)
        self._initial = self._initial or label
        self._states[label], self._transitions[label] = state, transitions
        if self._last is not None:
            for each in self._connectors:
                self._transitions[self._last][each] = label
        self._connectors, self._last = (), None
        return state

    @staticmethod
    def add(label: Any, state: Any, transitions: Any = None, remapping: Any = None) -> Any:
        return WORLD.open[-1]._add(label, state, transitions)

    @staticmethod
    def add_auto(label: Any, state: Any, connector_outcomes: Any, transitions: Any = None) -> Any:
        here = WORLD.open[-1]
        here._add(label, state, transitions)
        if not all(each in state.get_registered_outcomes() for each in connector_outcomes):
            raise ValueError(connector_outcomes)
        here._connectors, here._last = connector_outcomes, label
        return state


class Sequence(StateMachine):
    def __init__(self, outcomes: Any, connector_outcome: Any) -> None:
        super().__init__(outcomes)
        self._connector = connector_outcome

    @staticmethod
    def add(label: Any, state: Any, transitions: Any = None, remapping: Any = None) -> Any:
        here = WORLD.open[-1]
        if here._states:
            before = here._transitions[list(here._states)[-1]]
            if before.get(here._connector) is None:
                before[here._connector] = label
        return here._add(label, state, transitions)


class Concurrence(StateMachine):
    def __init__(self, outcomes: Any, default_outcome: Any, outcome_map: Any = None) -> None:
        super().__init__(outcomes)
        self._map = {} if outcome_map is None else outcome_map
        self._default = default_outcome
        if default_outcome not in outcomes or not all(each in outcomes for each in self._map):
            raise ValueError(default_outcome)

    @staticmethod
    def add(label: Any, state: Any, remapping: Any = None) -> Any:
        return WORLD.open[-1]._add(label, state, {})


class OperatableStateMachine(StateMachine):
    flexbe = True

    @staticmethod
    def add(
        label: Any, state: Any, transitions: Any = None, autonomy: Any = None, remapping: Any = None
    ) -> Any:
        return WORLD.open[-1]._add(label, state, transitions)


class ConcurrencyContainer(OperatableStateMachine):
    def __init__(self, outcomes: Any = (), conditions: Any = ()) -> None:
        super().__init__(outcomes)
        self._rows = [[row[0], dict(row[1])] for row in conditions]


class Behavior:
    def add_parameter(self, name: str, value: Any) -> None:
        setattr(self, name, value)


def shown(made: Any, depth: int = 0) -> Any:
    """A container as JSON: initial state, outcomes, states with the transitions that are set.

    Of a concurrence also its rules, and its default outcome.
    """
    states = []
    for label, state in made._states.items() if depth < 9 else ():
        inner = shown(state, depth + 1) if isinstance(state, StateMachine) else None
        rows = {key: to for key, to in made._transitions[label].items() if to}
        if not all(isinstance(each, str) for each in (*rows, *rows.values())):
            raise ValueError(rows)
        if made.flexbe:
            rows.pop("preempted")
        states.append([label, rows, sorted(state.get_registered_outcomes()), inner])
    rules = [[key, dict(each)] for key, each in getattr(made, "_map", {}).items()]
    rules = getattr(made, "_rows", rules)
    default = getattr(made, "_default", "")
    return [made._initial, sorted(made.get_registered_outcomes()), states, [rules, default]]


def modules(world: World) -> dict[str, ModuleType]:
    """The modules that a program may import."""
    result = {name: ModuleType(name) for name in ("smach", "smach_ros", "flexbe_core", "rospy")}
    result |= {name: ModuleType(name) for name in ("my_pkg", "my_pkg.common")}
    smach = [StateMachine, Sequence, Concurrence, State, CBState]
    ros = [SimpleActionState, ServiceState, MonitorState]
    for name, rows in (("smach", smach), ("smach_ros", ros)):
        result[name].__dict__.update({each.__name__: each for each in rows})
    flexbe = {
        "Autonomy": SimpleNamespace(Off=0, Inherit=0),
        "Behavior": Behavior,
        "EventState": State,
    }
    result["flexbe_core"].__dict__.update(OperatableStateMachine=OperatableStateMachine, **flexbe)
    result["rospy"].__dict__.update(
        get_param=world.param, loginfo=lambda *_: None, init_node=lambda *_: None
    )
    result["flexbe_core"].__dict__.update(
        ConcurrencyContainer=ConcurrencyContainer,
        PriorityContainer=OperatableStateMachine,
        Logger=SimpleNamespace(REPORT_HINT=1),
    )
    for name in ("Drive", "Wait", "Log"):
        for package in ("my_states", "flexbe_states"):
            module = f"{package}.{name.lower()}_state"
            result |= {package: ModuleType(package), module: ModuleType(module)}
            result[module].__dict__[f"{name}State"] = X
    result["my_pkg"].__dict__.update(common=result["my_pkg.common"])
    result["my_pkg.common"].__dict__.update(helper=world.foo, FLAG=world.number == 0)
    return result


def built(program: str, number: int) -> Any:
    """The machine that a program builds in a world; None if it raises an exception."""
    global WORLD  # noqa: PLW0603  (the stand-ins are classes)
    WORLD = World(number)
    before = {key: getattr(StateMachine, key) for key in ("add", "add_auto")}
    sys.modules.update(modules(WORLD))
    names: dict[str, Any] = {"__name__": "__main__", "X": X, "Y": Y, "foo": WORLD.foo}
    signal.signal(signal.SIGALRM, _endless)
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            exec(compile(program, "program", "exec"), names)  # noqa: S102  (our own programs)
            top = WORLD.executed[-1:]
            for each in list(names.values()) if not top else ():
                if isinstance(each, type) and issubclass(each, Behavior) and each is not Behavior:
                    top = [each().create()]
        inner = [state for each in WORLD.made for state in each._states.values()]
        tops = top or [each for each in WORLD.made if each not in inner and each._states]
        return shown(tops[-1]) if tops and tops[-1]._states else None
    except BaseException:
        return None
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        for key, value in before.items():
            setattr(StateMachine, key, staticmethod(value))


if __name__ == "__main__":
    sys.unraisablehook = lambda _: None
    for line in os.fdopen(os.dup(0)):  # quit() closes the other
        rows = [built(json.loads(line), number) for number in range(3)]
        sys.stdout.write(json.dumps(rows) + "\n")
        sys.stdout.flush()
