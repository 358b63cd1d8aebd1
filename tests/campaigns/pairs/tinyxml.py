"""Any text: our parser of the engines' dialect against the XML library of the engines itself."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from hypothesis import strategies as st

from gpsfsm.syntax.tinyxml import to_bytes
from tests.campaigns.base import Pair
from tests.syntax.tinyxml.library import Library, missing
from tests.syntax.tinyxml.test_library import mutated, near_xml, ours, texts, trees, values

if TYPE_CHECKING:
    from collections.abc import Iterator


@cache
def _library() -> Library:
    return Library()


def judge(text: str) -> Iterator[str]:
    """The same error on the same line, or the same tree."""
    reading = ours(text)
    assert reading == _library().read(to_bytes(text))
    yield reading.error or "read"


PAIR = Pair(
    name="tinyxml",
    about="any text: our parser of the engines' dialect against TinyXML-2 itself",
    cases=lambda: st.one_of(near_xml, values, texts, trees, mutated(), st.text(max_size=20)),
    judge=judge,
    text=str,
    batch=200,
    missing=missing,
)
