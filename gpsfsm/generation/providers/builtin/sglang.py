"""SGLang's server takes GBNF grammars in ``ebnf``."""

from __future__ import annotations

from typing import Any

from gpsfsm.generation.language_model import Constraint
from gpsfsm.generation.providers.dialect import Ask, ChatDialect, GrammarField, chat_body, quiet
from gpsfsm.generation.providers.http_model import http_provider


class _Sglang(ChatDialect):
    default_url = "http://localhost:30000/v1"
    start_hint = "is the server running? python -m sglang.launch_server --model-path MODEL"

    def grammar_fields(self, _model: str) -> tuple[GrammarField, ...]:
        return (GrammarField("ebnf", Constraint.GBNF),)

    def body(self, ask: Ask) -> dict[str, Any]:
        body = chat_body(ask) | quiet(ask)
        if ask.grammar_field is not None:
            body["ebnf"] = ask.grammar
        return body


PROVIDER = http_provider("sglang", _Sglang())
