"""GP112: attributes that mean nothing where they stand."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer
from gpsfsm.fixing.layout import without_attribute
from gpsfsm.model.printable import clip
from gpsfsm.syntax.text import is_namespace_declaration

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft, Node
    from gpsfsm.syntax.tokens import RawAttribute

_ALLOWED = {"Plan": ("name",), "Control": ("type", "name")}


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per element; an ID becomes the name that the element does not have."""
    for finding in draft.findings("GP112"):
        node = draft.around(draft.offset(finding))
        if node is None:
            continue
        changes = list(_edits(draft, node))
        title = clip(", ".join(each for each, _ in changes), 200)
        edits = tuple(edit for _, edit in changes)
        yield Fix("GP112", title, draft.offset(finding), edits)


def _edits(draft: Draft, node: Node) -> Iterator[tuple[str, Edit]]:
    """The changes: each in words that name what is lost, and its edit."""
    allowed = _ALLOWED.get(node.name)
    named = node.attribute("name") is not None
    for raw in node.tag.attributes:
        if allowed is None:
            if is_namespace_declaration(raw.name):
                yield _removed(draft, raw)
        elif raw.name.lower() == "id" and not named:
            named = True
            edit = Edit(raw.start, raw.start + len(raw.name), "name")
            yield f"'{clip(raw.name, 60)}' written 'name'", edit
        elif raw.name not in allowed:
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
