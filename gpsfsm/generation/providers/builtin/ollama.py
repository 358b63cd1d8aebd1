"""Ollama's own chat API. It takes JSON schemas, no grammars, and the length of the context."""

from __future__ import annotations

import json
from typing import Any

from gpsfsm.generation.language_model import Constraint, Finish, Usage, estimated_tokens
from gpsfsm.generation.providers.dialect import (
    Ask,
    GrammarField,
    Reply,
    at,
    count,
    messages_of,
    said_wrong,
)
from gpsfsm.generation.providers.http_model import http_provider

_SMALLEST = 8192
_LARGEST = 1 << 20
_FINISH = {"stop": Finish.STOP, "length": Finish.LENGTH}


class _Ollama:
    path = "api/chat"
    models_path = "api/tags"
    default_url = "http://localhost:11434"
    start_hint = "is the server running? ollama serve"

    def grammar_fields(self, _model: str) -> tuple[GrammarField, ...]:
        return (GrammarField("format", Constraint.JSON_SCHEMA),)

    def body(self, ask: Ask) -> dict[str, Any]:
        request = ask.request
        options: dict[str, Any] = {
            "temperature": request.temperature,
            "num_predict": request.max_tokens,
            "num_ctx": ask.context_tokens or _context_for(ask),
        }
        if request.seed is not None:
            options["seed"] = request.seed
        body = {"model": ask.model, "messages": messages_of(ask), "stream": False}
        if not ask.thinking:
            body["think"] = False
        body["options"] = options
        if ask.grammar_field is not None:
            body["format"] = json.loads(ask.grammar)
        return body

    def reply(self, data: Any) -> Reply:
        text, model = at(data, "message", "content"), at(data, "model")
        reason, thoughts = at(data, "done_reason"), at(data, "message", "thinking")
        cut = at(data, "done") is False  # the first part of a stream, which was not asked for
        finish = _FINISH.get(reason, Finish.OTHER) if isinstance(reason, str) else Finish.STOP
        return Reply(
            text=text if isinstance(text, str) else None,
            finish=finish,
            usage=Usage(count(at(data, "prompt_eval_count")), count(at(data, "eval_count"))),
            model=model if isinstance(model, str) else "",
            thoughts=thoughts if isinstance(thoughts, str) else "",
            error=said_wrong(data) or ("the answer is not complete" if cut else ""),
        )

    def models(self, data: Any) -> list[str]:
        models = at(data, "models")
        names = [at(each, "name") for each in models] if isinstance(models, list) else []
        return [name for name in names if isinstance(name, str)]


def _context_for(ask: Ask) -> int:
    """Room for prompt and answer: without being told, Ollama silently cuts a prompt at 4,096."""
    needed = ask.request.max_tokens + sum(
        estimated_tokens(turn.text) for turn in ask.request.messages
    )
    size = _SMALLEST
    while size < needed and size < _LARGEST:  # few sizes: a change makes it load the model again
        size *= 2
    return size


PROVIDER = http_provider(
    "ollama", _Ollama(), url_variable="OLLAMA_HOST", key_variables=("OLLAMA_API_KEY",)
)
