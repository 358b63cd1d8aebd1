"""From a prompt to the request that a model gets."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from gpsfsm.execution.records import RunValue
    from gpsfsm.generation.service import ModelService
    from gpsfsm.runners.prompting.kinds import Prompt

__all__ = ["asked"]


async def asked(
    prompt: type[Prompt],
    service: ModelService,
    kept: Sequence[str],
    parameters: Mapping[str, RunValue],
    tell: Callable[[str], None],
) -> str:
    """The answer of the model to what is kept and the prompt itself. Raises RunnerError."""
    question, task, told = prompt.question(parameters), prompt.task(parameters), "\n".join(kept)
    if prompt.writes_plan:
        return await service.plan(task, said=question, tell=tell, told=told)
    whole = f"{told}\n{question}" if told else question
    return await service.words(whole, task=task, tell=tell)
