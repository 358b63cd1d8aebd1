"""A model that is another one: what looks at requests or answers on the way is made of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gpsfsm.generation.language_model import Answer, LanguageModel, Request

__all__ = ["PassingOn"]


class PassingOn:
    """Passes everything on; who closes it does not close the model itself."""

    def __init__(self, model: LanguageModel) -> None:
        self._model = model

    @property
    def name(self) -> str:
        """Provider and model."""
        return self._model.name

    @property
    def context_tokens(self) -> int | None:
        """What it can read and write together."""
        return self._model.context_tokens

    async def answer(self, request: Request) -> Answer:
        """Ask. Raises ModelError."""
        return await self._model.answer(request)

    async def close(self) -> None:
        """The model is closed where it was opened."""
