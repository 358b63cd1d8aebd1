"""The report: one HTML file that needs nothing else, and allows nothing else to be loaded."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

from gpsfsm.model.printable import clip
from gpsfsm.version import VERSION
from gpsfsm.viewing.joining import joined
from gpsfsm.viewing.packing import packed

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

__all__ = ["data_block", "is_report", "page"]

_ENTRY = "report.js"
_STYLES = ("page.css", "page-findings.css")
_VENDORED = ("vendor/cytoscape.min.js", "vendor/dagre.min.js")
_CYTOSCAPE = ".__________cytoscape_container { position: relative; }"
"""What cytoscape would add to the page by itself, which the policy forbids."""
_GENERATOR = '<meta name="generator" content="gpsfsm'
_HEAD = 4_000  # bytes of a report in which it says what it is
_MOST_TOLD = 100
_MOST_PLANS = 50
_UNSAFE = re.compile("[<>&\u2028\u2029\ud800-\udfff]")


def page(document: Mapping[str, Any]) -> str:
    """The report of a view document; the same bytes for the same document."""
    parts = _parts()
    title = html.escape(clip(str(document["title"]), 200))
    scripts = "\n".join(f"<script>{script}</script>" for script in parts.scripts)
    styles = f'<style id="__________cytoscape_stylesheet">{_CYTOSCAPE}</style>\n'
    styles += f"<style>{parts.style}</style>"
    return f"""\
<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{parts.policy}">
{_GENERATOR} {VERSION}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="referrer" content="no-referrer">
<title>{title} · gpsfsm</title>
<link rel="icon" href="data:,">
{styles}
</head>
<body class="report">
<noscript>
{_without_script(document)}</noscript>
<div id="app"></div>
<script type="application/json" id="gpsfsm-view">{data_block(document)}</script>
{scripts}
</body>
</html>
"""


def data_block(document: Mapping[str, Any]) -> str:
    """The document as JSON that no HTML parser can take for anything else."""
    text = json.dumps(packed(document), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return _UNSAFE.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def is_report(head: bytes) -> bool:
    """Whether a file that begins like this is one of ours."""
    return head.startswith(b"<!doctype html>") and _GENERATOR.encode() in head[:_HEAD]


@dataclass(frozen=True, slots=True)
class _Parts:
    """What all reports have in common."""

    scripts: tuple[str, ...]
    style: str
    policy: str


@cache
def _parts() -> _Parts:
    scripts = (*map(_file, _VENDORED), joined(_ENTRY, _file))
    style = "\n".join(map(_file, _STYLES))
    policy = "; ".join(
        [
            "default-src 'none'",
            f"script-src {' '.join(map(_hash, scripts))}",
            f"style-src {_hash(_CYTOSCAPE)} {_hash(style)}",
            "img-src data:",
            "base-uri 'none'",
            "form-action 'none'",
        ]
    )
    return _Parts(scripts, style, policy)


def _file(name: str) -> str:
    root = resources.files("gpsfsm.viewing") / "web"
    return root.joinpath(*name.split("/")).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


def _without_script(document: Mapping[str, Any]) -> str:
    """What those see whose browser runs no script: the findings, as text."""
    plans = document["plans"]
    lines = ["<p>This page needs JavaScript to show plans. Without it, this is what was found:</p>"]
    for plan in plans[:_MOST_PLANS]:
        name, verdict = html.escape(clip(plan["name"], 200)), html.escape(plan["verdict"])
        lines += [f"<h2>{name}: {verdict}</h2>", "<ul>", *_items(plan["findings"]), "</ul>"]
    if len(plans) > _MOST_PLANS:
        lines.append(f"<p>… and {len(plans) - _MOST_PLANS} more plans</p>")
    return "".join(f"{line}\n" for line in lines)


def _items(findings: list[dict[str, Any]]) -> Iterator[str]:
    shown = [finding for finding in findings if not finding["suppressed"]]
    for finding in shown[:_MOST_TOLD]:
        told = f"line {finding['line']}: {finding['severity']} {finding['rule']} "
        yield f"<li>{html.escape(told + clip(finding['message'], 1_000))}</li>"
    if len(shown) > _MOST_TOLD:
        yield f"<li>… and {len(shown) - _MOST_TOLD} more</li>"
