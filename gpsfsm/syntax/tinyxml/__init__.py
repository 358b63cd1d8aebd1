"""Plans as the original engines read them: with the parser TinyXML-2, release 11.

It takes much that is no XML (text around the plan, bare ``&`` and ``<``, white space where XML has
none) and refuses some that is. What is here behaves the same; ``tests/syntax/tinyxml`` compares it
with the library itself.
"""

from gpsfsm.syntax.tinyxml.parser import parse_document, plan_of, position

__all__ = ["parse_document", "plan_of", "position"]
