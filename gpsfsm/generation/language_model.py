"""What a language model is to the rest of gpsfsm: asked with messages, it answers with a text.

Providers (``gpsfsm.generation.providers``) implement ``LanguageModel``; nothing else knows how a
server is spoken to.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

from gpsfsm.errors import GpsfsmError

__all__ = [
    "MAX_ANSWER",
    "Answer",
    "Constraint",
    "Finish",
    "LanguageModel",
    "Message",
    "ModelError",
    "Request",
    "Role",
    "Usage",
]

MAX_ANSWER = 200_000
"""Characters of an answer that are kept and handed on; no plan is that long."""


class ModelError(GpsfsmError):
    """A model has not answered; the text says which, why, and what to do. Never holds a key.

    ``again`` tells whether asking once more may help (already tried as often as was allowed).
    ``empty``: the model could be asked, but there is nothing in its answer.
    """

    def __init__(self, text: str, *, again: bool = False, empty: bool = False) -> None:
        super().__init__(text)
        self.again = again
        self.empty = empty


class Role(StrEnum):
    """Who speaks."""

    SYSTEM = "system"
    USER = "user"
    ASSISTANT = "assistant"


class Finish(StrEnum):
    """Why an answer ended. What was cut off (LENGTH) is no answer to repair."""

    STOP = "stop"
    LENGTH = "length"
    OTHER = "other"


class Constraint(StrEnum):
    """In what a grammar of plans is written (``gpsfsm grammar --format``)."""

    GBNF = "gbnf"
    LARK = "lark"
    JSON_SCHEMA = "json-schema"


@dataclass(frozen=True, slots=True)
class Message:
    """One turn of a conversation."""

    role: Role
    text: str


@dataclass(frozen=True, slots=True)
class Request:
    """What a model is asked.

    ``task`` is the bare task, for providers that look answers up by it. ``grammars`` are texts that
    allow plans only, by language; a provider sends the one that its server understands, or none.
    ``max_tokens`` bounds the answer. ``seed`` and ``temperature`` are passed on where they can be.
    ``number`` says how many requests for the same task came before, over restarts of the process;
    providers that answer in order go by it. None lets them count for themselves.
    """

    messages: tuple[Message, ...]
    task: str = ""
    grammars: tuple[tuple[Constraint, str], ...] = ()
    max_tokens: int = 4096
    temperature: float = 0.0
    seed: int | None = None
    number: int | None = None

    def grammar(self, constraint: Constraint) -> str | None:
        """The grammar in a language, None if there is none."""
        return dict(self.grammars).get(constraint)


@dataclass(frozen=True, slots=True)
class Usage:
    """Tokens, as the server counts them; None where nothing is known.

    ``estimated`` marks numbers of which at least one is our guess, for servers that do not count.
    """

    prompt_tokens: int | None = None
    answer_tokens: int | None = None
    estimated: bool = False


@dataclass(frozen=True, slots=True)
class Answer:
    """What a model has answered.

    ``text`` is the plain answer: JSON to a schema of the plan tree has been rendered to XML
    already, and ``raw`` is what came. ``constrained`` is the grammar language that was sent and is
    known to be heeded by this server, None if the answer was free. ``requests`` counts the HTTP
    requests that it took. ``cost`` is in the currency of the configured prices, None without.
    """

    text: str
    model: str
    finish: Finish = Finish.STOP
    usage: Usage = field(default_factory=Usage)
    latency_s: float = 0.0
    constrained: Constraint | None = None
    raw: str = ""
    requests: int = 1
    cost: float | None = None


class LanguageModel(Protocol):
    """A model that can be asked. ``context_tokens`` is how much it can read, None if unknown."""

    @property
    def name(self) -> str:
        """Provider and model, such as ``ollama:qwen3``; goes into journals and messages."""

    @property
    def context_tokens(self) -> int | None:
        """How many tokens prompt and answer may have together."""

    async def answer(self, request: Request) -> Answer:
        """Ask. Raises ModelError; cancelling the task ends the request at once."""

    async def close(self) -> None:
        """Let go of connections."""
