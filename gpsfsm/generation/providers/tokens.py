"""How many tokens an answer took, and what they cost."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.generation.language_model import Usage
from gpsfsm.generation.prompts.tokens import estimated_tokens

if TYPE_CHECKING:
    from gpsfsm.generation.language_model import Request
    from gpsfsm.generation.providers.settings import ModelSettings

__all__ = ["completed", "cost_of"]


def completed(usage: Usage, request: Request, answer: str) -> Usage:
    """What the server counted; if it did not, an estimate that is marked as one."""
    if usage.prompt_tokens is not None and usage.answer_tokens is not None:
        return usage
    prompt, written = usage.prompt_tokens, usage.answer_tokens
    if prompt is None:
        prompt = sum(estimated_tokens(turn.text) for turn in request.messages)
    return Usage(prompt, estimated_tokens(answer) if written is None else written, estimated=True)


def cost_of(usage: Usage, settings: ModelSettings) -> float | None:
    """What an answer costs; None unless both prices are known."""
    if settings.prompt_price is None or settings.answer_price is None:
        return None
    prompt = (usage.prompt_tokens or 0) * settings.prompt_price
    return (prompt + (usage.answer_tokens or 0) * settings.answer_price) / 1e6
