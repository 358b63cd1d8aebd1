"""Runners: the interface that their authors implement, and the end of their coroutines.

A runner is loaded once per interface and provider, and asked to act once per instance. It works
against a ``RunContext`` and nothing else, so that the same code runs in virtual time and in real
time. See docs/runners.md for one in 20 lines.
"""

from __future__ import annotations

import random
from abc import ABC, abstractmethod
from contextlib import suppress
from dataclasses import dataclass, field
from math import isfinite
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import GpsfsmError
from gpsfsm.execution.records import Input, Kind

if TYPE_CHECKING:
    from collections.abc import Coroutine

    from gpsfsm.execution.records import RunValue

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Mapping

    from gpsfsm.execution.records import RunValue

    Logger = Callable[[str, Mapping[str, RunValue]], None]


_NO_DATA: Mapping[str, RunValue] = MappingProxyType({})


class RunnerError(GpsfsmError):
    """Raised by a runner whose action has failed. The message goes into the journal.

    ``outputs`` are passed on with FAILED if the provider declares them.
    """

    def __init__(self, message: str, **outputs: RunValue) -> None:
        super().__init__(message)
        self.outputs: Mapping[str, RunValue] = outputs


class InDoubtError(RunnerError):
    """Raised by a runner if nobody can say what its action still does outside.

    It has neither failed nor stopped: the run ends in doubt, and nothing is started any more.
    """


class StopRequested(BaseException):
    """Raised inside ``run`` when the instance is to stop. Clean up, and let it pass."""


@dataclass(frozen=True, slots=True)
class LoadContext:
    """The context in which a runner is loaded.

    ``services`` are the objects that runners share in one run, by name: ``world`` in a simulation,
    ``plans`` (the plan queue), ``prompts`` (the prompt buffers), ``model``.
    """

    interface: str
    provider: str
    services: Mapping[str, Any] = field(default_factory=dict)


@dataclass(slots=True)
class RunContext:
    """The context in which an instance acts.

    - ``element``: its element path.
    - ``key``: a name for this action that stays the same after a resume and differs from that of
      any other action. Send it to endpoints that must not do the same action twice.
    - ``random``: depends only on the seed of the run, the plan, the instance and its visit.
    - ``stop_requested``: true once the instance is to stop.
    - ``doubt``: to be set by a runner whose action goes on outside when nobody waits for it: says
      what may still happen there, "" for nothing. An instance that is to stop is waited for as long
      as it says something; may be called from any thread.
    """

    number: int
    element: str
    key: str
    random: random.Random
    sleeper: Callable[[float], Awaitable[None]]
    clock: Callable[[], float]
    logger: Logger
    stop_requested: bool = False
    doubt: Callable[[], str] = str

    @property
    def now_s(self) -> float:
        """Seconds since the run began, in the time of the run."""
        return self.clock()

    async def sleep(self, seconds: float) -> None:
        """Wait. Raises StopRequested if the instance is to stop in the meantime."""
        await self.sleeper(seconds)

    def log(self, text: str, data: Mapping[str, RunValue] = _NO_DATA) -> None:
        """Write a line into the journal, clipped to 10,000 characters.

        ``data`` has the same content for programs. Raises RunnerError if it cannot be written as
        JSON.
        """
        self.logger(text, data)


def visited(element: str, visit: int) -> str:
    """The name of one visit of an instance: its element path, from the second visit on with it."""
    return element if visit == 1 else f"{element}#{visit}"


def seeded(seed: int | str) -> random.Random:
    """A source of chance for simulations: the same seed, the same draws."""
    return random.Random(seed)  # noqa: S311  (no secret)


class Runner(ABC):
    """A runner. An exception that leaves ``run`` is a failure of the instance, not of the engine.

    ``idempotent``: if the process dies while an instance is active, the action may simply be
    repeated. Otherwise the instance counts as failed after a resume.
    """

    idempotent: bool = False

    async def start(self, context: LoadContext) -> None:
        """Prepare. An exception means that the runner could not be loaded."""
        del context

    @abstractmethod
    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        """Act and return the outputs. To fail, raise RunnerError or any other exception."""

    async def stop(self) -> None:  # noqa: B027
        """Release all resources: the runner is unloaded."""

    async def may_repeat(self, key: str) -> bool:
        """True if an action that was active when its process ended may be asked again.

        Called in the process that continues the run, before anything else happens in it. Raise
        InDoubtError if only a person can say: the run does not go on then, and can be resumed.
        """
        del key
        return self.idempotent

    async def left(self, key: str) -> str:
        """Stop what an action may still do outside after its process has ended.

        Called in the process that continues the run, before anything else happens in it, for each
        instance that was active and is not repeated. ``key`` is the ``RunContext.key`` of that
        action. Return a sentence about what was done; it is written into the journal.
        """
        del key
        return ""


_DEEPEST = 1_000  # coroutines that wait for each other


def close(awaited: Coroutine[Any, Any, Any]) -> bool:
    """Give a coroutine no further turn; whether it agrees, or goes on waiting all the same."""
    waiting: list[object] = []
    inner: object = awaited
    while inner is not None and len(waiting) < _DEEPEST:
        waiting.append(inner)
        inner = getattr(inner, "cr_await", None)
    try:
        awaited.close()
    except BaseException:  # it goes on waiting, or fails while it cleans up
        for kept in waiting:
            _keep_for_ever(kept)
        return all(getattr(kept, "cr_frame", None) is None for kept in waiting)
    return True


def _keep_for_ever(kept: object) -> None:
    """Never free an object, not even when the interpreter ends.

    Freeing a coroutine closes it once more; one that catches that and goes on in a loop would keep
    the process from ever ending.
    """
    import ctypes

    ctypes.pythonapi.Py_IncRef(ctypes.py_object(kept))


# ---- Outputs and words of a runner: values that JSON can hold, texts that can be written ---------


MAX_DEPTH = 4  # lists in lists
MAX_SIZE = 1_000_000  # of all outputs together: characters, and one for each value


def taken(outputs: object) -> dict[str, RunValue]:
    """A copy of the outputs of a runner, so that it cannot change them any more.

    Raises ValueError, which says what is wrong, if they are not outputs.
    """
    if outputs is None:
        return {}
    if not isinstance(outputs, dict):
        raise ValueError(f"it returned {type(outputs).__name__} and not outputs by name")
    try:
        return _taken(outputs)
    except ValueError:
        raise
    except Exception as error:  # a dictionary or text of the runner's own making
        raise ValueError(f"its outputs cannot be read ({type(error).__name__})") from None


def _taken(outputs: dict[object, object]) -> dict[str, RunValue]:
    left = MAX_SIZE
    copies: dict[str, RunValue] = {}
    for name, value in outputs.items():
        if not isinstance(name, str) or _unwritable(name):
            raise ValueError(f"the name of its output {name!r:.80} is no text")
        copied, left = _copied(value, left - len(name))
        if copied is None:
            raise ValueError(f"its output {clean(name, 80)!r} is no value that can be handed over")
        if left < 0:
            raise ValueError("its outputs are too long")
        copies[name] = copied
    return copies


def invalid(outputs: object) -> str:
    """The fault of the outputs of a runner; "" if there is none."""
    try:
        taken(outputs)
    except ValueError as error:
        return str(error)
    return ""


def checked(outputs: object) -> dict[str, RunValue]:
    """The same as ``taken``, but what is wrong is raised as a failure of the runner."""
    try:
        return taken(outputs)
    except ValueError as error:
        raise RunnerError(str(error)) from None


def failure(number: int, error: BaseException) -> Input:
    """The failure of an instance that raised an exception."""
    if not isinstance(error, RunnerError):
        return Input(Kind.FAILED, number, message=said(error))
    outputs: dict[str, RunValue] = {}
    with suppress(ValueError, RuntimeError, AttributeError):  # rubbish, or changed meanwhile
        outputs = taken(error.outputs)
    message = said(error).removeprefix(f"{type(error).__name__}: ")
    return Input(Kind.FAILED, number, outputs=outputs, message=message)


def _copied(value: object, left: int, depth: int = 0) -> tuple[RunValue | None, int]:
    """A copy (None if it is no value) and how much may still come; stops when that is negative."""
    left -= 1
    if isinstance(value, bool):
        return value, left
    if isinstance(value, str):
        left -= len(value)
        return ("" if left < 0 else None if _unwritable(value) else str(value)), left
    if isinstance(value, float):
        return (float(value) if isfinite(value) else None), left
    if isinstance(value, int):
        return (int(value) if abs(value) < 2**63 else None), left
    if not isinstance(value, list) or depth == MAX_DEPTH:
        return None, left
    items: list[RunValue] = []
    for item in value:
        copied, left = _copied(item, left, depth + 1)
        if copied is None or left < 0:
            return copied, left
        items.append(copied)
    return items, left


def _unwritable(text: str) -> bool:
    """True if a text holds half a character (a lone surrogate), which no file can hold."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return True
    return False


def clean(text: str, limit: int = 1000) -> str:
    """A text clipped and made writable."""
    return text[:limit].encode("utf-8", "backslashreplace").decode("utf-8")[:limit]


def said(error: BaseException) -> str:
    """An exception as a message; also one that cannot be put into words."""
    name = type(error).__name__
    try:
        text = str(error)
    except Exception:  # its own __str__ fails
        return clean(name)
    return clean(f"{name}: {text}" if text else name)
