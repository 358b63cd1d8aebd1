"""Columns: shorter, and the same document again, in Python and in the page."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.viewing.page import packed, unpacked
from tests.viewing.support import document_of

REPO = Path(__file__).parents[2]
WEB = REPO / "gpsfsm" / "viewing" / "web"

_NAMES = st.sampled_from(["kind", "line", "at", "all", "of", "steps", "values", "name", "rows"])
_PLAIN = st.none() | st.booleans() | st.integers(-9, 9) | st.floats(-2, 2) | st.text(max_size=3)
_VALUES = st.recursive(
    _PLAIN,
    lambda inner: st.lists(inner, max_size=12) | st.dictionaries(_NAMES, inner, max_size=4),
    max_leaves=30,
)
_ROWS = st.lists(st.dictionaries(_NAMES, _VALUES, max_size=4), min_size=8, max_size=14)


@given(_VALUES | _ROWS)
def test_what_is_packed_comes_out_again(value: Any) -> None:
    again = unpacked(json.loads(json.dumps(packed(value))))
    assert json.dumps(again, sort_keys=True) == json.dumps(value, sort_keys=True)


def test_true_is_not_one() -> None:
    rows: list[dict[str, Any]] = [{"value": value} for value in (True, 1, 1.0, "1", None) * 3]
    again = unpacked(packed(rows))
    assert [type(row["value"]) for row in again] == [type(row["value"]) for row in rows]


def test_columns_are_shorter() -> None:
    text = (REPO / "corpus" / "plans" / "tour_guide.xml").read_bytes()
    shown = document_of(text)
    assert len(json.dumps(packed(shown))) < 0.8 * len(json.dumps(shown))


def test_the_page_unpacks_the_same() -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    files = sorted((REPO / "corpus" / "plans").glob("*.xml"))[:4]
    odd = [{"line": number * number, "of": number % 2 == 0, "at": []} for number in range(20)]
    odd[3] = {"values": 1}
    value = {"document": document_of(*(file.read_bytes() for file in files)), "odd": odd}
    script = f"""\
const {{ unpack }} = await import({json.dumps((WEB / "state.js").as_uri())});
let text = "";
for await (const part of process.stdin) text += part;
const value = unpack(JSON.parse(text));
if (JSON.stringify(unpack(value)) !== JSON.stringify(value)) throw new Error("unpacked twice");
process.stdout.write(JSON.stringify(value));
"""
    done = subprocess.run(
        [node, "--input-type=module", "--experimental-default-type=module", "--eval", script],
        input=json.dumps(packed(value)),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == value
