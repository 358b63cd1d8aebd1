"""Completion: what can be written where the cursor is, also while the text is no XML yet."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape

from lsprotocol.types import (
    TEXT_DOCUMENT_COMPLETION,
    CompletionItem,
    CompletionItemKind,
    CompletionItemTag,
    CompletionList,
    CompletionOptions,
    CompletionParams,
    InsertTextFormat,
    TextEdit,
)

from gpsfsm.capabilities.describe import runner_line
from gpsfsm.lsp.features import Feature
from gpsfsm.lsp.session import outermost
from gpsfsm.lsp.texts import Cursor, Where, cursor_at
from gpsfsm.lsp.words import (
    CONTROLS,
    ELEMENTS,
    LABELS,
    Writable,
    provider_of,
    tell_interface,
    tell_parameter,
    tell_provider,
    writable,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.capabilities.library import Library
    from gpsfsm.lsp.session import Session
    from gpsfsm.lsp.texts import Text
    from gpsfsm.lsp.words import Prose

_ELEMENTS = {"": ("Plan",), "Plan": ("Control", "Runner"), "Control": ("Control", "Runner")}
_SHAPES = {  # where the cursor goes first is $1, where it ends $0
    "Plan": "<Plan>\n\t$0\n</Plan>",
    "Control": '<Control type="$1">\n\t$0\n</Control>',
    "Runner": '<Runner interface="$1" provider="$2"$0/>',
}


@dataclass(frozen=True, slots=True)
class _Choice:
    """One thing that can be written; ``shape`` is its text with places for the cursor."""

    label: str
    kind: CompletionItemKind
    shape: str = ""
    detail: str = ""
    about: Prose | None = None
    deprecated: bool = False


async def complete(session: Session, params: CompletionParams) -> CompletionList | None:
    """The items that can be written here."""
    text = session.text(params.text_document.uri)
    if text is None:
        return None
    cursor = cursor_at(text.content, text.places.offset(params.position))
    if cursor.where is Where.OUTSIDE:
        return None
    setting = await session.setting(text)
    snippets = _snippets(session)
    choices = _choices(session, cursor, setting.library, text.content)
    items = [_item(number, choice, cursor, text, snippets) for number, choice in enumerate(choices)]
    return CompletionList(is_incomplete=False, items=items)


def _snippets(session: Session) -> bool:
    about = session.client.text_document and session.client.text_document.completion
    item = about.completion_item if about else None
    return bool(item and item.snippet_support)


def _choices(session: Session, cursor: Cursor, library: Library, text: str) -> Iterator[_Choice]:
    """In the order in which they are of use."""
    tag = cursor.tag
    if cursor.where is Where.CONTENT or cursor.where is Where.TAG:
        yield from _elements(session, cursor, library, text)
    elif cursor.where is Where.END_TAG:
        for name in cursor.open[-1:]:
            closed = text[cursor.end : cursor.end + 1] == ">"
            yield _Choice(name, CompletionItemKind.Class, name if closed else f"{name}>")
    elif tag is not None and cursor.where is Where.NAME:
        yield from _names(session, cursor, library)
    elif tag is not None and cursor.attribute is not None:
        yield from _values(session, cursor, library)


def _goes_on(cursor: Cursor, text: str) -> bool:
    """True if a tag has more than a name already, so that only the name is to be written."""
    tag = cursor.tag
    return tag is not None and bool(tag.attributes or text[cursor.end : tag.end].strip())


def _elements(session: Session, cursor: Cursor, library: Library, text: str) -> Iterator[_Choice]:
    around = cursor.open[-1] if cursor.open else ""
    named = cursor.where is Where.TAG and _goes_on(cursor, text)
    if not around and outermost(text) not in (None, cursor.start):
        return  # there is one already
    for name in _ELEMENTS.get(around, ()):
        about = session.documentation().text(ELEMENTS[name])
        if named:
            yield _Choice(name, CompletionItemKind.Class, _literal(name), "element", about)
            continue
        yield _Choice(name, CompletionItemKind.Class, _SHAPES[name], "element", about)
    if cursor.open and cursor.where is Where.CONTENT:
        shape = _literal(f"</{around}>")
        yield _Choice(f"/{around}", CompletionItemKind.Class, shape, "end of the element")
    if named or "Runner" not in _ELEMENTS.get(around, ()):
        return
    for name in library.interface_names:
        providers = library.providers_of(name)
        if providers:
            about = session.documentation()
            tell_interface(about, name, library)
            shape = _literal(runner_line(name, providers[0]))
            label = f"Runner {name.rpartition('/')[2]}"
            yield _Choice(label, CompletionItemKind.Snippet, shape, name, about)


def _names(session: Session, cursor: Cursor, library: Library) -> Iterator[_Choice]:
    """Attributes that the tag does not have yet."""
    tag = cursor.tag
    assert tag is not None
    there = set(tag.attributes) - {cursor.attribute.name if cursor.attribute else ""}
    first = {"Control": ("type",), "Runner": ("interface", "provider")}.get(tag.name, ())
    valued = cursor.attribute is not None and cursor.attribute.value_start > 0
    for name in first:
        if name not in there:
            yield _label(session, name, valued)
    if tag.name == "Runner":
        provider = provider_of(library, tag.value("interface"), tag.value("provider"))
        for each in [] if provider is None else writable(provider):
            if provider is not None and there.isdisjoint((each.name, *each.aliases)):
                about = session.documentation()
                tell_parameter(about, each, provider)
                kind = CompletionItemKind.Property
                detail = ", ".join(filter(None, (each.type.value, each.need)))
                yield _Choice(each.name, kind, _attribute(each.name, valued, each), detail, about)
    if "name" not in there and tag.name in ("Control", "Runner"):
        yield _label(session, "name", valued)


def _label(session: Session, name: str, valued: bool) -> _Choice:
    about = session.documentation().text(LABELS[name])
    shape = _attribute(name, valued)
    return _Choice(name, CompletionItemKind.Property, shape, "attribute", about)


def _attribute(name: str, valued: bool, entry: Writable | None = None) -> str:
    """``name="…"``; only the name if there is a value behind it already."""
    if valued:
        return _literal(name)
    values = () if entry is None else entry.values
    if len(values) == 1:
        return _literal(f'{name}="{_written(values[0])}"')
    return f'{_literal(name)}="$1"'


def _values(session: Session, cursor: Cursor, library: Library) -> Iterator[_Choice]:
    tag, attribute = cursor.tag, cursor.attribute
    assert tag is not None
    assert attribute is not None
    if tag.name == "Control" and attribute.name == "type":
        for name, words in CONTROLS.items():
            about = session.documentation().text(words)
            yield _Choice(name, CompletionItemKind.EnumMember, "", "control type", about)
    if tag.name != "Runner":
        return
    if attribute.name == "interface":
        for name in library.interface_names:
            about, entry = session.documentation(), library.interface(name)
            tell_interface(about, name, library)
            old = entry is not None and bool(entry.deprecated)
            yield _Choice(name, CompletionItemKind.Interface, "", "interface", about, old)
    elif attribute.name == "provider":
        wanted = tag.value("interface")
        for provider in library.providers_of(library.translation(wanted) or wanted):
            about = session.documentation()
            tell_provider(about, provider)
            kind, old = CompletionItemKind.Module, bool(provider.deprecated)
            yield _Choice(provider.name, kind, "", "provider", about, old)
    else:
        yield from _of_parameter(tag.value("interface"), tag.value("provider"), cursor, library)


def _of_parameter(
    interface: str, provider: str, cursor: Cursor, library: Library
) -> Iterator[_Choice]:
    described = provider_of(library, interface, provider)
    name = cursor.attribute.name if cursor.attribute else ""
    for entry in [] if described is None else writable(described):
        if name not in (entry.name, *entry.aliases):
            continue
        for value in entry.values:
            yield _Choice(value, CompletionItemKind.EnumMember, "", entry.name)
        if entry.default not in (None, "") and not entry.values:
            yield _Choice(str(entry.default), CompletionItemKind.Value, "", "the default")


def _item(
    number: int, choice: _Choice, cursor: Cursor, text: Text, snippets: bool
) -> CompletionItem:
    shape = choice.shape or _literal(_written(choice.label))
    if cursor.where is Where.TAG and shape.startswith("<"):
        shape = shape[1:]  # the "<" stands there already
    places = "$" in shape.replace("\\$", "")
    new = shape if snippets and places else _plain(shape)
    return CompletionItem(
        label=choice.label,
        kind=choice.kind,
        tags=[CompletionItemTag.Deprecated] if choice.deprecated else None,
        detail=choice.detail or None,
        documentation=choice.about.written() if choice.about else None,
        sort_text=f"{number:05}",
        filter_text=_filter(choice, cursor),
        insert_text_format=InsertTextFormat.Snippet if snippets and places else None,
        text_edit=TextEdit(text.places.range(cursor.start, cursor.end), new),
    )


def _filter(choice: _Choice, cursor: Cursor) -> str | None:
    """The text that is compared with what is typed: the label, or the name behind the package."""
    if cursor.where is Where.CONTENT and not choice.label.startswith("/"):
        return f"<{choice.label}"
    return None


def _literal(text: str) -> str:
    """A text in which nothing is a place for the cursor."""
    return text.replace("\\", "\\\\").replace("$", "\\$").replace("}", "\\}")


def _plain(shape: str) -> str:
    """A shape for an editor that knows no places, on one line: it may not indent any other."""
    parts = re.sub(r"\n\t?", "", shape)
    parts = parts.replace("\\\\", "\0").replace("\\$", "\1").replace("\\}", "}")
    for mark in ("$0", "$1", "$2"):
        parts = parts.replace(mark, "")
    return parts.replace("\1", "$").replace("\0", "\\")


def _written(value: str) -> str:
    return escape(value, {'"': "&quot;"})


FEATURE = Feature(
    TEXT_DOCUMENT_COMPLETION,
    complete,
    CompletionOptions(trigger_characters=["<", '"', " ", "/"]),
)
