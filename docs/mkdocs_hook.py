"""What MkDocs does not do by itself for the documentation site; mkdocs.yml names this module.

- Addresses are those of the one owner in gpsfsm/version.py.
- Pages also link to files beside docs/, which GitHub shows: on the site these links lead to the
  repository.
- ``rules/`` and ``adr/`` in the navigation stand for their pages, rules by family.
- Only what mike puts among other versions looks for their list, which no site from disk has.
- GitHub draws mermaid, for which a site would load a script from elsewhere: here these pictures are
  drawn by gpsfsm.
"""

from __future__ import annotations

import os
import posixpath
import re
import sys
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.version import OWNER, REPOSITORY

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
BRANCH = "main"
_FENCED = re.compile(r"^(`{3,})(\w*)\n(.*?)^\1$", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"(\]\()([^)\s#]+)((?:#[^)\s]*)?\))")
_FAMILY = re.compile(r"^## (GP\w+: .+?)\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
_RULE = re.compile(r"^\| \[(GP\d+)\]\((GP\d+\.md)\) \| ([\w-]+) \|", re.MULTILINE)


# -- events of MkDocs --------------------------------------------------------------------------


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Fill in what is not written in mkdocs.yml."""
    config.site_url = f"https://{OWNER.lower()}.github.io/gpsfsm/"
    config.extra["social"] = [{"icon": "fontawesome/brands/github", "link": REPOSITORY}]
    config.nav = _filled(config.nav or [])
    if "MIKE_DOCS_VERSION" not in os.environ:
        config.extra.pop("version", None)
    return config


def on_page_markdown(markdown: str, *, page: Page, files: Files, **_: object) -> str:
    """Rewrite links that leave docs/, and draw what is written as mermaid."""
    there = {file.src_uri for file in files if file.inclusion.is_included()}
    parts, end = [], 0
    for fence in _FENCED.finditer(markdown):
        parts.append(_links_rewritten(markdown[end : fence.start()], page.file.src_uri, there))
        parts.append(_drawn(fence))
        end = fence.end()
    parts.append(_links_rewritten(markdown[end:], page.file.src_uri, there))
    return "".join(parts)


# -- navigation --------------------------------------------------------------------------------


def _filled(entries: list[Any]) -> list[Any]:
    """The navigation with the pages of ``rules/`` and ``adr/`` in it."""
    folders = {"rules/": rule_pages, "adr/": decision_pages}
    filled: list[Any] = []
    for entry in entries:
        if not isinstance(entry, dict):
            filled.append(entry)
            continue
        ((title, value),) = entry.items()
        if isinstance(value, list):
            filled.append({title: _filled(value)})
        else:
            filled.append({title: folders[value]() if value in folders else value})
    return filled


def rule_pages() -> list[Any]:
    """The index of rules, and a section for each family."""
    text = (DOCS / "rules" / "index.md").read_text(encoding="utf-8")
    families: list[Any] = ["rules/index.md"]
    for family in _FAMILY.finditer(text):
        rules = [
            {f"{code} {name}": f"rules/{file}"} for code, file, name in _RULE.findall(family[2])
        ]
        families.append({family[1]: rules})
    return families


def decision_pages() -> list[Any]:
    """The records of decisions, by number."""
    return [f"adr/{file.name}" for file in sorted((DOCS / "adr").glob("*.md"))]


# -- links -------------------------------------------------------------------------------------


def _links_rewritten(text: str, page: str, there: set[str]) -> str:
    return _LINK.sub(lambda link: link[1] + _target(link[2], page, there) + link[3], text)


def _target(target: str, page: str, there: set[str]) -> str:
    """The target of a link: as it is if the site has it, else its address in the repository."""
    if re.match(r"[a-z]+:", target):
        return target
    path = posixpath.normpath(posixpath.join("docs", posixpath.dirname(page), target))
    inside = path.removeprefix("docs/")
    if path.startswith("docs/") and inside in there:
        return target
    where = ROOT / path
    if not where.exists():
        return target  # MkDocs reports it
    kind = "tree" if where.is_dir() else "blob"
    return f"{REPOSITORY}/{kind}/{BRANCH}/{path}"


# -- pictures ----------------------------------------------------------------------------------


def _drawn(fence: re.Match[str]) -> str:
    if fence[2] != "mermaid":
        return fence[0]
    return f'<div class="picture">\n{_pictures()[fence[3]]}</div>'


@cache
def _pictures() -> dict[str, str]:
    """The picture in SVG of each picture in mermaid of docs/engines.md."""
    sys.path.insert(0, os.fspath(DOCS))
    import engines

    return dict(engines.pictures())
