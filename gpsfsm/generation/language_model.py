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
    """A model did not answer; the message says which one, why, and what to do.

    It never contains a key. ``again``: another try may help, although the retries have been used
    up. ``empty``: the model was reached, but its answer is empty.
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
    """The format of a grammar for plans (``gpsfsm grammar --format``)."""

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

    - ``task``: the task alone, for providers that look up answers by it.
    - ``grammars``: grammars that admit only plans, by format; a provider sends the one that its
      server understands, or none.
    - ``max_tokens``: the most tokens in the answer.
    - ``seed``, ``temperature``: passed on if the server accepts them.
    - ``number``: the number of earlier requests for the same task, including those of earlier
      processes, for providers that answer in order. None: such providers count themselves.
    """

    messages: tuple[Message, ...]
    task: str = ""
    grammars: tuple[tuple[Constraint, str], ...] = ()
    max_tokens: int = 4096
    temperature: float = 0.0
    seed: int | None = None
    number: int | None = None

    def grammar(self, constraint: Constraint) -> str | None:
        """The grammar in a format; None if there is none."""
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
    """An answer from a model.

    - ``text``: the answer as plain text. JSON that follows a schema of the plan tree is already
      converted to XML; ``raw`` is the answer as it came.
    - ``latency_s``: the time that the answer took, in seconds.
    - ``constrained``: the format of the grammar that was sent, if this server is known to obey it;
      None if the answer was unconstrained.
    - ``requests``: the number of HTTP requests that the answer took.
    - ``cost``: in the currency of the configured prices; None without prices.
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
    """A language model."""

    @property
    def name(self) -> str:
        """Provider and model, such as ``ollama:qwen3``, for journals and messages."""

    @property
    def context_tokens(self) -> int | None:
        """The most tokens that prompt and answer may have together; None if unknown."""

    async def answer(self, request: Request) -> Answer:
        """Answer a request. Raises ModelError; cancelling the task ends the request at once."""

    async def close(self) -> None:
        """Close all connections."""


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
