"""The public surface: nothing that users read imports from elsewhere, and its page is current."""

from __future__ import annotations

import ast
import importlib.util
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

import gpsfsm
from gpsfsm import strategies

if TYPE_CHECKING:
    from collections.abc import Iterator

REPO = Path(__file__).parents[1]
PAGES = [REPO / "README.md", *sorted((REPO / "docs").rglob("*.md"))]
EXAMPLES = sorted(
    file for folder in ("docs/examples", "examples") for file in (REPO / folder).rglob("*.py")
)
_BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
_COMMAND = re.compile(r"""python3? -c (["'])(.*?)\1""")
_IMPORT = re.compile(r"^\s*(?:from\s+gpsfsm\S*\s+import\b|import\s+gpsfsm).*", re.MULTILINE)


def imports_in(text: str) -> Iterator[str]:
    """What a text imports of gpsfsm, as statements that parse; it may itself be a fragment."""
    for each in _IMPORT.finditer(text):
        line = each[0].strip()
        if line.endswith("("):
            line = text[each.start() : text.index(")", each.end()) + 1].strip()
        yield line.split(";")[0]


def not_public(statement: str) -> list[str]:
    """What of an import is not public."""
    (node,) = ast.parse(statement).body
    if isinstance(node, ast.Import):
        return [each.name for each in node.names if each.name.startswith("gpsfsm.")]
    assert isinstance(node, ast.ImportFrom)
    faces = {"gpsfsm": {*gpsfsm.__all__, "strategies"}, "gpsfsm.strategies": set(dir(strategies))}
    response = faces.get(node.module or "", set())
    return [f"{node.module}.{each.name}" for each in node.names if each.name not in response]


def test_private_imports_are_noticed() -> None:
    assert not_public("from gpsfsm.syntax import parse") == ["gpsfsm.syntax.parse"]
    assert not_public("from gpsfsm import parse, nothing") == ["gpsfsm.nothing"]
    assert not_public("import gpsfsm.syntax") == ["gpsfsm.syntax"]
    assert list(imports_in("x\nfrom gpsfsm import (\n    parse,\n)\n")) == [
        "from gpsfsm import (\n    parse,\n)"
    ]


@pytest.mark.parametrize("page", PAGES, ids=lambda file: file.stem)
def test_pages_import_public_names_only(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    snippets = [*_BLOCK.findall(text), *(code for _, code in _COMMAND.findall(text))]
    if page.name == "architecture.md":  # is about the inside
        return
    assert [
        wrong for each in snippets for one in imports_in(each) for wrong in not_public(one)
    ] == []


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_examples_import_public_names_only(file: Path) -> None:
    imports = imports_in(file.read_text(encoding="utf-8"))
    assert [wrong for one in imports for wrong in not_public(one)] == []


def generator() -> Any:
    spec = importlib.util.spec_from_file_location("api_generate", REPO / "docs" / "generate.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["api_generate"] = module
    spec.loader.exec_module(module)
    return module


def test_the_page_is_current() -> None:
    page = generator().api_markdown()
    assert page == (REPO / "docs" / "api.md").read_text(encoding="utf-8")
    titles = re.findall(r"^### (\w+)$", page, re.MULTILINE)
    assert sorted(titles) == sorted(set(gpsfsm.__all__) - {"__version__"})
    assert "0x" not in page


@pytest.mark.parametrize("name", sorted(set(gpsfsm.__all__) - {"__version__"}))
def test_every_name_is_documented(name: str) -> None:
    assert (getattr(gpsfsm, name).__doc__ or "").strip()
