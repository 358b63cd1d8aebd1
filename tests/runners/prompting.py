"""Plans whose prompts ask a scripted model, in real time and in a world."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from gpsfsm.capabilities.describe import specs
from gpsfsm.capabilities.library import bind, builtin_capabilities
from gpsfsm.compile import compile_plan
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.prompts import FillsWritten, PromptBuffers
from gpsfsm.execution.realtime import RealtimeDriver
from gpsfsm.execution.records import Input, Kind
from gpsfsm.execution.registry import Maker
from gpsfsm.generation.language_model import Answer
from gpsfsm.generation.loop import Judgement
from gpsfsm.generation.service import ModelService
from tests.support import plan_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from gpsfsm.execution.records import Record, RunValue
    from gpsfsm.generation.language_model import LanguageModel

LIBRARY = builtin_capabilities().library
WAIT_S = 20.0


def judge(answer: str) -> Judgement:
    """Accepts what has a Plan in it."""
    _, plan, rest = answer.partition("<Plan>")
    result = f"{plan}{rest}" if plan else ""
    return Judgement(bool(result), result, "no plan", errors=1, findings=(("GP1", "no plan"),))


def service(model: LanguageModel, **more: Any) -> ModelService:
    return ModelService(model, LIBRARY, judge, **more)


def messages(request: Any) -> str:
    return "\n".join(message.text for message in request.messages)


def timed(text: str, latency_s: float) -> Answer:
    return Answer(text, "m", latency_s=latency_s)


class Ran:
    """A run, and what came of its instances."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, Input, Sequence[Record]]] = []
        self.outputs: dict[int, Mapping[str, RunValue]] = {}
        self.messages: dict[int, str] = {}
        self.lines: list[str] = []
        self.prompts = PromptBuffers()
        self.kernel: Kernel

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        self.rows.append((at_us, happened, records))
        if happened.kind in (Kind.SUCCEEDED, Kind.FAILED):
            self.outputs[happened.number] = happened.outputs
            self.messages[happened.number] = happened.message
        if happened.kind is Kind.LOG:
            self.lines.append(happened.message)


def kernel_of(text: str) -> Kernel:
    parsed = plan_of(text)
    return Kernel(compile_plan(parsed, bindings=bind(parsed, LIBRARY)))


def run_real(
    text: str,
    model: LanguageModel | None,
    *,
    before: Callable[[RealtimeDriver], None] = lambda _: None,
    **services: Any,
) -> Ran:
    """Run a plan for real: prompts and fabric, with this model."""
    ran, maker = Ran(), Maker(LIBRARY)
    ran.kernel = kernel_of(text)
    results = {"prompts": ran.prompts, "specs": specs(LIBRARY), **services}
    if model is not None:
        results.setdefault("model", service(model))

    async def go() -> None:
        driver = RealtimeDriver(ran.kernel, ran, maker, services=results)
        driver.watchers.append(FillsWritten(ran.kernel, ran.prompts, maker.runner_class))
        before(driver)
        async with asyncio.timeout(WAIT_S):
            await driver.run()

    asyncio.run(go())
    return ran
