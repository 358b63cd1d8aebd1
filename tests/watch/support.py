"""Small runs to watch."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.compile import compile_plan
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.runner import RunContext, Runner, RunnerError
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.watch.moments import Moment, Tally, moments
from gpsfsm.watch.record_text import Words
from tests.support import plan_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from gpsfsm.execution.records import Input, Record, RunValue

__all__ = ["Nowhere", "Timed", "Watched", "runner", "watch"]


def runner(name: str = "Go", **parameters: str) -> str:
    """A runner that no capability file describes."""
    written = "".join(f' {key}="{value}"' for key, value in parameters.items())
    return f'<Runner interface="a/{name}" provider="a/{name}"{written}/>'


class Nowhere:
    """A sink that keeps nothing."""

    def write(self, *_: object) -> None:
        pass


class Timed(Runner):
    """Takes ``takes`` seconds; fails with ``message`` if there is one; says ``line``."""

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        if "line" in parameters:
            context.log(str(parameters["line"]))
        takes = parameters.get("takes", 1)
        assert isinstance(takes, int | float)
        await context.sleep(takes)
        if "message" in parameters:
            raise RunnerError(str(parameters["message"]))
        return None


class Watched:
    """A run that has ended: what was seen of it."""

    def __init__(self, text: str) -> None:
        self.kernel = Kernel(compile_plan(plan_of(text)))
        self.words = Words(self.kernel.automaton, self.kernel.runners)
        self.moments: list[Moment] = []
        self.tally = Tally()
        self.driver = VirtualDriver(self.kernel, Nowhere(), lambda *_: Timed())
        self.driver.watchers.append(self._see)

    def _see(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        self.moments += moments(at_us, happened, records)
        self.tally.add(at_us, records)


def watch(text: str, *watchers: Callable[[Watched], Callable[..., None]]) -> Watched:
    """Run a plan; each watcher is made for the run."""
    watched = Watched(text)
    watched.driver.watchers += [watcher(watched) for watcher in watchers]
    watched.driver.run()
    return watched
