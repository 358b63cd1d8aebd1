"""vLLM's server takes GBNF grammars: since 0.12 in ``structured_outputs``."""

from __future__ import annotations

from typing import Any

from gpsfsm.generation.language_model import Constraint
from gpsfsm.generation.providers.dialect import Ask, ChatDialect, GrammarField, chat_body, quiet
from gpsfsm.generation.providers.http_model import http_provider

_NEW = GrammarField("structured_outputs", Constraint.GBNF)
_OLD = GrammarField("guided_grammar", Constraint.GBNF)


class _Vllm(ChatDialect):
    default_url = "http://localhost:8000/v1"
    start_hint = "is the server running? vllm serve MODEL"

    def grammar_fields(self, _model: str) -> tuple[GrammarField, ...]:
        return (_NEW, _OLD)

    def body(self, ask: Ask) -> dict[str, Any]:
        body = chat_body(ask) | quiet(ask)
        if ask.grammar_field == _NEW:
            body["structured_outputs"] = {"grammar": ask.grammar}
        elif ask.grammar_field == _OLD:
            body["guided_grammar"] = ask.grammar
        return body


PROVIDER = http_provider("vllm", _Vllm())
