"""Whether a server heeds grammars: many ignore fields that they do not know, without a word.

A model is asked for something that the grammar does not allow. If it answers exactly what the
grammar allows, it is constrained. This is done once for an endpoint, model and field in a process.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from gpsfsm.generation.language_model import Constraint, Message, Request, Role
from gpsfsm.strict_json import strict_loads

if TYPE_CHECKING:
    from gpsfsm.generation.providers.dialect import Way

__all__ = ["KNOWN", "Known", "expected", "probe_grammar", "probe_request"]

_WORD = "ok"
_QUESTION = "Which seven days does a week have? Write all of them in one line."
_MAX_TOKENS = 1024  # reasoning models think first
_SCHEMA = {
    "type": "object",
    "properties": {"answer": {"type": "string", "enum": [_WORD]}},
    "required": ["answer"],
    "additionalProperties": False,
}
_GRAMMARS = {
    Constraint.GBNF: f'root ::= "{_WORD}"\n',
    Constraint.LARK: f'start: "{_WORD}"\n',
    Constraint.JSON_SCHEMA: json.dumps(_SCHEMA),
}


def probe_grammar(way: Way) -> str:
    """A grammar that allows one answer."""
    return _GRAMMARS[way.constraint]


def probe_request() -> Request:
    """A question to which nobody would give that answer."""
    return Request((Message(Role.USER, _QUESTION),), max_tokens=_MAX_TOKENS)


def expected(way: Way, text: str) -> bool:
    """Whether an answer is the only one that the grammar allows."""
    if way.constraint is not Constraint.JSON_SCHEMA:
        return text.strip() == _WORD
    try:
        return bool(strict_loads(text) == {"answer": _WORD})
    except (ValueError, RecursionError):
        return False


class Known:
    """What probes have shown in this process."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str, str], bool] = {}

    def heeded(self, url: str, model: str, way: Way) -> bool | None:
        """Whether a server heeds grammars, None if it has not been asked."""
        return self._found.get((url, model, way.name))

    def learn(self, url: str, model: str, way: Way, *, heeded: bool) -> None:
        """Keep what a probe has shown."""
        self._found[url, model, way.name] = heeded

    def forget(self) -> None:
        """Ask all servers again."""
        self._found.clear()


KNOWN = Known()
"""Of this process."""
