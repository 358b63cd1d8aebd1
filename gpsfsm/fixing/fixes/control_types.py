"""GP106, GP107: types of controls."""

from __future__ import annotations

import re
from difflib import get_close_matches
from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.model.plan import ControlType
from gpsfsm.syntax.hints import control_type_hint, nearest_attribute
from gpsfsm.syntax.text import strip

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft

_TYPES = tuple(kind.value for kind in ControlType)
_PLAIN = {kind.replace("_", ""): kind for kind in _TYPES}
_HINTED = re.compile(r'type="([a-z_]+)"')
_SEQUENCES = ("sequence", "seq")


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per control whose type is missing or misspelt."""
    for node in draft.outline.nodes.values():
        if node.name != "Control":
            continue
        raw = node.attribute("type")
        if raw is None:
            names = [each.name for each in node.tag.attributes if each.name != "name"]
            near = nearest_attribute("type", names)
            attribute = node.attribute(near) if near else None
            if attribute is not None:
                end = attribute.start + len(near)
                edit = Edit(attribute.start, end, "type")
                yield Fix("GP107", f"'{near[:40]}' written 'type'", node.start, (edit,))
            continue
        written = draft.text[raw.value_start : raw.value_end]
        if written in _TYPES:
            continue
        meant, safety = _meant(written)
        if meant:
            edit = Edit(raw.value_start, raw.value_end, meant)
            yield Fix("GP106", f'type="{meant}" written', raw.start, (edit,), safety)


def _meant(written: str) -> tuple[str, Safety]:
    """The type that is meant, "" if nobody can tell."""
    word = re.sub(r"[\W_]", "", strip(written).lower()[:40])
    if word in _PLAIN:
        return _PLAIN[word], Safety.SAFE
    close = get_close_matches(word, _PLAIN, n=2, cutoff=0.85)
    if len(close) == 1:
        return _PLAIN[close[0]], Safety.SAFE
    if word in _SEQUENCES:
        return ControlType.SEQUENTIAL, Safety.SAFE
    hinted = _HINTED.findall(control_type_hint(written))
    return (hinted[0], Safety.UNSAFE) if len(hinted) == 1 else ("", Safety.UNSAFE)


FIXER = Fixer(
    name="control-types",
    rules=("GP106", "GP107"),
    propose=propose,
    safe=(
        "writes `Sequential`, `parallel-all` or `sequance` as it is spelt, and the name of the "
        "attribute `type`: only one of the four types is like it"
    ),
    unsafe=(
        "takes the word of another language, such as `fallback`, for the type that is nearest: "
        "what stands inside may be arranged for that other language"
    ),
)
