"""The outline of a plan: its controls and runners as a tree."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lsprotocol.types import (
    TEXT_DOCUMENT_DOCUMENT_SYMBOL,
    TEXT_DOCUMENT_FOLDING_RANGE,
    DocumentSymbol,
    DocumentSymbolParams,
    FoldingRange,
    FoldingRangeParams,
    SymbolKind,
)

from gpsfsm.fixing.draft import Node, outline, pieces_of
from gpsfsm.lsp.features import Feature
from gpsfsm.model.plan import NOT_PARAMETERS
from gpsfsm.model.printable import clip
from gpsfsm.syntax import DEFAULT_LIMITS

if TYPE_CHECKING:
    from gpsfsm.lsp.session import Session
    from gpsfsm.lsp.texts import Text

_DEEPEST = 100
"""Levels that are shown: what writes an answer recurses over it."""
_MOST = 10_000
_LONGEST = 80
_KINDS = {"Plan": SymbolKind.Module, "Control": SymbolKind.Namespace, "Runner": SymbolKind.Function}


async def symbols(session: Session, params: DocumentSymbolParams) -> list[DocumentSymbol] | None:
    """All elements, as far as the text can be read."""
    text = session.text(params.text_document.uri)
    if text is None:
        return None
    made: dict[int, tuple[DocumentSymbol, int]] = {}
    top: list[DocumentSymbol] = []
    for node in _nodes(text)[:_MOST]:
        symbol = _symbol(node, text)
        above = made.get(id(node.parent)) if node.parent is not None else None
        depth = 0 if above is None else above[1] + 1
        made[id(node)] = symbol, depth
        if above is None:
            if node.parent is None:
                top.append(symbol)
        elif depth < _DEEPEST:
            _append(above[0], symbol)
    return top or None


async def folds(session: Session, params: FoldingRangeParams) -> list[FoldingRange] | None:
    """The elements that take several lines."""
    text = session.text(params.text_document.uri)
    if text is None:
        return None
    ranges = []
    for node in _nodes(text)[:_MOST]:
        first = text.places.position(node.start).line
        last = text.places.position(node.closing.start if node.closing else node.stop).line
        if last - 1 > first:
            ranges.append(FoldingRange(start_line=first, end_line=last - 1))
    return ranges or None


def _append(above: DocumentSymbol, symbol: DocumentSymbol) -> None:
    if not isinstance(above.children, list):
        above.children = []
    above.children.append(symbol)


def _nodes(text: Text) -> list[Node]:
    return list(outline(pieces_of(text.content, DEFAULT_LIMITS)).nodes.values())


def _symbol(node: Node, text: Text) -> DocumentSymbol:
    def value(name: str) -> str:
        attribute = node.attribute(name)
        return (
            "" if attribute is None else text.content[attribute.value_start : attribute.value_end]
        )

    if node.name == "Runner":
        name = value("interface").rpartition("/")[2] or "Runner"
        parameters = (
            f"{each.name}={text.content[each.value_start : each.value_end]}"
            for each in node.tag.attributes
            if each.name not in NOT_PARAMETERS
        )
        detail = ", ".join(parameters)
    else:
        name = value("type") or node.name
        detail = value("name")
    places = text.places
    return DocumentSymbol(
        name=clip(" ".join(name.split()), _LONGEST) or node.name,
        detail=clip(" ".join(detail.split()), _LONGEST) or None,
        kind=_KINDS.get(node.name, SymbolKind.Object),
        range=places.range(node.start, node.stop),
        selection_range=places.range(node.start, min(node.tag.end, node.stop)),
    )


FEATURE = Feature(TEXT_DOCUMENT_DOCUMENT_SYMBOL, symbols)
FURTHER = (Feature(TEXT_DOCUMENT_FOLDING_RANGE, folds),)
