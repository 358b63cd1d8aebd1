"""GP112: attributes that mean nothing where they stand."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.fixing.edit import Edit, Fix
from gpsfsm.fixing.fixer import Fixer
from gpsfsm.fixing.layout import without_attribute
from gpsfsm.model.printable import clip
from gpsfsm.syntax.namespaces import is_declaration

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft
    from gpsfsm.fixing.elements import Node
    from gpsfsm.syntax.tokens import RawAttribute

__all__ = ["FIXER"]

_KNOWN = {"Plan": ("name",), "Control": ("type", "name")}


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per element; an ID becomes the name that the element does not have."""
    for finding in draft.findings("GP112"):
        node = draft.around(draft.offset(finding))
        if node is None:
            continue
        found = list(_edits(draft, node))
        title = clip(", ".join(each for each, _ in found), 200)
        edits = tuple(edit for _, edit in found)
        yield Fix("GP112", title, draft.offset(finding), edits)


def _edits(draft: Draft, node: Node) -> Iterator[tuple[str, Edit]]:
    """What is done, in words that name what is lost; and the edit."""
    known = _KNOWN.get(node.name)
    named = node.attribute("name") is not None
    for raw in node.tag.attributes:
        if known is None:
            if is_declaration(raw.name):
                yield _removed(draft, raw)
        elif raw.name.lower() == "id" and not named:
            named = True
            edit = Edit(raw.start, raw.start + len(raw.name), "name")
            yield f"'{clip(raw.name, 60)}' written 'name'", edit
        elif raw.name not in known:
            yield _removed(draft, raw)


def _removed(draft: Draft, raw: RawAttribute) -> tuple[str, Edit]:
    return f"'{clip(raw.name, 60)}' without effect removed", without_attribute(draft, raw)


FIXER = Fixer(
    name="foreign-attributes",
    rules=("GP112",),
    propose=propose,
    safe=(
        "removes attributes of `<Plan>` and `<Control>` that nothing reads, and writes `ID` as "
        "`name`: neither has any effect"
    ),
)
