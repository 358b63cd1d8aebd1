"""What other packages add: of several with one name always the same one, and all names on offer."""

from __future__ import annotations

import importlib.metadata
import os
import re
import shlex
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path

import pytest

from gpsfsm.errors import UsageError
from gpsfsm.plugins import find_plugin


@dataclass(frozen=True)
class Entry:
    name: str
    value: str
    loaded: object

    def load(self) -> object:
        return self.loaded


ENTRIES = (Entry("a", "two:A", 2), Entry("b", "x:B", 3), Entry("a", "one:A", 1))


@pytest.mark.parametrize("entries", list(permutations(ENTRIES)))
def test_the_order_of_installation_does_not_matter(
    entries: tuple[Entry, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda *, group: entries)
    assert find_plugin("g", "a", int, noun="thing", expected="number") == (1, ("a", "b"))
    assert find_plugin("g", "c", int, noun="thing", expected="number") == (None, ("a", "b"))
    with pytest.raises(UsageError, match=r"^the thing 'b' \(x:B\) is not a text$"):
        find_plugin("g", "b", str, noun="thing", expected="text")


REPO = Path(__file__).parents[1]
PAGE = (REPO / "docs/how-to/extend.md").read_text("utf-8")


def block(language: str) -> str:
    """The first block of this language in the page about extensions."""
    (text, *_) = re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    return str(text)


def test_the_package_of_the_page_about_extensions_works(tmp_path: Path) -> None:
    project = tomllib.loads(block("toml"))["project"]
    (tmp_path / "lab_checks.py").write_text(block("python"), "utf-8")
    installed = tmp_path / "lab_checks-1.0.dist-info"
    installed.mkdir()
    name, version = project["name"], project["version"]
    (installed / "METADATA").write_text(f"Name: {name}\nVersion: {version}\n", "utf-8")
    points = (
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in entries.items())
        for group, entries in project["entry-points"].items()
    )
    (installed / "entry_points.txt").write_text("".join(points), "utf-8")
    plan = (REPO / "docs/examples/inspection.xml").read_text("utf-8")
    (tmp_path / "plan.xml").write_text(plan, "utf-8")
    _, check, fuzz = block("sh").splitlines()
    environment = os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{REPO}"}

    def output(command: str) -> str:
        arguments = [sys.executable, "-m", *shlex.split(command)]
        done = subprocess.run(
            arguments,
            check=False,
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=120,
        )
        return done.stdout + done.stderr

    assert output(check) == "plan.xml accepted\n"
    assert "broken (1 kind): quick, every run ends within a minute" in output(fuzz)
    source = (tmp_path / "lab_checks.py").read_text("utf-8")
    failing = source.replace("report.plans)", "report.plans if 1 / 0)")
    (tmp_path / "lab_checks.py").write_text(failing, "utf-8")
    assert output(check) == block("text")
