"""GP116: characters that XML forbids, and an encoding that the text is not in."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer
from gpsfsm.syntax.text import ILLEGAL

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft

_RUN = re.compile(f"(?:{ILLEGAL.pattern})++")
_UTF16 = re.compile(
    r"\s*<\?xml[^<>]*?\sencoding\s*=\s*[\"'](utf-?16(?:le|be)?)[\"']", re.IGNORECASE
)
_MOST = 100_000


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix for all characters, and one for the declaration."""
    edits: list[Edit] = []
    for match in _RUN.finditer(draft.text):
        edits.append(Edit(match.start(), match.end()))
        if len(edits) > _MOST:
            return
    if edits:
        title = "characters that XML forbids removed"
        yield Fix("GP116", title, edits[0].start, tuple(edits))
    declared = _UTF16.match(draft.text)
    if declared:
        edit = Edit(declared.start(1), declared.end(1), "UTF-8")
        yield Fix("GP116", "declared encoding written UTF-8", declared.start(1), (edit,))


FIXER = Fixer(
    name="illegal-characters",
    rules=("GP116",),
    propose=propose,
    safe=(
        "removes control characters, and declares UTF-8 where a text declares UTF-16 and is not "
        "written in it: no plan needs either"
    ),
)
