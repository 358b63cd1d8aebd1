"""The documentation site: complete, built strictly, and nothing in it is loaded from elsewhere."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
import yaml

from gpsfsm.version import REPOSITORY

REPO = Path(__file__).parents[1]
DOCS = REPO / "docs"
_LOADED = re.compile(
    r"<(?:script|img|iframe|source)\b[^>]*\bsrc=\"?(https?:[^\"\s>]+)"
    r"|<link\b[^>]*\brel=\"?(?:stylesheet|preconnect|icon|preload)\"?[^>]*\bhref=\"?(https?:[^\"\s>]+)"
    r"|url\((https?:[^)]+)\)"
)


def _hook() -> Any:
    spec = importlib.util.spec_from_file_location("mkdocs_hook", DOCS / "mkdocs_hook.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


HOOK = _hook()


class _Loader(yaml.SafeLoader):
    """Reads mkdocs.yml without making the objects that its tags name."""


_Loader.add_multi_constructor("tag:yaml.org,2002:python/", lambda *_: None)


def navigation() -> list[Any]:
    settings = yaml.load((REPO / "mkdocs.yml").read_text("utf-8"), _Loader)  # noqa: S506
    return HOOK._filled(settings["nav"])


def pages(entry: object) -> list[str]:
    """The pages of a part of the navigation."""
    if isinstance(entry, str):
        return [entry]
    parts = entry.values() if isinstance(entry, dict) else entry
    assert isinstance(parts, Iterable), parts
    return [page for part in parts for page in pages(part)]


def test_every_page_is_in_the_navigation_once() -> None:
    there = sorted(file.relative_to(DOCS).as_posix() for file in DOCS.rglob("*.md"))
    assert sorted(pages(navigation())) == there


def test_rules_are_listed_by_family() -> None:
    index, *families = HOOK.rule_pages()
    assert index == "rules/index.md"
    titles = [title for family in families for title in family]
    assert titles[0] == "GP1xx: Plan text"
    for family in families:
        ((title, rules),) = family.items()
        assert rules
        for rule in rules:
            ((name, file),) = rule.items()
            assert re.fullmatch(r"GP\d+ [\w-]+", name)
            assert file.startswith(f"rules/{title[:3]}")


@pytest.mark.parametrize(
    ("page", "target", "wanted"),
    [
        ("index.md", "cli.md", "cli.md"),
        ("index.md", "../CONTRIBUTING.md", "{}/blob/main/CONTRIBUTING.md"),
        ("how-to/ci.md", "../gate.md", "../gate.md"),
        ("how-to/ci.md", "../../corpus/plans", "{}/tree/main/corpus/plans"),
        (
            "runners.md",
            "examples/my_robot/gripper.py",
            "{}/blob/main/docs/examples/my_robot/gripper.py",
        ),
        ("index.md", "nowhere.md", "nowhere.md"),
        ("index.md", "https://example.org/a.md", "https://example.org/a.md"),
    ],
)
def test_links_out_of_the_site_lead_to_the_repository(page: str, target: str, wanted: str) -> None:
    there = {"cli.md", "gate.md", "index.md"}
    text = f"see [it]({target}#part)"
    rewritten = HOOK._links_rewritten(text, page, there)
    assert rewritten == f"see [it]({wanted.format(REPOSITORY)}#part)"


def test_the_owner_is_that_of_the_package() -> None:
    assert HOOK.REPOSITORY == REPOSITORY
    assert "github.com" not in (REPO / "mkdocs.yml").read_text("utf-8")


def test_pictures_of_engines_are_drawn() -> None:
    text = (DOCS / "engines.md").read_text("utf-8")
    fences = [each for each in HOOK._FENCED.finditer(text) if each[2] == "mermaid"]
    assert len(fences) > 5
    assert all(HOOK._drawn(each).startswith('<div class="picture">\n<svg') for each in fences)


def build(folder: Path, version: str = "") -> None:
    """Build the site, strictly, or a version of it as mike does; skipped where MkDocs is not."""
    if find_spec("material") is None:
        pytest.skip("MkDocs Material is not installed")
    of_version = {"MIKE_DOCS_VERSION": version} if version else {}
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "-d", str(folder)],
        cwd=REPO,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1", **of_version},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert (done.returncode, done.stderr.strip()) == (0, ""), done.stdout + done.stderr


@pytest.mark.commands
def test_the_site_is_built_and_loads_nothing_from_elsewhere(tmp_path: Path) -> None:
    build(tmp_path)
    texts = {
        file: file.read_text("utf-8")
        for kind in ("html", "css")
        for file in tmp_path.rglob(f"*.{kind}")
    }
    assert len(texts) > len(list(DOCS.rglob("*.md")))
    loaded = {
        (file.name, next(filter(None, each)))
        for file, text in texts.items()
        for each in _LOADED.findall(text)
    }
    assert loaded == set()
    assert not [file.name for file in texts if 'class="mermaid"' in texts[file]]
    assert "welcome" in (tmp_path / "search" / "search_index.json").read_text("utf-8")
