"""The authority on what is well-formed: lxml."""

from __future__ import annotations

import re

from gpsfsm.syntax.chars import clip
from gpsfsm.syntax.tokens import Fault

__all__ = ["DEEPEST", "well_formedness_fault"]

DEEPEST = 2000
"""libxml2 reads no deeper (2,048); texts nested deeper are judged by the scanner alone."""

_PLACE = re.compile(r", line \d+, column \d+.*", re.DOTALL)


class _Ignore:
    """A parser target that keeps nothing: no tree is built, which is five times as fast."""

    def close(self) -> None:
        """End of the text."""


def well_formedness_fault(text: str) -> tuple[int, int, Fault] | None:
    """Line, column and error, or None if lxml accepts ``text``.

    The text must have no DOCTYPE; the parser expands, loads and fetches nothing in any case.
    """
    from lxml import etree  # noqa: PLC0415  (slow to import)

    # With a target lxml does not mind errors of namespaces; few texts have any.
    namespaces = "xmlns" in text or "xml:" in text
    parser = etree.XMLParser(
        encoding="utf-8",  # the text is decoded already, whatever its declaration says
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        dtd_validation=False,
        huge_tree=True,  # our own limits are the stricter ones
        target=None if namespaces else _Ignore(),  # type: ignore[arg-type]  # all are optional
    )
    try:
        etree.fromstring(text.encode("utf-8"), parser)
    except etree.XMLSyntaxError as error:
        return _fault(error.msg or "", error.lineno or 1, (error.offset or 0) + 1)
    # lxml forgets an error of namespaces over a warning that comes later; its log does not.
    for entry in parser.error_log:
        if entry.level >= etree.ErrorLevels.ERROR:
            return _fault(entry.message, entry.line, entry.column)
    return None


def _fault(message: str, line: int, column: int) -> tuple[int, int, Fault]:
    words = _PLACE.sub("", message) or "it breaks the rules of XML"
    message = f"the text is not well-formed XML: {clip(words, 200)}"
    return line, column, Fault(0, 0, message, "correct it as the message says")
