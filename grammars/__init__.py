"""The plan language as grammars, for other programs.

Two families, each for its own use. The *schemas* (RELAX NG, XSD) say what a plan is, whatever
the capabilities; they are for editors and validators. gpsfsm itself reads plans with
``gpsfsm.syntax``, which says more about an error; a test proves that both accept the same texts.

The *grammars for constrained decoding* (GBNF, Lark, a JSON schema) are made from a library of
capabilities: a language model that is bound to one can write nothing but well-formed plans over
known runners with typed parameters.
"""

from __future__ import annotations

if __name__ == "grammars":
    raise ImportError("import gpsfsm.grammars, not grammars")

from typing import TYPE_CHECKING

from gpsfsm.errors import misused, require_texts, require_whole
from gpsfsm.grammars.emit import Format, find_format, format_names
from gpsfsm.grammars.emit.schemas import SCHEMAS, relax_ng, relax_ng_compact, schema_path, xsd
from gpsfsm.grammars.rules import DEPTH, MAX_DEPTH
from gpsfsm.grammars.tree import TreeError, rendered
from gpsfsm.grammars.writable import Alphabet, LeftOut, alphabet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.generation.language_model import Constraint

__all__ = [
    "DEPTH",
    "MAX_DEPTH",
    "SCHEMAS",
    "Alphabet",
    "Format",
    "LeftOut",
    "TreeError",
    "alphabet",
    "find_format",
    "format_names",
    "grammars_for",
    "relax_ng",
    "relax_ng_compact",
    "rendered",
    "schema_path",
    "xsd",
]


def grammars_for(
    capabilities: Capabilities, *, depth: int = DEPTH, only: Sequence[str] | None = None
) -> tuple[tuple[Constraint, str], ...]:
    """Return one grammar for each format that servers accept.

    The grammars admit plans over these capabilities. Runners are at most ``depth`` levels below the
    plan. ``only`` lists names or patterns of interfaces, such as ``nav2_capabilities/*``; None
    means all.

    Raises UsageError if a pattern matches nothing, if the depth is out of range, or if no runner is
    left.

    >>> from gpsfsm.capabilities.library import builtin_capabilities
    >>> grammars = dict(grammars_for(builtin_capabilities(), only=["WaitRunner"]))
    >>> sorted(grammars), "generic_capabilities/WaitRunner" in grammars["gbnf"]
    ([<Constraint.GBNF: 'gbnf'>, <Constraint.JSON_SCHEMA: 'json-schema'>, \
<Constraint.LARK: 'lark'>], True)
    """
    if not hasattr(capabilities, "library"):
        hint = "gpsfsm.builtin_capabilities() are some"
        raise misused("grammars_for", "capabilities", capabilities, hint)
    require_whole("grammars_for", "depth", depth)
    if only is not None:
        require_texts("grammars_for", "only", only)
    words = alphabet(capabilities.library, only)
    formats = map(find_format, format_names())
    return tuple(
        (each.constraint, each.emit(words, depth))
        for each in formats
        if each.constraint is not None and each.emit is not None
    )
