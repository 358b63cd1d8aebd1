"""Runners that do what they must not, for the tests of drivers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.execution.records import Kind, Status
from gpsfsm.execution.runner import Runner
from tests.execution.support import Listing, compiled_of, drive
from tests.oracle import plan, rec

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.execution.records import Record, RunValue
    from gpsfsm.execution.runner import RunContext
    from gpsfsm.execution.virtual import VirtualDriver


class Doing(Runner):
    """A runner that does what a function says."""

    def __init__(self, act: Callable[..., Any]) -> None:
        self.act = act

    def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> Any:
        return self.act(parameters, context)


class Fine(Runner):
    """A runner that takes a second."""

    seconds = 1.0

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        await context.sleep(self.seconds)


class Quick(Fine):
    seconds = 0.001


def makes(act: Callable[..., Any], others: type[Runner] = Fine) -> Callable[[str, str], Runner]:
    """A misbehaves, the others are fine."""
    return lambda interface, provider: Doing(act) if interface == "A" else others()


GUARDED = plan("A", rec("B"), "C")


def guarded(act: Callable[..., Any], **options: Any) -> tuple[Record, Listing, VirtualDriver]:
    """A run in which A misbehaves and B saves the plan; how A has failed."""
    sink, driver = drive(compiled_of(GUARDED), makes(act), **options)
    assert driver.kernel.status is Status.COMPLETED
    (failed,) = [record for record in sink.records if record.kind is Kind.FAILED]
    assert failed.node == 1
    return failed, sink, driver


class Foreign:
    def __await__(self) -> Any:
        yield 42


def sleeping(seconds: float) -> Callable[..., Any]:
    async def act(parameters: object, context: RunContext) -> None:
        while True:
            await context.sleep(seconds)

    return act
