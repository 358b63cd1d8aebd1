"""The server of llama.cpp takes GBNF grammars in ``grammar``; it has one model."""

from __future__ import annotations

from typing import Any

from gpsfsm.generation.language_model import Constraint
from gpsfsm.generation.providers.dialect import Ask, ChatDialect, GrammarField, chat_body, quiet
from gpsfsm.generation.providers.http_model import http_provider


class _LlamaCpp(ChatDialect):
    default_url = "http://localhost:8080/v1"
    start_hint = "is the server running? llama-server -m MODEL.gguf --jinja"

    def grammar_fields(self, _model: str) -> tuple[GrammarField, ...]:
        return (GrammarField("grammar", Constraint.GBNF),)

    def body(self, ask: Ask) -> dict[str, Any]:
        body = chat_body(ask) | quiet(ask)
        if ask.grammar_field is not None:
            body["grammar"] = ask.grammar
        return body


PROVIDER = http_provider("llamacpp", _LlamaCpp(), default_model="default")
