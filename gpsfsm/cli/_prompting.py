"""What it takes to let the runners of a run ask a language model."""

from __future__ import annotations

from collections import Counter
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine, Iterable
    from contextlib import ExitStack

    import click

    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.cli._drive import Interrupt
    from gpsfsm.cli._past import StoredQueue
    from gpsfsm.cli._runs import Prepared
    from gpsfsm.execution.journal import Heading
    from gpsfsm.execution.journal_read import JournalReader, StoredRun
    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.generation.answers import Answers
    from gpsfsm.generation.language_model import LanguageModel
    from gpsfsm.generation.providers.settings import ModelSettings
    from gpsfsm.generation.service import ModelService

    _Asked = tuple[Prepared, StoredQueue | None, ExitStack]

__all__ = ["answers_of", "model_left", "model_of_run", "settings_for"]


def settings_for(context: click.Context, *, real: bool) -> ModelSettings | None:
    """How a model is asked in a run; None if none is.

    A simulated run asks one only if the command line names it: that a model is configured for other
    commands must not make a simulation cost money.
    """
    if not real and not context.params["model_name"]:
        return None
    from gpsfsm.cli._asking import budgeted  # noqa: PLC0415
    from gpsfsm.cli._model import model_settings  # noqa: PLC0415

    settings, _ = budgeted(model_settings(context))
    return settings if settings.spec else None


def model_of_run(
    base: Heading, settings: ModelSettings, capabilities: Capabilities, stack: ExitStack
) -> ModelService:
    """The model as the runners of runs have it; its judge ends with ``stack``.

    Raises GpsfsmError if it cannot be asked.
    """
    from gpsfsm.checking import CheckOptions  # noqa: PLC0415
    from gpsfsm.cli._generating import grammars_of, model_of  # noqa: PLC0415
    from gpsfsm.cli._judging import JudgeApart  # noqa: PLC0415
    from gpsfsm.cli._runs import REAL  # noqa: PLC0415
    from gpsfsm.generation.prompts.offer import closed  # noqa: PLC0415
    from gpsfsm.generation.service import ModelService  # noqa: PLC0415
    from gpsfsm.judging import PlanJudge  # noqa: PLC0415

    # what nobody has described was not offered
    options = CheckOptions(capabilities=replace(capabilities, library=closed(capabilities.library)))
    judge = stack.enter_context(JudgeApart(options)) if base.mode == REAL else PlanJudge(options)
    model = model_of(settings)
    stack.callback(_close, model)
    return ModelService(
        model=model,
        library=capabilities.library,
        judge=judge,
        max_tokens=settings.max_tokens,
        temperature=settings.temperature,
        grammars=lambda offered: grammars_of(capabilities, offered, settings),
    )


def _close(model: LanguageModel) -> None:
    import asyncio  # noqa: PLC0415  (slow to import)

    with suppress(Exception):  # the run is over, and its connections end with the process
        asyncio.run(model.close())


def answers_of(service: ModelService | None, rows: Iterable[Row], interrupt: Interrupt) -> Answers:
    """The service ``answers`` of a simulated run; ``rows`` are what has happened of it."""
    from gpsfsm.execution.endings import endings  # noqa: PLC0415
    from gpsfsm.generation.answers import Answers  # noqa: PLC0415

    known = list(rows)
    last_us = known[-1].at_us if known else -1
    return Answers(service, endings(known), last_us, _waiting(interrupt))


def _waiting(interrupt: Interrupt) -> Callable[[Coroutine[Any, Any, str]], str]:
    """Wait for a request, which the first Ctrl-C ends."""

    def wait(asking: Coroutine[Any, Any, str]) -> str:
        import asyncio  # noqa: PLC0415  (slow to import)

        from gpsfsm.generation.answers import AskingInterrupted  # noqa: PLC0415

        async def work() -> str:
            loop, task = asyncio.get_running_loop(), asyncio.ensure_future(asking)
            before = interrupt.action

            def end() -> None:
                loop.call_soon_threadsafe(task.cancel)

            interrupt.action = end
            try:
                if interrupt.asked:
                    task.cancel()
                return await task
            except asyncio.CancelledError:
                raise AskingInterrupted from None
            finally:
                interrupt.action = before

        return asyncio.run(work())

    return wait


def model_left(
    reader: JournalReader, run: StoredRun, settings: ModelSettings | None, asked: _Asked
) -> ModelService | None:
    """The model of a run that goes on, if it has one. Raises UsageError if none is named.

    A journal alone makes nobody ask a model: it may come from anywhere.
    """
    named = run.options.get("model")
    if settings is None and isinstance(named, str):
        from gpsfsm.model.printable import clip  # noqa: PLC0415

        raise UsageError(
            f"run {run.number} asks a language model; if that is what you want, name it: "
            f"--model {clip(named, 200)}"
        )
    if settings is None:
        return None
    from gpsfsm.capabilities.library import Capabilities  # noqa: PLC0415

    prepared, queue, stack = asked
    service = model_of_run(prepared.heading, settings, Capabilities(prepared.library), stack)
    numbers = {run.number} if queue is None else {run.number, *queue.runs().values()}
    for number in sorted(numbers):
        service.numbers += _asked_in(reader, reader.run(number))
    return service


def _asked_in(reader: JournalReader, run: StoredRun) -> Counter[str]:
    """How often a run has asked about each task."""
    from gpsfsm.cli._runs import stored  # noqa: PLC0415
    from gpsfsm.execution.endings import endings  # noqa: PLC0415
    from gpsfsm.execution.registry import Maker  # noqa: PLC0415
    from gpsfsm.execution.runner import RunnerError  # noqa: PLC0415
    from gpsfsm.generation.service import ASKED, task_key  # noqa: PLC0415

    found: Counter[str] = Counter()
    prepared = stored(reader, run)
    kernel = prepared.kernel()
    maker = Maker(prepared.library, bound=kernel.bound)
    for number, ending in endings(reader.events(run.number)).items():
        count = sum(line.startswith(ASKED) for _, line in ending.lines)
        if not (count and ending.kind and 0 <= number < len(kernel.runner_of)):
            continue  # what has no outcome is asked for once more
        with suppress(RunnerError):  # of another package: it counts for itself
            made = maker.runner_class(*kernel.runners[kernel.runner_of[number]])
            if (task := getattr(made, "task", None)) is not None:
                found[task_key(task(ending.parameters))] += count
    return found
