"""The language model of the service's plan queue: while it is asked, the queue still answers."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from gpsfsm.cli._prompting import model_left, model_of_run
from gpsfsm.cli._runs import stored
from gpsfsm.errors import UsageError
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.generation.passing import PassingOn
from gpsfsm.generation.providers.settings import Configured, settings_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from contextlib import ExitStack

    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.cli._past import StoredQueue
    from gpsfsm.execution.journal import Heading
    from gpsfsm.generation.language_model import Answer, LanguageModel, Request
    from gpsfsm.generation.service import ModelService

__all__ = ["served_model"]

_SLICE_S = 0.05


def served_model(
    runs: tuple[Heading, Capabilities, ExitStack],
    head: Mapping[str, Any],
    poll: Callable[[], None],
    before: tuple[str, StoredQueue | None],
) -> ModelService:
    """The model that ``head`` tells of. Raises GpsfsmError if it cannot be asked.

    ``poll`` is called again and again while an answer is waited for.
    """
    base, capabilities, stack = runs
    settings = settings_of(head["model"], configured=Configured(**head["model_files"]))
    if not settings.spec:
        raise UsageError("no model is named")
    journal, past = before
    numbers = [] if past is None else [*past.runs().values()]
    if not numbers:
        service = model_of_run(base, settings, capabilities, stack)
    else:
        with JournalReader(journal) as reader:
            run = reader.run(numbers[-1])
            found = model_left(reader, run, settings, (stored(reader, run), past, stack))
        assert found is not None
        service = found
    service.model = _Polling(service.model, poll)
    return service


class _Polling(PassingOn):
    """A model that lets others have their say while it thinks."""

    def __init__(self, model: LanguageModel, poll: Callable[[], None]) -> None:
        super().__init__(model)
        self._poll = poll

    async def answer(self, request: Request) -> Answer:
        """Ask it. Raises ModelError."""
        asking = asyncio.ensure_future(super().answer(request))
        try:
            while not asking.done():
                await asyncio.wait({asking}, timeout=_SLICE_S)
                self._poll()
            return await asking
        finally:
            asking.cancel()
