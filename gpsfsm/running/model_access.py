"""Access to language models: what it takes to ask one, and to let the runners of runs ask it."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import UsageError
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine, Iterable, Sequence
    from contextlib import ExitStack

    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.execution.journal import Heading
    from gpsfsm.execution.journal_read import JournalReader, StoredRun
    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.generation.attempt_log import Session
    from gpsfsm.generation.language_model import Constraint, LanguageModel
    from gpsfsm.generation.prompt_builder import Prompt
    from gpsfsm.generation.providers import ModelSettings
    from gpsfsm.generation.service import Answers, ModelService
    from gpsfsm.running.history import StoredQueue
    from gpsfsm.running.interruption import Interruption
    from gpsfsm.running.prepare import Prepared

    _Left = tuple[Prepared, StoredQueue | None, ExitStack]

_NO_MODEL = """no model is named: use --model, GPSFSM_MODEL or [tool.gpsfsm.model]. Examples:
  --model ollama:qwen3:8b          a model on this machine
  --model openai:gpt-5             with a key in OPENAI_API_KEY
  --model replay:answers.jsonl     answers that were recorded"""


_ANSWER_PART = 3
"""The part of a context that is for the answer at most."""


def model_of(settings: ModelSettings) -> LanguageModel:
    """The model to ask; raises GpsfsmError if none is named or it cannot be asked."""
    if not settings.spec:
        raise UsageError(_NO_MODEL)
    from gpsfsm.generation.providers import find_model
    from gpsfsm.grammars import rendered

    return find_model(settings.spec, settings, rendered=rendered)


def budgeted(model: ModelSettings) -> tuple[ModelSettings, str]:
    """Settings under which an answer leaves room for what is asked, and a note if they differ."""
    if model.context_tokens is None:
        return model, ""
    most = model.context_tokens // _ANSWER_PART
    if model.max_tokens <= most:
        return model, ""
    note = f"an answer may have {most:,} tokens, a third of the context"
    return replace(model, max_tokens=most), note


def grammars_of(
    capabilities: Capabilities, offered: Sequence[str], settings: ModelSettings
) -> tuple[tuple[Constraint, str], ...]:
    """The grammars over what the prompt offers; none if they are not wanted.

    A capability that no grammar can express safely leaves the answer free: it is checked anyway.
    """
    from gpsfsm.generation.providers import Constrain

    if settings.constrain is Constrain.NEVER:
        return ()
    from gpsfsm.grammars import alphabet, grammars_for

    if alphabet(capabilities.library, offered).left_out:
        return ()
    return grammars_for(capabilities, only=offered)


def session_for(
    prompt: Prompt,
    model: LanguageModel,
    *,
    seed: int | None,
    rounds: int,
    candidates: int = 1,
    capabilities: Capabilities,
    why: str = "",
) -> Session:
    """The session of a model, written down before it is asked."""
    from gpsfsm.capabilities.table import dump
    from gpsfsm.generation.attempt_log import Session

    messages = json.dumps([[each.role.value, each.text] for each in prompt.messages])
    return Session(
        task=prompt.task,
        model=model.name,
        template=prompt.template.id,
        template_sha256=prompt.template.sha256,
        prompt_sha256=_digest(messages),
        library_sha256=_digest(dump(capabilities.library)),
        seed=seed or 0,
        rounds=rounds,
        candidates=candidates,
        why=why,
    )


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


# -- for the runners of runs ------------------------------------------------------------------


def model_of_run(
    base: Heading,
    settings: ModelSettings,
    capabilities: Capabilities,
    stack: ExitStack,
    *,
    model: LanguageModel | None = None,
) -> ModelService:
    """The model as the runners of runs have it; its judge ends with ``stack``.

    Plans are judged for the engine of the run, and offered under its names. ``model`` is the model
    itself, if there is one already: whoever made it closes it. Raises GpsfsmError if it cannot be
    asked.
    """
    from gpsfsm.capabilities.dialects import in_dialect
    from gpsfsm.checking import CheckOptions
    from gpsfsm.generation.offer import closed
    from gpsfsm.generation.service import ModelService
    from gpsfsm.running.answer_judge import JudgeApart, PlanJudge
    from gpsfsm.running.prepare import REAL, engine_of

    engine = engine_of(base)
    capabilities = in_dialect(capabilities, engine)
    # what nobody has described was not offered
    offered = replace(capabilities, library=closed(capabilities.library))
    options = CheckOptions(capabilities=offered, engine=engine)
    judge: PlanJudge | JudgeApart = PlanJudge(options)
    if base.mode == REAL:
        judge = stack.enter_context(JudgeApart(PlanJudge(options)))
    if model is None:
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
    """Close a model, in a thread: an event loop may run in this one."""
    import asyncio
    import threading

    def close() -> None:
        with suppress(Exception):  # the run is over, and its connections end with the process
            asyncio.run(model.close())

    thread = threading.Thread(target=close, daemon=True)
    thread.start()
    thread.join()


def answers_of(
    service: ModelService | None, rows: Iterable[Row], interruption: Interruption
) -> Answers:
    """The service ``answers`` of a simulated run; ``rows`` are what has happened of it."""
    from gpsfsm.execution.journal_rows import endings
    from gpsfsm.generation.service import Answers

    journaled = list(rows)
    last_us = journaled[-1].at_us if journaled else -1
    return Answers(service, endings(journaled), last_us, _waiting(interruption))


def _waiting(interruption: Interruption) -> Callable[[Coroutine[Any, Any, str]], str]:
    """Wait for a request, which an interruption ends."""

    def wait(asking: Coroutine[Any, Any, str]) -> str:
        import asyncio

        from gpsfsm.generation.service import AskingInterruptedError

        async def work() -> str:
            loop, task = asyncio.get_running_loop(), asyncio.ensure_future(asking)
            before = interruption.on_request

            def end() -> None:
                loop.call_soon_threadsafe(task.cancel)

            interruption.on_request = end
            try:
                if interruption.requested:
                    task.cancel()
                return await task
            except asyncio.CancelledError:
                raise AskingInterruptedError from None
            finally:
                interruption.on_request = before

        return asyncio.run(work())

    return wait


def model_left(
    reader: JournalReader,
    run: StoredRun,
    settings: ModelSettings | None,
    left: _Left,
    *,
    model: LanguageModel | None = None,
) -> ModelService | None:
    """The model of a run that goes on, if it has one. Raises UsageError if none is named.

    A journal alone makes nobody ask a model: it may come from anywhere.
    """
    named = run.options.get("model")
    if settings is None and isinstance(named, str):
        raise UsageError(
            f"run {run.number} asks a language model; if that is what you want, name it: "
            f"--model {clip(named, 200)}"
        )
    if settings is None:
        return None
    from gpsfsm.capabilities.library import Capabilities

    prepared, queue, stack = left
    capabilities = Capabilities(prepared.library)
    service = model_of_run(prepared.heading, settings, capabilities, stack, model=model)
    numbers = {run.number} if queue is None else {run.number, *queue.runs().values()}
    for number in sorted(numbers):
        service.numbers += _requests_in(reader, reader.run(number))
    return service


def _requests_in(reader: JournalReader, run: StoredRun) -> Counter[str]:
    """The requests of a run, counted by task."""
    from gpsfsm.execution.journal_rows import endings
    from gpsfsm.execution.registry import Maker
    from gpsfsm.execution.runner import RunnerError
    from gpsfsm.generation.attempt_log import requests_in
    from gpsfsm.generation.service import task_key
    from gpsfsm.running.prepare import stored

    requests: Counter[str] = Counter()
    prepared = stored(reader, run)
    kernel = prepared.kernel()
    maker = Maker(prepared.library, bound=kernel.bound)
    for number, ending in endings(reader.events(run.number)).items():
        most = requests_in(ending.lines, first_edition=True)
        if not (most and ending.kind and 0 <= number < len(kernel.runner_of)):
            continue  # what has no outcome is asked for once more
        with suppress(RunnerError):  # of another package: it counts for itself
            made = maker.runner_class(*kernel.runners[kernel.runner_of[number]])
            if (task := getattr(made, "task", None)) is not None:
                ours = made.__module__.startswith("gpsfsm.runners.")
                count = requests_in(ending.lines, first_edition=ours)
                requests[task_key(task(ending.parameters))] += count
    return requests
