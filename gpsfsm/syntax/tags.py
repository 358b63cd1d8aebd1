"""Start tags, end tags and attribute values: strict and fast first, tolerant where that fails.

One pattern takes a whole correct tag. Where it does not match, ``_TolerantReader`` goes through the
tag attribute by attribute, names each error and reads on as if it had been mended. A value without
its closing quote would swallow the text up to the next quote; so a value is taken to end before
what looks like the end of the tag or like the next attribute, if what follows is no end of a value.

``<Runner a="1 b="2"/>``: the quote behind ``b=`` cannot close a value, since a 2 follows it; the
    value ends with ``a="1`` (fault: no closing quote), and ``b="2"`` is the next attribute.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.late import pattern
from gpsfsm.syntax.text import BLANK, NAME, NAME_ASCII, NAME_PATTERN, WHITE, clip
from gpsfsm.syntax.tokens import EndTag, Fault, OverLimit, RawAttribute, StartTag

if TYPE_CHECKING:
    import re

    from gpsfsm.syntax.source import Limits
    from gpsfsm.syntax.text import Finder

_W = f"[{WHITE}]"


def _correct(name: str) -> tuple[re.Pattern[str], re.Pattern[str], re.Pattern[str]]:
    """The patterns of a start tag, of its attributes and of an end tag."""
    pair = rf"{name}{_W}*+={_W}*+(?:\"[^\"<]*+\"|'[^'<]*+')"
    return (
        pattern(rf"<({name})((?:{_W}++{pair})*+){_W}*+(/?+)>"),
        pattern(rf"({name}){_W}*+={_W}*+(?:\"([^\"]*+)\"|'([^']*+)')"),
        pattern(rf"</({name}){_W}*+>"),
    )


_ASCII, _ANY = _correct(NAME_ASCII), _correct(NAME_PATTERN)
_END_TAG_LAX = pattern(r"</([^<>]*+)(>?+)")
_LAX_NAME = pattern(rf"[^{WHITE}<>/=\"']++")
_EQUALS = pattern(rf"{_W}*+((?:={_W}*+)*+)")
_JUNK = pattern(rf"[=\"'][^{WHITE}<>/]*+")
_UNQUOTED = pattern(rf"[^{WHITE}<>\"'=]*+")
_CURLS = "\u201c\u201d\u201e\u201f\u2033\u00ab\u00bb\u2018\u2019\u201a\u2032"  # typographic quotes
_CURLED = pattern(rf"[{_CURLS}]([^{_CURLS}<>]*+)[{_CURLS}]")
_ESCAPED = pattern(r"\\([\"'])([^\\<>\"']*+)\\[\"']")
_LINE = pattern(r"[^<>\n\r]*+")

# A value that runs over the end of its tag into the next one: its closing quote is missing.
_TAG_END = pattern(rf"/?+>{_W}*+<[A-Za-z/!]")

# A value that ends with ' name=' right before the next quote: likewise.
_NEXT_ATTRIBUTE = pattern(rf"{_W}++{NAME_PATTERN}{_W}*+={_W}*+\Z")
_AFTER_VALUE = pattern(rf"{_W}|/|>|\Z")
_TAIL = 200
_MAX_FAULTS = 20


def read_start_tag(text: str, start: int, finder: Finder, limits: Limits) -> StartTag | OverLimit:
    """The start tag at ``start``, where a ``<`` and a name are."""
    tag_pattern, attribute_pattern, _ = _ASCII if text.isascii() else _ANY
    match = tag_pattern.match(text, start)
    if match is None:
        return _TolerantReader(text, start, finder, limits).read()
    name = match[1]
    attributes: list[RawAttribute] = []
    begin, end = match.span(2)
    for pair in attribute_pattern.finditer(text, begin, end):
        value = pair.lastindex or 2
        attributes.append(
            RawAttribute(pair[1], pair.start(), pair.start(value), pair.end(value)),
        )
        if len(attributes) > limits.max_attributes:
            break
    tag = StartTag(start, match.end(), name, attributes, match[3] == "/", [])
    # A short tag holds nothing long: most tags need no further look.
    if len(attributes) > limits.max_attributes or tag.end - start > limits.max_attribute_length:
        over = _over(tag, limits)
        if over:
            return over
    if len(attributes) > 1 and len({attribute.name for attribute in attributes}) < len(attributes):
        return _without_duplicates(tag)
    return tag


def read_end_tag(text: str, start: int) -> EndTag:
    """The end tag at ``start``, where a ``</`` is."""
    _, _, end_pattern = _ASCII if text.isascii() else _ANY
    match = end_pattern.match(text, start)
    if match:
        return EndTag(start, match.end(), match[1], [])
    lax = _END_TAG_LAX.match(text, start)
    end = lax.end() if lax else start + 2
    body = lax[1] if lax else ""
    named = NAME.search(body)
    name = named[0] if named else ""
    length = end - start
    if not name:
        message = f"'{clip(text[start:end])}' is an end tag without a name"
        return EndTag(
            start,
            end,
            "",
            [Fault(start, length, message, "write the name of the element, as in </Control>")],
        )
    if not text.startswith(">", end - 1):
        message = f"the end tag '</{clip(name)}' has no '>'"
        return EndTag(start, end, name, [Fault(start, length, message, "add '>'")])
    message = f"an end tag contains only a name: '{clip(text[start:end])}'"
    hint = f"write '</{clip(name)}>'"
    return EndTag(start, end, name, [Fault(start, length, message, hint)])


def _over(tag: StartTag, limits: Limits) -> OverLimit | None:
    if len(tag.attributes) > limits.max_attributes:
        message = f"an element has more than {limits.max_attributes:,} attributes"
        return OverLimit(tag.start, message, "max-attributes")
    longest = limits.max_attribute_length
    for name, start, value_start, value_end in tag.attributes:
        if value_end - value_start > longest or len(name) > longest:
            message = f"the attribute '{clip(name)}' is longer than {longest:,} characters"
            return OverLimit(start, message, "max-attribute-length")
    if len(tag.name) > longest:
        message = f"the name of an element is longer than {longest:,} characters"
        return OverLimit(tag.start, message, "max-attribute-length")
    return None


def _without_duplicates(tag: StartTag) -> StartTag:
    """The first of each name counts, the others are faults."""
    seen: set[str] = set()
    kept: list[RawAttribute] = []
    for attribute in tag.attributes:
        if attribute.name not in seen:
            seen.add(attribute.name)
            kept.append(attribute)
            continue
        name = clip(attribute.name)
        message = f"<{clip(tag.name)}> has the attribute '{name}' more than once"
        hint = "keep one of them; the first one is used for the rest of the check"
        tag.faults.append(
            Fault(
                attribute.start,
                attribute.value_end + 1 - attribute.start,
                message,
                hint,
                "GP110",
            )
        )
    return tag._replace(attributes=kept)


class _TolerantReader:
    """Reads a start tag that has errors; names each of them and goes on."""

    def __init__(self, text: str, start: int, finder: Finder, limits: Limits) -> None:
        self.text, self.start, self.finder, self.limits = text, start, finder, limits
        match = NAME.match(text, start + 1)
        self.name = match[0] if match else ""
        self.pos = start + 1 + len(self.name)
        self.attributes: list[RawAttribute] = []
        self.faults: list[Fault] = []

    def read(self) -> StartTag | OverLimit:
        """The tag, as far as it goes."""
        text = self.text
        for _ in range(self.limits.max_attributes + 2):
            before = self.pos
            blank = BLANK.match(text, before)
            self.pos = blank.end() if blank else before
            here = text[self.pos : self.pos + 1]
            if here in ("", "<"):
                return self._unclosed(before)
            if here == ">":
                return self._done(self.pos + 1, empty=False)
            if here == "/":
                slash = self._slash()
                if slash:
                    return slash
            else:
                self._attribute(spaced=self.pos > before or not self.attributes)
        message = f"an element has more than {self.limits.max_attributes:,} attributes"
        return OverLimit(self.start, message, "max-attributes")

    def _fault(self, start: int, length: int, message: str, hint: str) -> None:
        self.faults.append(Fault(start, length, message, hint))

    def _done(self, end: int, *, empty: bool, closed: bool = True) -> StartTag | OverLimit:
        tag = StartTag(self.start, end, self.name, self.attributes, empty, self.faults, closed)
        return _over(tag, self.limits) or _without_duplicates(tag)

    def _unclosed(self, end: int) -> StartTag | OverLimit:
        message = f"the tag <{clip(self.name)} is never closed with '>'"
        hint = "end it with '/>', or with '>' if elements belong inside"
        self._fault(self.start, 1 + len(self.name), message, hint)
        return self._done(end, empty=True, closed=False)

    def _slash(self) -> StartTag | OverLimit | None:
        text, slash = self.text, self.pos
        if text.startswith("/>", slash):
            return self._done(slash + 2, empty=True)
        blank = BLANK.match(text, slash + 1)
        after = blank.end() if blank else slash + 1
        if text.startswith(">", after):
            self._fault(
                slash, after + 1 - slash, "nothing may come between '/' and '>'", "write '/>'"
            )
            return self._done(after + 1, empty=True)
        self._fault(slash, 1, f"a stray '/' in the tag <{clip(self.name)}>", "remove it")
        self.pos = slash + 1
        return None

    def _attribute(self, *, spaced: bool) -> None:
        text, start = self.text, self.pos
        lax = _LAX_NAME.match(text, start)
        if lax is None:
            junk = _JUNK.match(text, start)
            end = junk.end() if junk else start + 1
            shown = clip(text[start:end])
            self._fault(
                start,
                end - start,
                f"{shown} does not belong in the tag <{clip(self.name)}>",
                'an attribute is written name="value"',
            )
            self.pos = end
            return
        name, self.pos = lax[0], lax.end()
        if not spaced:
            message = f"a space is missing before the attribute '{clip(name)}'"
            self._fault(start, len(name), message, "put a space between attributes")
        if not NAME.fullmatch(name):
            self._fault(
                start,
                len(name),
                f"'{clip(name)}' is not a valid attribute name",
                'an attribute is written name="value"; names begin with a letter',
            )
        self._value(name, start)

    def _value(self, name: str, start: int) -> None:
        equals = _EQUALS.match(self.text, self.pos)
        signs = equals[1].count("=") if equals else 0
        after = equals.end() if equals else self.pos
        quoted = self.text[after : after + 1] in ('"', "'") and after < len(self.text)
        if not signs and not quoted:
            self._no_value(name, start)
            return
        if not signs:
            self._fault(
                start, len(name), f"'=' is missing after '{clip(name)}'", 'write name="value"'
            )
        if signs > 1:
            self._fault(
                self.pos,
                max(1, after - self.pos),
                f"'{clip(name)}' is followed by more than one '='",
                "keep one",
            )
        value = read_value(self.text, after, name, self.finder)
        if value is None:
            # The blanks before what follows belong to it.
            self.pos = after - 1 if self.text[after - 1] in WHITE else after
            self._no_value(name, start)
            return
        self.faults.extend(value.faults)
        self.pos = value.end
        if NAME.fullmatch(name):
            self.attributes.append(RawAttribute(name, start, value.start, value.stop))

    def _no_value(self, name: str, start: int) -> None:
        if NAME.fullmatch(name):  # else it is reported already, as no name
            message = f"the attribute '{clip(name)}' has no value"
            self._fault(start, len(name), message, f'write {clip(name)}="…" or remove it')


class RawValue(NamedTuple):
    """A value from ``start`` to ``stop``; the tag goes on at ``end``."""

    start: int
    stop: int
    end: int
    faults: list[Fault]


def read_value(text: str, start: int, name: str, finder: Finder) -> RawValue | None:
    """The value of the attribute ``name`` that begins at ``start``; None if there is none."""
    quote = text[start : start + 1]
    if quote and quote in "\"'":
        return _quoted(text, start, name, finder)
    for quotes, what in ((_CURLED, "typographic quotes"), (_ESCAPED, "backslashes")):
        match = quotes.match(text, start)
        if match:
            group = match.lastindex or 1
            length = match.end() - start
            message = f"the value of '{clip(name)}' is written with {what}"
            fault = Fault(start, length, message, 'use plain double quotes: "')
            return RawValue(match.start(group), match.end(group), match.end(), [fault])
    return _unquoted(text, start, name)


def _unquoted(text: str, start: int, name: str) -> RawValue | None:
    match = _UNQUOTED.match(text, start)
    stop = match.end() if match else start
    if text.startswith("/>", stop - 1) and stop > start:
        stop -= 1
    # What an '=' follows is the next attribute, not a value.
    blank = BLANK.match(text, stop)
    if stop == start or text.startswith("=", blank.end() if blank else stop):
        return None
    shown = clip(text[start:stop])
    message = f"the value of '{clip(name)}' is not in quotes"
    fault = Fault(start, stop - start, message, f'write {clip(name)}="{shown}"')
    return RawValue(start, stop, stop, [fault])


def _quoted(text: str, start: int, name: str, finder: Finder) -> RawValue:
    first = start + 1
    close = finder.find(text[start], first)
    if close < 0:
        match = _LINE.match(text, first)
        return _missing_quote(text, start, match.end() if match else first, name)
    less = text.find("<", first, close)
    if not _AFTER_VALUE.match(text, close + 1):
        # What ends here is hardly a value: more likely another one begins.
        overrun = _TAG_END.search(text, first, close)
        if overrun:
            return _missing_quote(text, start, overrun.start(), name)
        following = _NEXT_ATTRIBUTE.search(text, max(first, close - _TAIL), close)
        if following:
            return _missing_quote(text, start, following.start(), name)
    faults: list[Fault] = []
    while 0 <= less < close and len(faults) < _MAX_FAULTS:
        message = f"'<' is not allowed in the value of '{clip(name)}'"
        faults.append(Fault(less, 1, message, "write '&lt;'"))
        less = text.find("<", less + 1, close)
    return RawValue(first, close, close + 1, faults)


def _missing_quote(text: str, start: int, stop: int, name: str) -> RawValue:
    if text.startswith("/>", stop - 1) and stop > start + 1:
        stop -= 1
    while stop > start + 1 and text[stop - 1] in WHITE:
        stop -= 1
    quote = text[start]
    message = f"the value of '{clip(name)}' has no closing {quote}"
    fault = Fault(start, stop - start, message, f"add {quote} at its end")
    return RawValue(start + 1, stop, stop, [fault])
