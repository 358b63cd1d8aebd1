"""GP108: text inside a plan."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer
from gpsfsm.syntax.text import WHITE
from gpsfsm.syntax.tokens import TextRun

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft

_DASHES = re.compile(r"-(?=-)")


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per text: it becomes a comment."""
    texts = {run.start: run for run in draft.tokens if isinstance(run, TextRun)}
    for finding in draft.findings("GP108"):
        run = texts.get(draft.offset(finding))
        if run is None:
            continue
        end = run.start + len(draft.text[run.start : run.end].rstrip(WHITE))
        words = _DASHES.sub("- ", draft.text[run.start : end])
        if words.strip("`'\" ") in ("", "/>", ">", "/", "xml"):
            edit, title = Edit(run.start, end), "text removed"
        else:
            # A comment that looks like an instruction to gpsfsm would become one.
            edit, title = Edit(run.start, end, f"<!-- text: {words} -->"), "text made a comment"
        yield Fix("GP108", title, run.start, (edit,))


FIXER = Fixer(
    name="stray-text",
    rules=("GP108",),
    propose=propose,
    safe="makes a comment of text between elements: nothing reads either of them",
)
