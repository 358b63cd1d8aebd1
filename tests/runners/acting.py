"""Runners that act for themselves, without a plan."""

from __future__ import annotations

import asyncio
import random
import time
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.execution.runner import LoadContext, RunContext, Runner, RunnerError

if TYPE_CHECKING:
    from collections.abc import Mapping

WAIT_S = 20.0


def context(lines: list[str] | None = None) -> RunContext:
    return RunContext(
        number=0,
        element="/Plan/Runner[1]",
        key="run:/Plan/Runner[1]",
        random=random.Random(0),  # noqa: S311
        sleeper=asyncio.sleep,
        clock=time.monotonic,
        logger=lambda text, _data: None if lines is None else lines.append(text),
    )


async def acting(
    runner: Runner, services: Mapping[str, Any], parameters: Mapping[str, Any]
) -> Mapping[str, Any] | None:
    await runner.start(LoadContext("generic_capabilities/X", "generic_capabilities/X", services))
    try:
        async with asyncio.timeout(WAIT_S):
            return await runner.run(parameters, context())
    finally:
        await runner.stop()


def act(runner: Runner, services: Mapping[str, Any], **parameters: Any) -> Any:
    return asyncio.run(acting(runner, services, parameters))


def fails(runner: Runner, services: Mapping[str, Any], **parameters: Any) -> RunnerError:
    with pytest.raises(RunnerError) as caught:
        act(runner, services, **parameters)
    return caught.value
