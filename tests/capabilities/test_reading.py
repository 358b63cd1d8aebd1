"""YAML that is broken or hostile, and the places of values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.capabilities.defects import Notes
from gpsfsm.capabilities.files import MAX_BYTES
from gpsfsm.capabilities.reading import Items, Scalar, Table, read_table
from tests.capabilities.support import INTERFACE, load, write

if TYPE_CHECKING:
    from pathlib import Path

REFUSED = {
    "anchor_and_alias": (
        "a: &x 1\nb: *x\n",
        [
            "f:1:4: error: the anchor '&x' is not allowed\n"
            "    remove it, and write the value out where it is used",
            "f:2:4: error: the alias '*x' is not allowed\n    write the value out",
        ],
    ),
    "python_tag": (
        "a: !!python/object/apply:os.system [ls]\n",
        ["f:1:4: error: the tag '!!python/object/apply:os.system' is not allowed\n    remove it"],
    ),
    "own_tag": ("a: !x 1\n", ["f:1:4: error: the tag '!x' is not allowed\n    remove it"]),
    "binary_tag": (
        "a: !!binary aGk=\n",
        ["f:1:4: error: the tag '!!binary' is not allowed\n    remove it"],
    ),
    "documents": (
        "a: 1\n---\nb: 1\n",
        [
            "f:2:1: error: the file holds several documents\n"
            "    put each capability into a file of its own"
        ],
    ),
    "duplicate": (
        "a: 1\nb:\n  c: 1\n  c: 2\n",
        ["f:4:3: error: the key 'c' is here twice, first in line 3\n    remove one of them"],
    ),
    "key": ("? [a]\n: 1\n", ["f:1:3: error: a key must be a text, not a list, mapping or alias"]),
    "empty": (
        "",
        ["f:1:1: error: the file is empty\n    describe a capability in it, or remove it"],
    ),
    "comment": (
        "# nothing\n",
        ["f:1:1: error: the file is empty\n    describe a capability in it, or remove it"],
    ),
    "list": ("- a\n", ["f:1:1: error: the file holds a list, not lines of the form 'key: …'"]),
    "word": ("\nhello\n", ["f:2:1: error: the file holds text, not lines of the form 'key: …'"]),
    "open_quote": (
        'a: "x\nb:\n  "c": 1\n',
        [
            "f:3:4: error: this is not YAML: expected <block end>, but found '<scalar>' "
            "(while parsing a block mapping that begins at line 1)\n"
            "    a quotation mark above it may not be closed"
        ],
    ),
    "tab": (
        "a:\n\tb: 1\n",
        [
            "f:2:1: error: this is not YAML: found character '\\t' that cannot start any token\n"
            "    indent with blanks, not with tabs"
        ],
    ),
    "colon": (
        "a: b: c\n",
        [
            "f:1:5: error: this is not YAML: mapping values are not allowed here\n"
            "    put quotation marks around the whole text if it holds a colon and a blank"
        ],
    ),
    "control": (
        "a: é\nb: \x07\n",
        ["f:2:4: error: the character U+0007 is not allowed in YAML\n    remove it"],
    ),
    "deep": ("a: " + "[" * 100_000, ["f:1:53: error: this is nested more than 50 levels deep"]),
    "deep_block": ("- " * 100_000, ["f:1:101: error: this is nested more than 50 levels deep"]),
    "deep_flow": ("{a: " * 1000, ["f:1:201: error: this is nested more than 50 levels deep"]),
    "many": (
        "a: [" + "1," * 30_000 + "]",
        ["f:1:39999: error: the file holds more than 20000 values\n    split it up"],
    ),
}


def read(text: str | bytes) -> tuple[Table | None, list[str]]:
    notes = Notes("f")
    table = read_table(text.encode() if isinstance(text, str) else text, notes)
    return table, [str(defect) for defect in notes.defects]


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused(case: str) -> None:
    text, expected = REFUSED[case]
    parsed, texts = read(text)
    assert texts == expected
    assert parsed is None


def test_a_bomb_of_aliases_is_refused_where_it_begins() -> None:
    lines = ["a0: &a0 [x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 40)]
    parsed, texts = read("\n".join(lines))
    assert parsed is None
    assert texts[0].startswith("f:1:5: error: the anchor '&a0' is not allowed")
    assert len(texts) == 100


def test_binary_and_other_encodings_are_refused() -> None:
    assert read(b"a: 1\nb: \xff\xfe\n")[1] == [
        "f:2:1: error: this is not UTF-8 text (byte 9 of the file)"
    ]
    assert len(read(bytes(range(256)) * 10)[1]) == 1
    assert len(read("a: 1".encode("utf-16"))[1]) == 1


def test_a_huge_file_is_not_parsed() -> None:
    parsed, texts = read(b"a: " + b"x" * MAX_BYTES)
    assert parsed is None
    assert texts == ["f:1:1: error: the file is larger than 1048576 bytes\n    split it up"]


def test_a_huge_number_stays_text() -> None:
    for digits in ("9" * 5000, "1" + ":59" * 5000, "0x_", "1" + "_" * 200):
        parsed, texts = read(f"a: {digits}\n")
        assert texts == []
        assert parsed is not None
        assert parsed["a"] == Scalar(digits, digits, (1, 1))


def test_places_are_those_of_keys_and_items() -> None:
    text = "é: 1\nlist:\n  - one\n  - {a: 1, bc: 2}\n"
    parsed, texts = read(text)
    assert (texts, parsed is not None) == ([], True)
    assert parsed is not None
    assert parsed.places == {"é": (1, 1), "list": (2, 1)}
    items = parsed["list"]
    assert isinstance(items, Items)
    assert [item.place for item in items] == [(3, 5), (4, 5)]
    assert isinstance(items[1], Table)
    assert items[1].places == {"a": (4, 6), "bc": (4, 12)}


@pytest.mark.parametrize("text", ["on: 1\n", "yes: 1\n", "'on': 1\n", "!!str on: 1\n"])
def test_keys_are_texts(text: str) -> None:
    parsed, texts = read(text)
    assert texts == []
    assert parsed is not None
    assert all(isinstance(key, str) for key in parsed)
    assert next(iter(parsed)) in text


def test_values_are_typed_and_keep_their_text() -> None:
    text = "a: 1.50\nb: on\nc: ~\nd: '1'\ne: !!str 1\nf: 0x10\ng: 2020-01-01\nh: !!int '3'\n"
    parsed, texts = read(text)
    assert texts == []
    assert parsed is not None
    pairs = [(node.value, node.text) for node in parsed.values() if isinstance(node, Scalar)]
    assert pairs == [
        (1.5, "1.50"),
        (True, "on"),
        (None, "~"),
        ("1", "1"),
        ("1", "1"),
        (16, "0x10"),
        ("2020-01-01", "2020-01-01"),
        (3, "3"),
    ]


def test_a_byte_order_mark_and_line_ends_of_windows_do_not_matter(tmp_path: Path) -> None:
    plain = load(tmp_path / "a", {"arm/interfaces/Grasp.yaml": INTERFACE})
    text = b"\xef\xbb\xbf" + INTERFACE.replace("\n", "\r\n").encode()
    other = load(tmp_path / "b", {"arm/interfaces/Grasp.yaml": text})
    assert plain.defects == other.defects == ()
    assert other.library.interfaces[0].version == plain.library.interfaces[0].version == "1.2"


def test_a_file_that_cannot_be_read_is_a_defect(tmp_path: Path) -> None:
    write(tmp_path, {"arm/interfaces/Grasp.yaml": INTERFACE})
    (tmp_path / "arm/interfaces/Gone.yaml").symlink_to(tmp_path / "nowhere")
    loaded = load(tmp_path, {})
    assert [(defect.file, defect.message) for defect in loaded.defects] == [
        (
            str(tmp_path / "arm/interfaces/Gone.yaml"),
            "the file cannot be read: No such file or directory",
        )
    ]
    assert len(loaded.library.interfaces) == 1
