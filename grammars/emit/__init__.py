"""Formats of grammars: one module each, which defines ``FORMAT``, and what they share.

A format is found by the name of its module, so a new format is one new file. The schemas of all
plans (RELAX NG in compact and XML syntax, XSD) are files that are shipped.
"""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError
from gpsfsm.grammars.expressions import Choice, Literal, Name, Repeat, Sequence

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.generation.language_model import Constraint
    from gpsfsm.grammars.expressions import Chars, Expression
    from gpsfsm.grammars.writable import Alphabet

__all__ = ["Format", "find_format", "format_names"]


@dataclass(frozen=True, slots=True)
class Format:
    """A way to write a grammar. It has one of two functions.

    ``emit`` writes the plans over an alphabet to a depth, for a server that speaks ``constraint``;
    ``fixed`` gives the schema of all plans, whatever the capabilities. ``file`` is the name of the
    file that is shipped.
    """

    name: str
    file: str
    emit: Callable[[Alphabet, int], str] | None = None
    fixed: Callable[[], str] | None = None
    constraint: Constraint | None = None


@cache
def format_names() -> tuple[str, ...]:
    """The names of the formats, sorted; imports none of them."""
    modules = (module.name for module in pkgutil.iter_modules(__path__))
    return tuple(sorted(name.replace("_", "-") for name in modules))


def find_format(name: str) -> Format:
    """The format of this name; raises UsageError if there is none."""
    if name not in format_names():
        names = ", ".join(format_names())
        raise UsageError(f"there is no format '{name}' of grammars; the formats are {names}")
    module = importlib.import_module(f"{__name__}.{name.replace('-', '_')}")
    format_: Format = module.FORMAT
    return format_


@dataclass(frozen=True, slots=True)
class Notation:
    """The spelling of expressions in a format: parts that differ, around those that do not."""

    literal: Callable[[str], str]
    chars: Callable[[Chars], str]
    name: Callable[[str], str]
    repeat: Callable[[Repeat], str]

    def write(self, part: Expression) -> str:
        """The expression on one line."""
        if isinstance(part, Literal):
            return self.literal(part.text)
        if isinstance(part, Name):
            return self.name(part.name)
        if isinstance(part, Sequence):
            return " ".join(self._grouped(each, Choice) for each in part.parts)
        if isinstance(part, Choice):
            return " | ".join(map(self.write, part.parts))
        if isinstance(part, Repeat):
            return self._grouped(part.part, Choice, Sequence) + self.repeat(part)
        return self.chars(part)

    def _grouped(self, part: Expression, *kinds: type) -> str:
        written = self.write(part)
        single = isinstance(part, Sequence) and len(part.parts) == 1
        return f"({written})" if isinstance(part, kinds) and not single else written


def escaped(text: str) -> str:
    """A text between quotation marks, with the escapes that GBNF and Lark share.

    What is not ASCII stays: engines differ in how they read its escapes.
    """
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'


SCHEMAS: tuple[str, ...] = ("gpsfsm-plan.rnc", "gpsfsm-plan.rng", "gpsfsm-plan.xsd")
"""The file names of the schemas."""


def schema_path(name: str) -> Path:
    """The path of a schema, by file name or by its ending alone.

    Raises UsageError for any other name.

    >>> schema_path("rng").name
    'gpsfsm-plan.rng'
    """
    for file in SCHEMAS:
        if name in (file, file.rpartition(".")[2]):
            return Path(__file__).parents[1] / file
    raise UsageError(f"there is no schema '{name}'; there are {', '.join(SCHEMAS)}")


@cache
def relax_ng() -> bytes:
    """The schema in the XML syntax of RELAX NG, encoded as an XML parser expects it.

    >>> relax_ng().startswith(b"<?xml")
    True
    """
    return schema_path("rng").read_bytes()


@cache
def relax_ng_compact() -> str:
    """The schema in the compact syntax of RELAX NG: the source, for people.

    >>> "start = plan" in relax_ng_compact()
    True
    """
    return schema_path("rnc").read_text(encoding="utf-8")


@cache
def xsd() -> bytes:
    """The schema in XML Schema 1.0, encoded as an XML parser expects it.

    >>> xsd().startswith(b"<?xml")
    True
    """
    return schema_path("xsd").read_bytes()
