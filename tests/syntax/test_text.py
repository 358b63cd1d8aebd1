"""The classes of characters are those of XML 1.0 (fifth edition), character by character."""

from __future__ import annotations

import re

from gpsfsm.syntax.text import ILLEGAL, NAME, NAME_START

NAME_STARTS = [  # production 4
    (ord(":"), ord(":")), (ord("A"), ord("Z")), (ord("_"), ord("_")), (ord("a"), ord("z")),
    (0xC0, 0xD6), (0xD8, 0xF6), (0xF8, 0x2FF), (0x370, 0x37D), (0x37F, 0x1FFF), (0x200C, 0x200D),
    (0x2070, 0x218F), (0x2C00, 0x2FEF), (0x3001, 0xD7FF), (0xF900, 0xFDCF), (0xFDF0, 0xFFFD),
    (0x10000, 0xEFFFF),
]  # fmt: skip
NAME_CHARS = [  # production 4a
    *NAME_STARTS, (ord("-"), ord("-")), (ord("."), ord(".")), (ord("0"), ord("9")), (0xB7, 0xB7),
    (0x300, 0x36F), (0x203F, 0x2040),
]  # fmt: skip
LEGAL = [(0x9, 0xA), (0xD, 0xD), (0x20, 0xD7FF), (0xE000, 0xFFFD), (0x10000, 0x10FFFF)]  # 2


EVERY = "".join(map(chr, range(0x110000)))


def within(ranges: list[tuple[int, int]]) -> str:
    return "".join(EVERY[low : high + 1] for low, high in sorted(ranges))


def test_what_a_name_begins_with() -> None:
    assert "".join(re.findall(NAME_START, EVERY)) == within(NAME_STARTS)


def test_what_a_name_goes_on_with() -> None:
    rest = within(NAME_CHARS)
    assert NAME.fullmatch("a" + rest)
    others = sorted(set(EVERY) - set(rest))
    assert not any(NAME.search("a" + each)[0] != "a" for each in others)  # type: ignore[index]


def test_what_no_text_may_hold() -> None:
    assert ILLEGAL.sub("", EVERY) == within(LEGAL)
