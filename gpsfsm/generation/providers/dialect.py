"""How a server is spoken to: what a dialect is, and what is needed to write and read JSON."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from gpsfsm.generation.language_model import Finish, Usage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.generation.language_model import Constraint, Request

__all__ = ["Ask", "Dialect", "Reply", "Way", "at", "count"]


@dataclass(frozen=True, slots=True)
class Way:
    """One way in which a server may take a grammar: the field, and the language in it."""

    name: str
    constraint: Constraint


@dataclass(frozen=True, slots=True, kw_only=True)
class Ask:
    """What a body is built from. ``grammar`` is in the language of ``way``; both or neither."""

    model: str
    request: Request
    way: Way | None = None
    grammar: str = ""
    thinking: bool = False
    context_tokens: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """What a server has said.

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
        """Where to ask, below the base URL."""

    @property
    def models_path(self) -> str:
        """Where the server lists its models."""

    @property
    def default_url(self) -> str:
        """Where a server is if nothing else is said; "" if that cannot be known."""

    @property
    def start_hint(self) -> str:
        """What to do if no server is there."""

    def ways(self, model: str) -> tuple[Way, ...]:
        """How grammars can be sent to a model, best first."""

    def body(self, ask: Ask) -> dict[str, Any]:
        """The request as JSON."""

    def reply(self, data: Any) -> Reply:
        """Read a reply, whatever it is; never raises."""

    def models(self, data: Any) -> Sequence[str]:
        """The names of the models in the server's list, whatever that is; never raises."""


def at(data: Any, *path: str | int) -> Any:
    """What is at a place in JSON, None if there is no such place."""
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
