"""OpenAI: gpt-5 and later take a Lark grammar, as that of the input of a custom tool."""

from __future__ import annotations

import re
from typing import Any

from gpsfsm.generation.language_model import Constraint
from gpsfsm.generation.providers.dialect import Ask, ChatDialect, GrammarField, chat_body
from gpsfsm.generation.providers.http_model import http_provider

_REASONS = re.compile(r"(?:o\d|gpt-[5-9]|codex)(?!.*chat)")
_TAKES_GRAMMARS = re.compile(r"gpt-[5-9](?!.*chat)")
_TOOL = "emit_plan"
_ABOUT = "Hand over the plan. The input is the plan, nothing else."


class _OpenAI(ChatDialect):
    default_url = "https://api.openai.com/v1"
    start_hint = "is this computer online?"

    def grammar_fields(self, model: str) -> tuple[GrammarField, ...]:
        match = _TAKES_GRAMMARS.match(model)
        return (GrammarField("custom_tool", Constraint.LARK),) if match else ()

    def body(self, ask: Ask) -> dict[str, Any]:
        body = chat_body(ask)
        body["max_completion_tokens"] = body.pop("max_tokens")
        if _REASONS.match(ask.model):  # these refuse to be told how to sample
            body.pop("temperature")
            body.pop("seed", None)
        if ask.grammar_field is not None:
            grammar = {"syntax": "lark", "definition": ask.grammar}
            tool = {
                "name": _TOOL,
                "description": _ABOUT,
                "format": {"type": "grammar", "grammar": grammar},
            }
            body["tools"] = [{"type": "custom", "custom": tool}]
            body["tool_choice"] = {"type": "custom", "custom": {"name": _TOOL}}
            body["parallel_tool_calls"] = False
        return body


PROVIDER = http_provider(
    "openai", _OpenAI(), url_variable="OPENAI_BASE_URL", key_variables=("OPENAI_API_KEY",)
)
