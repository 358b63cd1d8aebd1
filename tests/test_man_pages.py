"""The man pages: one for each command, sound roff, the same bytes whenever they are made."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from tests.cli.test_explain import load_generator
from tests.cli.test_help import ALL

REPO = Path(__file__).parents[1]
PAGES = sorted((REPO / "man").glob("*.1"))


def test_every_command_has_a_page_with_all_its_options() -> None:
    names = {path.replace(" ", "-"): context for path, context in ALL.items()}
    assert sorted(page.stem for page in PAGES) == sorted(names)
    for page in PAGES:
        text = page.read_text(encoding="ascii")
        for each in names[page.stem].command.params:
            if getattr(each, "hidden", True):
                continue
            assert each.opts[0].replace("-", "\\-") in text


def test_they_are_what_the_generator_makes() -> None:
    made = load_generator().man_pages()
    assert {page.name: page.read_text(encoding="ascii") for page in PAGES} == made


@pytest.mark.skipif(not shutil.which("groff"), reason="needs groff")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_groff_has_no_complaint(page: Path) -> None:
    done = subprocess.run(
        ["groff", "-man", "-ww", "-Tascii", str(page)], capture_output=True, check=True
    )
    assert done.stderr == b""
    assert b"SEE ALSO" in re.sub(b".\x08|\x1b\\[[0-9;]*m", b"", done.stdout)


def test_they_are_shipped() -> None:
    project = tomllib.loads((REPO / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["tool"]["setuptools"]["data-files"] == {"share/man/man1": ["man/*.1"]}
    assert "graft man" in (REPO / "MANIFEST.in").read_text(encoding="utf-8")
