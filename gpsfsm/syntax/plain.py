"""The fast reading of plain plans: those about which the front end has nothing to report.

The text is cut at every ``<``, and each piece at every quote. What stands around the values of a
piece is its form. A plan has few different forms: the first piece of each is judged by patterns,
those after it are looked up.

``<Runner interface="a/B" provider="a/B" x="1"/>`` and ``</Plan>`` are the pieces
    form ('Runner interface=', ' provider=', ' x=', '/>'), values a/B, a/B and 1
    form ('/Plan>',), no values

Whatever this reader does not know ends it: a foreign element, an attribute written twice, a
reference that means nothing, text between tags, a limit, anything of which a rule has something to
say. Then the scanner reads the text from its start: it knows all of it and has the words. So what
is read here is well-formed, and both readers say the same of it; tests hold them to that.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.late import maker, pattern
from gpsfsm.model.plan import (
    Attribute,
    ControlType,
    Element,
    Kind,
    Location,
    Plan,
    on_shared_lines,
)
from gpsfsm.syntax.elements import FREE_TEXT, PACKED, is_completion, is_packed
from gpsfsm.syntax.text import ILLEGAL, WHITE
from gpsfsm.syntax.token_reader import MAX_SUPPRESSIONS, Suppression, read_suppression
from gpsfsm.syntax.values import decode, typed

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.syntax.source import Limits
    from gpsfsm.syntax.tokens import Fault

_W = f"[{WHITE}]"
_NAME = "[A-Za-z_][A-Za-z0-9_.-]*+"  # no colon: what belongs to a namespace is not plain
_HEAD = pattern(
    r'(?:<\?xml version="1\.0"(?: encoding="(?i:utf-8)")?+(?: standalone="(?:yes|no)")?+\?>)?+'
    rf"{_W}*+<"
)
_BARE = pattern(rf"(/?+)(Plan|Control|Runner){_W}*+(/?+)>({_W}*+)")
_FIRST = pattern(rf"(Plan|Control|Runner){_W}++({_NAME})=")
_NEXT = pattern(rf"{_W}++({_NAME})=")
_LAST = pattern(rf"{_W}*+(/?+)>({_W}*+)")
_CONTROL_CHARACTERS = bytes(byte for byte in range(32) if byte not in b"\t\n\r")
_PACKED = {quote: pattern(f"={quote}{PACKED}{quote}") for quote in "\"'"}
_NAME_BEFORE = pattern(rf"{_NAME}\Z")
_LONGEST_NAME = 100
_ALLOWED = {Kind.PLAN: {"name"}, Kind.CONTROL: {"type", "name"}}
_NEEDED = {Kind.PLAN: set[str](), Kind.CONTROL: {"type"}, Kind.RUNNER: {"interface", "provider"}}
_TYPES = {kind.value: kind for kind in ControlType}

_attribute = maker(Attribute)
_element = maker(Element, unset=("attributes",))


class PlainPlan(NamedTuple):
    """A plan about which there is nothing to report, and its suppression comments."""

    plan: Plan
    suppressions: tuple[Suppression, ...]


class _UnusualError(Exception):
    """Something is left to the scanner; never leaves this module."""


def read_plain(text: str, file: str, limits: Limits) -> PlainPlan | None:
    r"""The plan in ``text``, where lines end in ``\n`` only; None if it is left to the scanner.

    >>> from gpsfsm.syntax import Limits
    >>> read = read_plain('<Plan><Runner interface="a/B" provider="a/B"/></Plan>', "", Limits())
    >>> read.plan.path(1)
    '/Plan/Runner[1]'
    """
    head = _HEAD.match(text)
    if head is None:
        return None
    start = head.end() - 1
    quote = '"' if text.find('="', start) >= 0 else "'"
    if not _is_plain(text, quote):
        return None
    try:
        return _PlainReader(text, file, limits).read(start, quote)
    except _UnusualError:
        return None


def _is_plain(text: str, quote: str) -> bool:
    """True if no character is illegal, every reference is right and no value packs numbers."""
    if text.isascii():
        if len(text.encode("ascii").translate(None, _CONTROL_CHARACTERS)) < len(text):
            return False
    elif ILLEGAL.search(text):
        return False
    if "&" in text:
        faults: list[Fault] = []
        decode(text, 0, faults)
        if faults:
            return False
    for packed in _PACKED[quote].finditer(text):
        start = packed.start()
        name = _NAME_BEFORE.search(text, max(0, start - _LONGEST_NAME), start)
        if name is None or name[0] not in FREE_TEXT:
            return False
    return True


# ---- Forms of tags -------------------------------------------------------------------------------


class _Form:
    """The form of pieces: what all those have in common that differ in values only.

    ``parts``: their number in the piece, values included. ``places``: of each attribute, the line
    ends before its name, its column if there are any, else the code points since the name of the
    attribute before it, which count but for its value. ``newlines``, ``tabs``: in the whole piece.
    ``tail``: the blanks behind the tag; ``after``: those behind their last line end, else -1.
    """

    __slots__ = (
        *("after", "empty", "end", "interface", "kind", "names", "newlines", "parts", "places"),
        *("provider", "tabs", "tail", "type"),
    )

    def __init__(self, key: tuple[str, ...]) -> None:
        self.parts = 2 * len(key) - 1
        self.newlines = sum(part.count("\n") for part in key)
        self.tabs = sum(part.count("\t") for part in key)
        self.names: tuple[str, ...] = ()
        self.places: tuple[tuple[int, int], ...] = ()
        if len(key) == 1:
            bare = _BARE.fullmatch(key[0])
            if bare is None or (bare[1] and bare[3]):
                raise _UnusualError
            _, name, slash, blanks = bare.groups()
            self.end = bool(bare[1])
        else:
            last = _LAST.fullmatch(key[-1])
            if last is None:
                raise _UnusualError
            slash, blanks = last.groups()
            name = self._attributes(key)
            self.end = False
        self.kind = Kind(name)
        self.empty = bool(slash)
        self.tail = len(blanks)
        self.after = len(blanks) - blanks.rfind("\n") - 1 if "\n" in blanks else -1
        self.interface, self.provider, self.type = (
            self.names.index(each) if each in self.names else -1
            for each in ("interface", "provider", "type")
        )
        if not (self.end or _NEEDED[self.kind] <= set(self.names)):
            raise _UnusualError
        if not set(self.names) <= _ALLOWED.get(self.kind, set(self.names)):
            raise _UnusualError

    def _attributes(self, key: tuple[str, ...]) -> str:
        """The name of the tag; notes the names and places of its attributes."""
        first = _FIRST.fullmatch(key[0])
        if first is None:
            raise _UnusualError
        names = [first[2]]
        for part in key[1:-1]:
            following = _NEXT.fullmatch(part)
            if following is None:
                raise _UnusualError
            names.append(following[1])
        if len(set(names)) < len(names) or "xmlns" in names or max(map(len, names)) > _LONGEST_NAME:
            raise _UnusualError
        self.names = tuple(names)
        places = []
        since = 1  # the "<"
        for name, part in zip(names, key, strict=False):
            lead = len(part) - len(name) - 1
            newlines = part.count("\n")
            places.append((newlines, lead - part.rfind("\n") if newlines else since + lead))
            since = len(name) + len('=""')
        self.places = tuple(places)
        return first[1]


def _form_of(key: tuple[str, ...], limits: Limits) -> _Form:
    """The form of a key. Plans of one author have the same forms, so some of them are kept."""
    form = _KEPT.get(key)
    if form is None:
        form = _Form(key)
        if len(_KEPT) < _MAX_KEPT and sum(map(len, key)) < _LONGEST_KEPT:
            _KEPT[key] = form
    if len(form.names) > limits.max_attributes:
        raise _UnusualError
    return form


_KEPT: dict[tuple[str, ...], _Form] = {}
_MAX_KEPT = 2000
_LONGEST_KEPT = 300


class _Tag:
    """The attributes of a tag as they are written."""

    __slots__ = ("form", "values")

    def __init__(self, form: _Form, values: list[str]) -> None:
        self.form, self.values = form, values

    def attributes(self, line: int, column: int) -> tuple[Attribute, ...]:
        """The attributes of the tag that begins at ``line`` and ``column``."""
        attributes = []
        length = 0
        form = self.form
        for name, (newlines, step), value in zip(form.names, form.places, self.values, strict=True):
            line += newlines
            column = step if newlines else column + step + length
            length = len(value)
            text = decode(value, 0, []) if "&" in value else value
            attributes.append(_attribute(name, text, typed(text), line, column))
        return tuple(attributes)

    def refuse_packed(self) -> None:
        """Leave it to the scanner if a value packs numbers by references: ``1&#44;2``."""
        for name, value in zip(self.form.names, self.values, strict=True):
            if "&" in value and is_packed(name, decode(value, 0, [])):
                raise _UnusualError


# ---- Pieces and elements -------------------------------------------------------------------------


class _Open:
    """An open element, and how many runners and controls are in it so far.

    Outside of all ``around`` is None. ``holds``: runners and controls may be in it.
    """

    __slots__ = (
        *("around", "children", "controls", "depth", "element", "holds", "parent", "runners"),
    )

    def __init__(self, around: _Open | None, element: Element | None) -> None:
        self.around, self.element = around, element
        self.parent = -1 if element is None else element.index
        self.holds = element is not None and element.kind is not Kind.RUNNER
        self.depth: int = 0 if around is None else around.depth + 1
        self.children: list[int] = []
        self.runners = self.controls = 0


class _Remark(NamedTuple):
    """A suppression comment; ``scope`` is the index of the element it covers, else -1."""

    rules: tuple[str, ...]
    reason: str
    line: int
    column: int
    scope: int


class _PlainReader:
    """Reads one text. ``names``: those of capabilities so far, so that each is kept only once.

    Nobody else has the elements before all is read, so until then they are written to.
    """

    def __init__(self, text: str, file: str, limits: Limits) -> None:
        self.text, self.file, self.limits = text, file, limits
        self.elements: list[Element] = []
        self.remarks: list[_Remark] = []
        self.names: dict[str, str] = {}
        self.tabs = 0
        self.crowded = False

    def read(self, start: int, quote: str) -> PlainPlan:
        """The plan that begins at ``start``, or behind the comments there."""
        text, limits, elements = self.text, self.limits, self.elements
        pieces = text[start + 1 :].split("<")
        if len(pieces) > limits.max_markup or max(map(len, pieces)) > limits.max_attribute_length:
            raise _UnusualError
        line = self._pieces(iter(pieces), start, quote)
        # All line ends and tabs are between tags, in tags or in comments. So none is in a value,
        # where it would stand for a blank.
        if line <= text.count("\n") or self.tabs < text.count("\t", start):
            raise _UnusualError
        if not 1 < len(elements) <= limits.max_elements:
            raise _UnusualError
        if is_completion(elements[elements[0].children[-1]].interface):
            raise _UnusualError
        if self.crowded:
            for element, shares in zip(elements, on_shared_lines(elements), strict=True):
                object.__setattr__(element, "shares_line", shares)
        plan = Plan(self.file, tuple(elements))
        return PlainPlan(plan, self._suppressions(plan))

    def _pieces(self, pieces: Iterator[str], start: int, quote: str) -> int:
        """Read all pieces, the first of which begins at ``start``; the last line."""
        text, references = self.text, "&" in self.text
        line, column = 1 + text.count("\n", 0, start), start - text.rfind("\n", 0, start)
        forms: dict[tuple[str, ...], _Form] = {}
        here = _Open(None, None)
        tag_line = 0
        for piece in pieces:
            parts = piece.split(quote)
            key = tuple(parts[::2])
            form = forms.get(key)
            if form is None:
                if piece.startswith("!--"):
                    end = start + self._comment(piece, pieces, line, column)
                    # Not looked for before ``start``: many comments on one line would take a time
                    # that grows with its square.
                    newline = text.rfind("\n", start, end)
                    line += text.count("\n", start, end)
                    column = end - newline if newline >= 0 else column + end - start
                    start = end
                    continue
                form = forms[key] = _form_of(key, self.limits)
            if len(parts) != form.parts:
                raise _UnusualError
            end = start + len(piece) + 1
            if form.end:
                here = self._close(form, here)
            else:
                tag = _Tag(form, parts[1::2])
                if references and "&" in piece:
                    tag.refuse_packed()
                here = self._element(tag, here, (line, column, start, end - form.tail))
                if line == tag_line:
                    self.crowded = True
                tag_line = line
            self.tabs += form.tabs
            line += form.newlines
            if form.after >= 0:
                column = form.after + 1
            else:
                column = end - text.rfind("\n", 0, end) if form.newlines else column + end - start
            start = end
        if here.around is not None:
            raise _UnusualError
        return line

    def _element(self, tag: _Tag, here: _Open, place: tuple[int, int, int, int]) -> _Open:
        """A start tag; what is open behind it. ``place``: line, column, begin and end."""
        form, elements = tag.form, self.elements
        index, kind, control_type = len(elements), form.kind, None
        if here.holds:
            here.children.append(index)
        elif kind is not Kind.PLAN or elements:
            raise _UnusualError
        if kind is Kind.RUNNER:
            ordinal = here.runners = here.runners + 1
            self._names(tag)
        else:
            ordinal = here.controls = here.controls + 1
            if kind is Kind.PLAN:
                control_type = ControlType.SEQUENTIAL
            else:
                control_type = _TYPES.get(tag.values[form.type])
            if control_type is None or form.empty or (kind is Kind.PLAN and index):
                raise _UnusualError
        element = _element(
            index, kind, here.parent, ordinal, (), *place, control_type, "", False, tag, "", ""
        )
        elements.append(element)
        if form.empty:
            return here
        opened = _Open(here, element)
        if opened.depth + opened.holds > self.limits.max_depth:
            raise _UnusualError
        return opened

    def _names(self, tag: _Tag) -> None:
        """Keep the names of interface and provider once; none may be blank."""
        names, values, form = self.names, tag.values, tag.form
        for place in (form.interface, form.provider):
            value = values[place]
            name = names.get(value)
            if name is None:
                if not decode(value, 0, []).strip(WHITE):
                    raise _UnusualError
                name = names[value] = value
            values[place] = name

    def _close(self, form: _Form, open_: _Open) -> _Open:
        """An end tag, so that an element is complete; what is around it."""
        element, around = open_.element, open_.around
        if element is None or around is None or form.kind is not element.kind:
            raise _UnusualError
        if open_.holds and not open_.children:
            raise _UnusualError
        object.__setattr__(element, "children", tuple(open_.children))
        if self.remarks:
            self._cover_nothing()
        return around

    # ---- comments --------------------------------------------------------------------------

    def _comment(self, piece: str, pieces: Iterator[str], line: int, column: int) -> int:
        """A comment and the blanks behind it: the number of code points."""
        parts = [piece]
        while "-->" not in parts[-1]:
            following = next(pieces, None)
            if following is None:
                raise _UnusualError
            parts.append(following)
        whole = "<".join(parts)
        dashes = whole.find("--", 3)
        if not whole.startswith("-->", dashes) or whole[dashes + 3 :].strip(WHITE):
            raise _UnusualError
        self.tabs += whole.count("\t")
        read = read_suppression(whole[3:dashes])
        if read and len(self.remarks) < MAX_SUPPRESSIONS:
            self.remarks.append(_Remark(*read, line, column, len(self.elements)))
        return len(whole) + 1

    def _cover_nothing(self) -> None:
        """The suppression comments read last are followed by no element."""
        remarks, following = self.remarks, len(self.elements)
        place = len(remarks)
        while place and remarks[place - 1].scope == following:
            place -= 1
            remarks[place] = remarks[place]._replace(scope=-1)

    def _suppressions(self, plan: Plan) -> tuple[Suppression, ...]:
        self._cover_nothing()
        suppressions = []
        for rules, reason, line, column, covered in self.remarks:
            scope = "" if covered < 0 else plan.path(covered)
            suppressions.append(Suppression(rules, reason, Location(line, column, scope), scope))
        return tuple(suppressions)
