"""The interface of language models: asked with messages, one answers with a text of some tokens.

Providers (``gpsfsm.generation.providers``) implement ``LanguageModel``; nothing else knows how a
server is spoken to. What looks at requests or answers on the way is a ``ModelWrapper``. Where a
server does not count tokens, they are estimated (``estimated_tokens``).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from enum import StrEnum
from functools import lru_cache
from typing import TYPE_CHECKING, Protocol

from gpsfsm.errors import GpsfsmError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from gpsfsm.generation.providers import ModelSettings

_SLICE_S = 0.05

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
    """The speaker of a message."""

    SYSTEM = "system"
    USER = "user"
    ASSISTANT = "assistant"


class Finish(StrEnum):
    """The reason for which an answer ended. What was cut off (LENGTH) is no answer to repair."""

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
    """A request to a model.

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
    """An answer of a model.

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
        """The tokens that prompt and answer may have together."""

    async def answer(self, request: Request) -> Answer:
        """Ask. Raises ModelError; cancelling the task ends the request at once."""

    async def close(self) -> None:
        """Let go of connections."""


class ModelWrapper:
    """Passes everything on; who closes it does not close the model itself."""

    def __init__(self, model: LanguageModel) -> None:
        self._model = model

    @property
    def name(self) -> str:
        """Provider and model."""
        return self._model.name

    @property
    def context_tokens(self) -> int | None:
        """The tokens that it can read and write together."""
        return self._model.context_tokens

    async def answer(self, request: Request) -> Answer:
        """Ask. Raises ModelError."""
        return await self._model.answer(request)

    async def close(self) -> None:
        """The model is closed where it was opened."""


class PollingModel(ModelWrapper):
    """A model that lets others have their say while it thinks: ``poll`` is called meanwhile."""

    def __init__(self, model: LanguageModel, poll: Callable[[], None]) -> None:
        super().__init__(model)
        self._poll = poll

    async def answer(self, request: Request) -> Answer:
        """Ask. Raises ModelError."""
        import asyncio

        waiting = asyncio.ensure_future(super().answer(request))
        try:
            while not waiting.done():
                await asyncio.wait({waiting}, timeout=_SLICE_S)
                self._poll()
            return await waiting
        finally:
            waiting.cancel()


# Tokens. An estimate is meant to be too high rather than too low: without the vocabulary of the
# model nobody knows. Vocabularies of today take three to four characters of English or XML to a
# token, one to two of other scripts, and one or two digits.

_PER_MESSAGE = 8
"""Tokens that a chat template adds to a message, about."""

_PIECE = re.compile(r"[A-Za-z]+|\d+|[ \t]+|[^\sA-Za-z\d]")
_LETTERS, _DIGITS, _BLANKS = 5, 2, 8
_SHORT = 500


def estimated_tokens(text: str) -> int:
    """About how many tokens a text has; what is not ASCII counts by its bytes in UTF-8, halved."""
    lines = text.split("\n")
    counts = (_of_short(line) if len(line) <= _SHORT else _counted(line) for line in lines)
    return len(lines) - 1 + sum(counts)


@lru_cache(maxsize=2_000)
def _of_short(line: str) -> int:
    """Remembered: drafts of a prompt have most lines in common."""
    return _counted(line)


def _counted(line: str) -> int:
    total = 0
    for match in _PIECE.finditer(line):
        piece = match.group()
        first = piece[0]
        if first.isascii() and first.isalpha():
            total += -(-len(piece) // _LETTERS)
        elif first.isascii() and first.isdigit():
            total += -(-len(piece) // _DIGITS)
        elif first in " \t":
            total += 0 if piece == " " else -(-len(piece) // _BLANKS)  # a space belongs to a word
        elif first.isascii():
            total += 1
        else:
            total += -(-len(piece.encode("utf-8", "surrogatepass")) // 2)
    return total


def conversation_tokens(texts: Iterable[str]) -> int:
    """About how many tokens messages with these texts have together."""
    return sum(estimated_tokens(text) + _PER_MESSAGE for text in texts)


def completed(usage: Usage, request: Request, answer: str) -> Usage:
    """The tokens that the server counted; if it did not, an estimate that is marked as one."""
    if usage.prompt_tokens is not None and usage.answer_tokens is not None:
        return usage
    prompt, written = usage.prompt_tokens, usage.answer_tokens
    if prompt is None:
        prompt = sum(estimated_tokens(turn.text) for turn in request.messages)
    return Usage(prompt, estimated_tokens(answer) if written is None else written, estimated=True)


def cost_of(usage: Usage, settings: ModelSettings) -> float | None:
    """The cost of an answer; None unless both prices are known."""
    if settings.prompt_price is None or settings.answer_price is None:
        return None
    prompt = (usage.prompt_tokens or 0) * settings.prompt_price
    return (prompt + (usage.answer_tokens or 0) * settings.answer_price) / 1e6
