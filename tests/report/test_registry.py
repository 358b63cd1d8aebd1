from __future__ import annotations

import importlib.metadata
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest

import gpsfsm.report
from gpsfsm.errors import UsageError
from gpsfsm.report import Format, RenderOptions, find_format, format_names, render
from tests.report.samples import SAMPLES

if TYPE_CHECKING:
    from collections.abc import Callable


def test_the_built_in_formats() -> None:
    assert format_names() == (
        *("text", "github", "gitlab", "json", "jsonl", "junit", "llm", "markdown", "sarif"),
    )


@pytest.mark.parametrize("name", format_names())
def test_a_format_is_named_as_its_module(name: str) -> None:
    assert find_format(name).name == name


@pytest.mark.parametrize("name", format_names())
@pytest.mark.parametrize("sample", SAMPLES)
def test_output_is_the_same_every_time_and_ends_with_a_line_break(name: str, sample: str) -> None:
    output = render(SAMPLES[sample], name)
    assert output.endswith("\n") or (name, sample) == ("jsonl", "empty")  # a line for each plan
    assert output == render(SAMPLES[sample], name, options=RenderOptions())


@pytest.mark.parametrize("name", ["xml", "", "_words", "../text", "text.", "TEXT"])
def test_an_unknown_format_is_a_usage_error_that_lists_the_formats(name: str) -> None:
    with pytest.raises(
        UsageError, match="the formats are: text, github, gitlab, json, jsonl, junit, llm, markdown"
    ):
        find_format(name)


class Entry:
    """An entry point of another package."""

    def __init__(self, name: str, loaded: object) -> None:
        self.name = name
        self.value = f"other_package:{name}"
        self._loaded = loaded

    def load(self) -> object:
        if isinstance(self._loaded, Exception):
            raise self._loaded
        return self._loaded


@pytest.fixture
def offered(monkeypatch: pytest.MonkeyPatch) -> list[Entry]:
    entries: list[Entry] = []

    def entry_points(*, group: str) -> list[Entry]:
        assert group == "gpsfsm.formats"
        return entries

    monkeypatch.setattr(importlib.metadata, "entry_points", entry_points)
    return entries


def test_another_package_can_add_a_format(offered: list[Entry]) -> None:
    count = Format(name="count", render=lambda report, _: f"{len(report.plans)}\n")
    offered.append(Entry("count", count))
    assert render(SAMPLES["mixed"], "count") == "4\n"


def test_another_package_cannot_replace_a_built_in_format(offered: list[Entry]) -> None:
    offered.append(Entry("json", Format(name="json", render=lambda *_: "mine")))
    assert render(SAMPLES["empty"], "json").startswith('{"version": 3')


def test_the_formats_of_other_packages_are_listed(offered: list[Entry]) -> None:
    offered += [Entry("b", None), Entry("a", None)]
    with pytest.raises(UsageError, match=r"sarif, a, b$"):
        find_format("c")


def test_a_format_that_does_not_load_is_a_usage_error(offered: list[Entry]) -> None:
    offered += [Entry("broken", ImportError("no module 'x'")), Entry("wrong", object())]
    with pytest.raises(UsageError, match=r"'broken'.*fails to load: no module 'x'"):
        find_format("broken")
    with pytest.raises(UsageError, match=r"'wrong'.*is not a gpsfsm\.report\.Format"):
        find_format("wrong")


@pytest.mark.parametrize(
    ("render_it", "message"),
    [
        (lambda *_: 1 // 0, "the format 'odd' failed: ZeroDivisionError: integer division"),
        (lambda *_: b"no", "the format 'odd' returned bytes, not text"),
    ],
)
def test_a_format_of_another_package_that_fails_is_a_usage_error(
    offered: list[Entry], render_it: Callable[..., Any], message: str
) -> None:
    offered.append(Entry("odd", Format(name="odd", render=render_it)))
    with pytest.raises(UsageError, match=message):
        render(SAMPLES["mixed"], "odd")


def test_listing_the_formats_imports_none_of_them() -> None:
    code = (
        "import sys, gpsfsm.report as r; r.format_names(); r.find_format('text');"
        "print(*[m for m in sys.modules if m.startswith('gpsfsm.report.') and '._' not in m],"
        "*[m for m in ('lxml', 'networkx', 'z3', 'importlib.metadata') if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.split() == ["gpsfsm.report.text"]


def test_the_surface_is_sorted() -> None:
    assert gpsfsm.report.__all__ == sorted(gpsfsm.report.__all__)
