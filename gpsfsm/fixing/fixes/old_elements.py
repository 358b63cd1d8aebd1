"""GP105, GP107: the elements of plans of 2024, ``<Event name=…>`` and ``<Control name=…>``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer
from gpsfsm.fixing.layout import rename
from gpsfsm.model.plan import ControlType
from gpsfsm.syntax.text import strip

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per element of the old form."""
    for node in draft.outline.nodes.values():
        label = node.attribute("name")
        if label is None:
            continue
        end = label.start + len(label.name)
        if node.name == "Event" and node.attribute("interface") is None:
            edits = (*rename(node, "Runner"), Edit(label.start, end, "interface"))
            yield Fix("GP105", "<Event name=…> written <Runner interface=…>", node.start, edits)
        elif node.name == "Control" and node.attribute("type") is None:
            value = strip(draft.text[label.value_start : label.value_end])
            if value in tuple(ControlType):
                edit = Edit(label.start, end, "type")
                yield Fix("GP107", f'name="{value}" written type="{value}"', node.start, (edit,))


FIXER = Fixer(
    name="old-elements",
    rules=("GP105", "GP107"),
    propose=propose,
    safe=(
        "writes the elements of 2024 in today's form: no executor of today reads the old one, and "
        "it has one meaning only"
    ),
)
