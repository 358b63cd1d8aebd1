"""Tables of cells that an attacker has written."""

from __future__ import annotations

import csv
import io

import pytest

from gpsfsm.grading.tables import as_csv, markdown


@pytest.mark.parametrize(
    "cell",
    [
        "[a](javascript:alert(1))",
        "![a](http://e.org/b.png)",
        "<img src=x onerror=alert(1)>",
        "a | b",
        "`code` **bold** ~~gone~~ $x$",
        "https://e.org www.e.org a@e.org",
        "&lt;b&gt;",
    ],
)
def test_markdown_shows_a_cell_as_it_is(cell: str) -> None:
    (_, _, row) = markdown([["head"], [cell]])
    inner = row.removeprefix("| ").removesuffix(" |")
    assert inner.replace("\\", "") == cell
    for mark in "[]<>|`*~$&@":
        assert all(inner[at - 1] == "\\" for at, each in enumerate(inner) if each == mark)
    assert "://" not in inner.replace("\\:", "")
    assert "www." not in inner


@pytest.mark.parametrize("cell", ["=1+1", "+1", "-1", "@SUM(A1)", " =1", "\u3000=1", "\uff1d1"])
def test_csv_holds_no_formula(cell: str) -> None:
    (row,) = csv.reader(io.StringIO(as_csv([[cell, "a=1", "0.5", "b-c"]])))
    assert row == [f"'{cell}", "a=1", "0.5", "b-c"]
