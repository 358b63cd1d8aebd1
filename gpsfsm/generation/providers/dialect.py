"""Dialects: how servers are asked and how they answer; the one of OpenAI, which most speak."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from gpsfsm.errors import misused
from gpsfsm.generation.language_model import Constraint, Finish, Usage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.generation.language_model import Request

_OPEN = re.compile(r"\s*<(think|thinking|reasoning)>", re.IGNORECASE)
_CLOSE = re.compile(r"</(?:think|thinking|reasoning)>", re.IGNORECASE)
_PLAN = re.compile(r"<\s*Plan\b", re.IGNORECASE)
_FINISH = {"stop": Finish.STOP, "tool_calls": Finish.STOP, "length": Finish.LENGTH}


@dataclass(frozen=True, slots=True)
class GrammarField:
    """The field of a request in which a server takes a grammar, and the format of that."""

    name: str
    constraint: Constraint


@dataclass(frozen=True, slots=True, kw_only=True)
class Ask:
    """The parts of a request body. Set both ``grammar_field`` and ``grammar`` or neither.

    ``grammar`` is a text in the format of ``grammar_field``.
    """

    model: str
    request: Request
    grammar_field: GrammarField | None = None
    grammar: str = ""
    thinking: bool = False
    context_tokens: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """The reply of a server.

    ``text`` is None if there is no place for an answer in it. ``thoughts`` is what the model
    thought aloud in a field of its own, ``refusal`` why it does not want to answer, ``error`` what
    the server says went wrong although it had answered with 200.
    """

    text: str | None
    finish: Finish = Finish.STOP
    usage: Usage = field(default_factory=Usage)
    model: str = ""
    thoughts: str = ""
    refusal: str = ""
    error: str = ""


class Dialect(Protocol):
    """Builds requests and reads replies; knows nothing of connections."""

    @property
    def path(self) -> str:
        """The path of requests, below the base URL."""

    @property
    def models_path(self) -> str:
        """The path of the list of models."""

    @property
    def default_url(self) -> str:
        """The address of a server if none is configured; "" if that cannot be known."""

    @property
    def start_hint(self) -> str:
        """The hint for the case that no server is there."""

    def grammar_fields(self, model: str) -> tuple[GrammarField, ...]:
        """The fields in which a model takes grammars, best first."""

    def body(self, ask: Ask) -> dict[str, Any]:
        """The request as JSON."""

    def reply(self, data: Any) -> Reply:
        """Read a reply, whatever it is; never raises."""

    def models(self, data: Any) -> Sequence[str]:
        """The names of the models in the server's list, whatever that is; never raises."""


def at(data: Any, *path: str | int) -> Any:
    """The value at a place in JSON, None if there is no such place."""
    for step in path:
        if isinstance(step, int):
            if not isinstance(data, list) or len(data) <= step:
                return None
            data = data[step]
        elif isinstance(data, dict):
            data = data.get(step)
        else:
            return None
    return data


def count(value: Any) -> int | None:
    """A number of tokens, None for what is no such number."""
    if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 1 << 53:
        return value
    return None


class ChatDialect:
    """The dialect of OpenAI. Others differ from it in ``grammar_fields`` and ``body``."""

    path = "chat/completions"
    models_path = "models"
    default_url = ""
    start_hint = "is the server running there?"

    def grammar_fields(self, _model: str) -> tuple[GrammarField, ...]:
        """The fields in which a model takes grammars."""
        return (GrammarField("response_format", Constraint.JSON_SCHEMA),)

    def body(self, ask: Ask) -> dict[str, Any]:
        """The request as JSON."""
        body = chat_body(ask)
        if ask.grammar_field is not None:
            body |= json_schema_format(ask.grammar)
        return body

    def reply(self, data: Any) -> Reply:
        """Parse a reply."""
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
        """The model names in a list of models."""
        models = at(data, "data")
        names = [at(each, "id") for each in models] if isinstance(models, list) else []
        return [name for name in names if isinstance(name, str)]


def messages_of(ask: Ask) -> list[dict[str, str]]:
    """The turns of the conversation."""
    return [{"role": str(turn.role), "content": turn.text} for turn in ask.request.messages]


def chat_body(ask: Ask) -> dict[str, Any]:
    """Return the JSON body of a chat request, without a grammar."""
    value: object = ask
    if not isinstance(value, Ask):
        raise misused("chat_body", "a gpsfsm.Ask", value)
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
    """The error in a body, "" if nothing; the forms of all servers that we know."""
    error = at(data, "error")
    for text in (
        error,
        at(error, "message"),
        at(error, "metadata", "raw"),
        at(data, "message") if at(data, "object") == "error" else None,
        at(data, "detail"),
        at(data, "detail", 0, "msg"),
    ):
        if isinstance(text, str) and text.strip():
            return text.strip()
    return "it does not say what" if isinstance(error, dict) and error else ""


def _broken_off(data: Any) -> str:
    """The error in an answer that the server could not finish."""
    return said_wrong(at(data, "choices", 0)) or "the answer was cut off"


def _text(content: Any) -> str | None:
    """A text, which may be in parts."""
    if isinstance(content, list):
        parts = [at(part, "text") for part in content]
        return "".join(part for part in parts if isinstance(part, str))
    return content if isinstance(content, str) else None


def without_thoughts(text: str) -> str:
    """The answer without what was thought aloud before it.

    Some templates open the thoughts in the prompt, so that the answer has only their end.

    >>> without_thoughts("<think>A plan with <Plan>?</think><Plan/>")
    '<Plan/>'
    >>> without_thoughts("First I go.</think> <Plan/>")
    '<Plan/>'
    """
    start = 0
    while opened := _OPEN.match(text, start):
        closed = re.compile(f"</{opened[1]}>", re.IGNORECASE).search(text, opened.end())
        if closed is None:
            return ""
        start = closed.end()
    stray = _CLOSE.search(text, start)
    plan = _PLAN.search(text, start)
    if stray is not None and (plan is None or stray.start() < plan.start()):
        start = stray.end()
    return text[start:].lstrip() if start else text
