"""Texts that are written oddly: comments, line ends, references and quotes everywhere."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.porting import UnclearError, port

if TYPE_CHECKING:
    from random import Random

TYPES = ("sequential", "recovery", "parallel_any", "parallel_all")
NAMES = ("a/A", "nav2_capabilities/WaypointRunner", "prompt_capabilities/PromptTextRunner")
BETWEEN = ("", "\n", "\n\n  ", " ", "\r\n", "\t", "<!-- c -->", "\n <!-- d\n e -->\n")
RARELY = ("<?pi x?>", "text", "<![CDATA[ ]]>")
PIECES = (
    *("a", "1", ".0", " ", "\n", "\t", "\r\n", "é", ">", "true", "-", "'", "]]>"),
    *("&amp;", "&lt;", "&quot;", "&apos;", "&#10;", "&#x41;", "&#233;"),
)
BEFORE = (
    "",
    "",
    "<?xml version='1.0'?>",
    "\n",
    "<!-- p -->",
    "<!-- p --><?pi?>",
    "\ufeff",
    "Hi:\n",
)
DECLARED = '<?xml version="1.0" encoding="utf-8"?>\n'
BEHIND = ("", "\n", "<!-- q -->", "<?pi?>\n", " bye")


def between(rng: Random) -> str:
    return rng.choice(RARELY) if rng.random() < 0.03 else rng.choice(BETWEEN)


def runner(rng: Random) -> str:
    quote = rng.choice("\"'")
    pieces = (*PIECES, "&") if rng.random() < 0.1 else PIECES
    value = "".join(rng.choice(pieces) for _ in range(rng.randint(0, 4))).replace(quote, "")
    written = (
        f" text={quote}{value}{quote}",
        ' x="1"',
        "\n   x='2.0' y=\"1e-9\"",
        ' name="n"',
        ' flush="True"',
        ' text="42"',
    )
    name = rng.choice(NAMES) if rng.random() < 0.98 else ""
    tag = (
        f'<Runner{rng.choice((" ", "  "))}interface="{name}" provider="{name}"{rng.choice(written)}'
    )
    return tag + rng.choice(("/>", " />", "></Runner>", f">{between(rng)}</Runner>"))


def text_of(rng: Random) -> str:
    left = rng.randint(1, 5)

    def steps(depth: int) -> str:
        nonlocal left
        parts = [between(rng)]
        for _ in range(rng.randint(0, 3)):
            if left <= 0:
                break
            if depth < 3 and rng.random() < 0.5:
                label = rng.choice(("", ' name="k"'))
                kind = rng.choice(TYPES)
                parts.append(f'<Control type="{kind}"{label}>{steps(depth + 1)}</Control>')
            else:
                left -= 1
                parts.append(runner(rng))
            parts.append(between(rng))
        return "".join(parts)

    return f"{rng.choice((*BEFORE, DECLARED))}<Plan>{steps(0)}</Plan>{rng.choice(BEHIND)}"


def values(text: str) -> list[dict[str, str]]:
    return [dict(element.attrib) for element in ET.fromstring(text).iter("Runner")]  # noqa: S314


def alike(one: str, other: str) -> bool:
    try:
        return math.isclose(float(one), float(other))
    except ValueError:
        return one == other


@pytest.mark.parametrize("engine", ["fabric-v1", "fabric-v2"])
@given(rng=st.randoms(use_true_random=False), unsafe=st.booleans())
def test_odd_texts(engine: str, rng: Random, unsafe: bool) -> None:
    text = text_of(rng)
    try:
        ported = port(text.encode(), engine, unsafe=unsafe)
    except UnclearError:
        return
    if ported.text is None:
        assert ported.losses
        return
    again = port(ported.text if ported.changed else text.encode(), engine)
    assert again.text == ported.text
    assert not again.changed
    if ported.losses:
        return
    try:
        meant = values(text)
    except ET.ParseError:
        return  # it was mended
    for attributes in values(ported.text):
        assert any(
            attributes.keys() == was.keys()
            and all(alike(attributes[name], was[name]) for name in was)
            for was in meant
        )
