"""Prompts: the templates, which are versioned; ``offer`` and ``builder`` fill them.

A version is never changed once it was released, so that a journal which names it can be understood.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from functools import cache
from importlib import resources
from string import Template
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Mapping

_FILE = re.compile(r"([a-z_]+)\.(\d+)\.txt")


@dataclass(frozen=True, slots=True)
class PromptTemplate:
    """A versioned text; ``id`` is ``plan.1``, ``sha256`` that of its text."""

    id: str
    text: str

    @property
    def sha256(self) -> str:
        """The hash of the text, for journals."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def filled(self, values: Mapping[str, str]) -> str:
        """The text with its values, in one pass: a ``$`` in a value means nothing."""
        return Template(self.text).substitute(values).strip() + "\n"


@cache
def template_names() -> tuple[str, ...]:
    """The ids of all templates, sorted by name and version."""
    versions = [
        (match[1], int(match[2]))
        for entry in resources.files(__package__).iterdir()
        if (match := _FILE.fullmatch(entry.name))
    ]
    return tuple(f"{name}.{version}" for name, version in sorted(versions))


@cache
def find_template(name: str) -> PromptTemplate:
    """The template of this id, or the newest of this name; raises UsageError if there is none."""
    names = template_names()
    fitting = [each for each in names if name in (each, each.rpartition(".")[0])]
    if not fitting:
        raise UsageError(f"there is no prompt template '{name}'; known are {', '.join(names)}")
    file = resources.files(__package__).joinpath(f"{fitting[-1]}.txt")
    return PromptTemplate(fitting[-1], file.read_text(encoding="utf-8"))
