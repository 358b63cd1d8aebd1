"""Tags: names, attributes and the ends of tags, as the engines' parser reads them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NoReturn

from gpsfsm.errors import InputError
from gpsfsm.model.engine import EngineAttribute
from gpsfsm.syntax.tinyxml.values import decode

__all__ = ["Tag", "Wrong", "read_tag", "skip_space"]

_BLANKS = r"[ \t\n\v\f\r]*+"
_SPACE = re.compile(_BLANKS)
# Whatever is not ASCII may stand in a name.
_NAMED = "[A-Za-z_:\x80-\U0010ffff][A-Za-z0-9_:.\\-\x80-\U0010ffff]*+"
_NAME = re.compile(_NAMED)
_ATTRIBUTE = re.compile(rf"({_NAMED}){_BLANKS}={_BLANKS}(?:\"([^\"]*+)\"|'([^']*+)')")


class Wrong(Exception):  # noqa: N818  (it carries a result; never leaves this package)
    """What the parser reports.

    ``name`` is its name of the error; ``told`` the offset whose line it tells, -1 for none;
    ``offset`` where the text is wrong.
    """

    def __init__(self, name: str, offset: int, message: str, *, told: int) -> None:
        super().__init__(message)
        self.name, self.offset, self.told = name, offset, told


@dataclass(slots=True)
class Tag:
    """A start tag, an end tag (``closing``) or one that is both (``empty``)."""

    name: str
    start: int
    closing: bool
    attributes: list[EngineAttribute]
    end: int = 0
    empty: bool = False


def skip_space(text: str, at: int) -> int:
    """The offset of the first character from ``at`` that is no white space."""
    match = _SPACE.match(text, at)
    assert match
    return match.end()


def read_tag(text: str, start: int, max_attributes: int) -> Tag:
    """The tag whose ``<`` is at ``start``; raises Wrong.

    Raises InputError for more attributes than ``max_attributes``.
    """
    at = skip_space(text, start + 1)
    closing = text.startswith("/", at)
    name = _NAME.match(text, at + closing)
    if name is None:
        message = "no name of an element follows this '<'"
        raise Wrong("XML_ERROR_PARSING", start, message, told=start)
    tag = Tag(name[0], start, closing, [])
    _attributes(text, name.end(), tag, max_attributes)
    return tag


def _attributes(text: str, at: int, tag: Tag, max_attributes: int) -> None:
    """Read on to the end of the tag."""
    known: set[str] = set()
    while True:
        at = skip_space(text, at)
        match = _ATTRIBUTE.match(text, at)
        if match is None:
            break
        name, double, single = match.groups()
        if name in known:
            message = f"<{tag.name}> has the attribute '{name}' twice"
            raise Wrong("XML_ERROR_PARSING_ATTRIBUTE", at, message, told=at)
        if len(known) >= max_attributes:
            line = text.count("\n", 0, at) + 1
            raise InputError(
                f"line {line}: <{tag.name}> has more than {max_attributes:,} attributes; raise "
                "--max-attributes if it is meant to"
            )
        known.add(name)
        value = decode(single if double is None else double)
        tag.attributes.append(EngineAttribute(name, value, at, match.end()))
        at = match.end()
    if text.startswith(">", at):
        tag.end = at + 1
    elif text.startswith("/>", at):
        # Also of an end tag: </a/> is an element.
        tag.end, tag.empty, tag.closing = at + 2, True, False
    else:
        _no_end(text, at, tag)


def _no_end(text: str, at: int, tag: Tag) -> NoReturn:
    """Raise Wrong: at ``at`` a tag neither ends nor has an attribute that is whole."""
    name = _NAME.match(text, at)
    if name is None:
        message = f"the tag <{tag.name}> does not end here"
        if at == len(text):
            message = f"the text ends inside the tag <{tag.name}>"
        raise Wrong("XML_ERROR_PARSING_ELEMENT", at, message, told=tag.start)
    sign = skip_space(text, name.end())
    quote = skip_space(text, sign + 1)
    what = f"the attribute '{name[0]}' of <{tag.name}>"
    if not text.startswith("=", sign):
        message = f"no '=' follows {what}"
    elif not text.startswith(('"', "'"), quote):
        message = f"the value of {what} is not in quotes"
    else:
        message = f"the quotes around the value of {what} are never closed"
    raise Wrong("XML_ERROR_PARSING_ATTRIBUTE", at, message, told=at)
