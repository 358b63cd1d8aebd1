"""Runners: the interface that their authors implement, and the end of their coroutines.

A runner is loaded once per interface and provider, and asked to act once per instance. It works
against a ``RunContext`` and nothing else, so that the same code runs in virtual time and in real
time. See docs/runners.md for one in 20 lines.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import GpsfsmError

if TYPE_CHECKING:
    from collections.abc import Coroutine

if TYPE_CHECKING:
    import random
    from collections.abc import Awaitable, Callable, Mapping

    from gpsfsm.execution.records import RunValue

    Logger = Callable[[str, Mapping[str, RunValue]], None]


_NO_DATA: Mapping[str, RunValue] = MappingProxyType({})


class RunnerError(GpsfsmError):
    """Raised by a runner: its action has failed. The message goes into the journal.

    ``outputs`` are handed over with FAILED, as far as the provider declares them.
    """

    def __init__(self, message: str, **outputs: RunValue) -> None:
        super().__init__(message)
        self.outputs: Mapping[str, RunValue] = outputs


class StopRequested(BaseException):
    """Raised inside ``run`` when the instance is to stop. Clean up, and let it pass."""


@dataclass(frozen=True, slots=True)
class LoadContext:
    """What a runner gets when it is loaded.

    ``services`` are the objects that runners share in one run, by name: ``world`` in a simulation,
    ``plans`` (the plan queue), ``prompts`` (the prompt buffers), ``model``.
    """

    interface: str
    provider: str
    services: Mapping[str, Any] = field(default_factory=dict)


@dataclass(slots=True)
class RunContext:
    """What an instance gets when it is asked to act.

    ``element`` is its element path, ``key`` a name for this action that is the same after a resume
    and different for every other action (for endpoints that must not do a thing twice). ``random``
    depends on the seed of the run, the plan and the instance alone. ``stop_requested`` is true once
    the instance is to stop.
    """

    number: int
    element: str
    key: str
    random: random.Random
    sleeper: Callable[[float], Awaitable[None]]
    clock: Callable[[], float]
    logger: Logger
    stop_requested: bool = False

    @property
    def now_s(self) -> float:
        """Seconds since the run began, in the time of the run."""
        return self.clock()

    async def sleep(self, seconds: float) -> None:
        """Let time pass. Raises StopRequested if the instance is to stop meanwhile."""
        await self.sleeper(seconds)

    def log(self, text: str, data: Mapping[str, RunValue] = _NO_DATA) -> None:
        """Write a line into the journal, clipped to 10,000 characters.

        ``data`` say the same for programs, which read no texts. Raises RunnerError if they are
        nothing that can be written down.
        """
        self.logger(text, data)


class Runner(ABC):
    """A runner. An exception that leaves ``run`` is a failure of the instance, not of the engine.

    ``idempotent``: an instance that was active when the process died may simply be asked again;
    otherwise it counts as failed after a resume.
    """

    idempotent: bool = False

    async def start(self, context: LoadContext) -> None:  # noqa: B027  (nothing to do for most)
        """Get ready. An exception means that the runner could not be loaded."""

    @abstractmethod
    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        """Act, and return the outputs. Raise RunnerError, or anything else, to fail."""

    async def stop(self) -> None:  # noqa: B027
        """Let go of everything: the runner is unloaded."""


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
