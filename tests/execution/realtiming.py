"""What the tests of real time share: plans, runners made of functions, and runs."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.realtime import RealtimeDriver
from gpsfsm.execution.runner import Runner, RunnerError
from tests.execution.support import Listing, compiled_of

if TYPE_CHECKING:
    import threading
    from collections.abc import Callable, Mapping

    from gpsfsm.execution.records import Kind, RunValue
    from gpsfsm.execution.runner import LoadContext, RunContext

WAIT_S = 20.0  # a test that takes longer hangs


def runner(name: str) -> str:
    return f'<Runner interface="demo/{name}" provider="demo/{name}"/>'


def plan(*names: str, control: str = "") -> str:
    inner = "".join(map(runner, names))
    return (
        f'<Plan><Control type="{control}">{inner}</Control></Plan>'
        if control
        else (f"<Plan>{inner}</Plan>")
    )


def guarded(name: str, *recovery: str) -> str:
    inner = "".join(map(runner, recovery))
    return f'<Plan>{runner(name)}<Control type="recovery">{inner}</Control></Plan>'


class Diary:
    """Makes runners from functions, and writes down what becomes of them."""

    def __init__(self, **acts: Callable[[RunContext], Any]) -> None:
        self.acts = acts
        self.lines: list[str] = []

    def make(self, interface: str, provider: str) -> Runner:
        name = interface.partition("/")[2]
        diary = self

        class Made(Runner):
            async def start(self, context: LoadContext) -> None:
                diary.lines.append(f"start {name}")

            async def run(
                self, parameters: Mapping[str, RunValue], context: RunContext
            ) -> Mapping[str, RunValue] | None:
                result: Mapping[str, RunValue] | None = await diary.acts[name](context)
                return result

            async def stop(self) -> None:
                diary.lines.append(f"stop {name}")

        return Made()


async def go(
    text: str,
    make: Callable[[str, str], Runner],
    before: Callable[[RealtimeDriver], None] = lambda _: None,
    **options: Any,
) -> tuple[Listing, RealtimeDriver]:
    sink = Listing()
    driver = RealtimeDriver(Kernel(compiled_of(text)), sink, make, **options)
    before(driver)
    async with asyncio.timeout(WAIT_S):
        await driver.run()
    return sink, driver


def play(text: str, diary: Diary, **options: Any) -> tuple[Listing, RealtimeDriver]:
    return asyncio.run(go(text, diary.make, **options))


def messages(sink: Listing, kind: Kind) -> list[str]:
    return [record.message for record in sink.records if record.kind is kind]


def order(sink: Listing, *kinds: Kind) -> list[tuple[str, int]]:
    return [(str(record.kind), record.node) for record in sink.records if record.kind in kinds]


async def fine(context: RunContext) -> dict[str, RunValue]:
    await context.sleep(0.01)
    return {"answer": 42}


async def broken(context: RunContext) -> None:
    raise RunnerError("no grip", force=1.5)


async def for_ever(context: RunContext) -> None:
    await context.sleep(float("inf"))


def after(seconds: float) -> Callable[[RunContext], Any]:
    async def act(context: RunContext) -> None:
        await asyncio.sleep(seconds)

    return act


def once(event: threading.Event) -> Callable[[RunContext], Any]:
    """Succeeds once something has happened in another thread."""

    async def act(context: RunContext) -> None:
        while not event.is_set():
            await context.sleep(0.005)

    return act
