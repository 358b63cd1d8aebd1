"""OpenAI's chat completions, which most servers speak, each with fields of its own."""

from __future__ import annotations

import json
from typing import Any

from gpsfsm.generation.language_model import Constraint, Finish, Usage
from gpsfsm.generation.providers.dialect import Ask, Reply, Way, at, count

__all__ = ["ChatDialect", "chat_body", "json_schema_format", "messages_of", "quiet", "said_wrong"]

_FINISH = {"stop": Finish.STOP, "tool_calls": Finish.STOP, "length": Finish.LENGTH}


class ChatDialect:
    """What the servers have in common; they differ in ``ways`` and ``body``."""

    path = "chat/completions"
    models_path = "models"
    default_url = ""
    start_hint = "is the server running there?"

    def ways(self, model: str) -> tuple[Way, ...]:  # noqa: ARG002
        """How grammars can be sent."""
        return (Way("response_format", Constraint.JSON_SCHEMA),)

    def body(self, ask: Ask) -> dict[str, Any]:
        """The request as JSON."""
        body = chat_body(ask)
        if ask.way is not None:
            body |= json_schema_format(ask.grammar)
        return body

    def reply(self, data: Any) -> Reply:
        """Read a reply."""
        message = at(data, "choices", 0, "message")
        finish = at(data, "choices", 0, "finish_reason")
        refusal = at(message, "refusal")
        if finish == "content_filter":
            refusal = refusal or "the answer was withheld by a content filter"
        called = at(message, "tool_calls", 0, "custom", "input")
        text = called if isinstance(called, str) else _text(at(message, "content"))
        if text is None and isinstance(message, dict) and "content" in message:
            text = ""
        model = at(data, "model")
        return Reply(
            text=text,
            finish=_FINISH.get(finish, Finish.OTHER) if isinstance(finish, str) else Finish.STOP,
            usage=Usage(
                count(at(data, "usage", "prompt_tokens")),
                count(at(data, "usage", "completion_tokens")),
            ),
            model=model if isinstance(model, str) else "",
            thoughts=_text(at(message, "reasoning_content"))
            or _text(at(message, "reasoning"))
            or "",
            refusal=refusal if isinstance(refusal, str) else "",
            error=said_wrong(data) or (_broken_off(data) if finish == "error" else ""),
        )

    def models(self, data: Any) -> list[str]:
        """The names in a list of models."""
        found = at(data, "data")
        names = [at(each, "id") for each in found] if isinstance(found, list) else []
        return [name for name in names if isinstance(name, str)]


def messages_of(ask: Ask) -> list[dict[str, str]]:
    """The turns of the conversation."""
    return [{"role": str(turn.role), "content": turn.text} for turn in ask.request.messages]


def chat_body(ask: Ask) -> dict[str, Any]:
    """The request without any grammar."""
    request = ask.request
    body: dict[str, Any] = {
        "model": ask.model,
        "messages": messages_of(ask),
        "temperature": request.temperature,
        "max_tokens": request.max_tokens,
        "stream": False,
    }
    if request.seed is not None:
        body["seed"] = request.seed
    return body


def quiet(ask: Ask) -> dict[str, Any]:
    """Tell the template of an open model not to think aloud: grammars and thoughts do not mix."""
    return {} if ask.thinking else {"chat_template_kwargs": {"enable_thinking": False}}


def json_schema_format(schema: str) -> dict[str, Any]:
    """Ask for JSON to a schema."""
    named = {"name": "plan", "schema": json.loads(schema), "strict": True}
    return {"response_format": {"type": "json_schema", "json_schema": named}}


def said_wrong(data: Any) -> str:
    """What a body says went wrong, "" if nothing; the forms of all servers that we know."""
    error = at(data, "error")
    for found in (
        error,
        at(error, "message"),
        at(error, "metadata", "raw"),
        at(data, "message") if at(data, "object") == "error" else None,
        at(data, "detail"),
        at(data, "detail", 0, "msg"),
    ):
        if isinstance(found, str) and found.strip():
            return found.strip()
    return "it does not say what" if isinstance(error, dict) and error else ""


def _broken_off(data: Any) -> str:
    """What is said of an answer that the server could not finish."""
    return said_wrong(at(data, "choices", 0)) or "the answer was broken off"


def _text(content: Any) -> str | None:
    """A text, which may be in parts."""
    if isinstance(content, list):
        parts = [at(part, "text") for part in content]
        return "".join(part for part in parts if isinstance(part, str))
    return content if isinstance(content, str) else None
