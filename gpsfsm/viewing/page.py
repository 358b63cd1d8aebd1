"""The report: one HTML file that needs nothing else, and allows nothing else to be loaded.

The document is packed in it: long lists of like objects as columns, which is several times shorter.
``web/state.js`` makes the same document of it again. A list of at least ten objects becomes
``{"$columns": [column, …], "$rows": n}``; a column holds the values of one name, in the shortest
of these forms:

``{"name", "all"}``            the values
``{"name", "steps"}``          of whole numbers: the first one, then the differences
``{"name", "values", "of"}``   the different values, and which of them it is
``{"name", "at", "all"}``      which rows have such a value at all, and the values
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from dataclasses import dataclass
from functools import cache
from importlib import resources
from itertools import accumulate
from operator import sub
from typing import TYPE_CHECKING, Any

from gpsfsm.late import collecting_rarely
from gpsfsm.model.printable import clip
from gpsfsm.version import VERSION
from gpsfsm.viewing.js_bundle import joined

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

_ENTRY = "report.js"
_STYLES = ("page.css", "page-findings.css", "timeline.css")
_GENERATOR = '<meta name="generator" content="gpsfsm'
_HEAD = 4_000  # bytes of a report in which it says what it is
_MOST_LISTED = 100
_MOST_PLANS = 50
_QUOTED = (
    r'(?:"(?:[^"\\\n]|\\.)*"|`(?:[^`\\$\n]|\\.|\$(?!\{)|\$\{[^`{}\n]*\})*`)'  # none in another
)
_BARE = r"[^\"'`/\n]*"
_KEPT = re.compile(rf"(^(?!{_BARE}(?:{_QUOTED}{_BARE})*$).+$|{_QUOTED})", re.M)
_GAP = "\0"
_REMARK = re.compile(rf"^((?:[^\"'`/\n]|{_QUOTED})+?) +// .*$")
_SIGN = r"[=<>,;:?&|*(){}\[\]]"
_SPACES = re.compile(rf" (?:(?<={_SIGN} ) *| *(?={_SIGN}))")
_SIGNED = re.compile(r" (?<![+-] )([+-]) (?![+-])")  # a + +b stays as it is
_UNSAFE = re.compile("[<>&\u2028\u2029\ud800-\udfff]")


@collecting_rarely()
def page(document: Mapping[str, Any]) -> str:
    """The report of a view document; the same bytes for the same document."""
    parts = _parts()
    title = html.escape(clip(str(document["title"]), 200))
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
<style>{parts.style}</style>
</head>
<body class="report">
<noscript>
{_without_script(document)}</noscript>
<div id="app"></div>
<script type="application/json" id="gpsfsm-view">{data_block(document)}</script>
<script>{parts.script}</script>
</body>
</html>
"""


def data_block(document: Mapping[str, Any]) -> str:
    """The document as JSON that no HTML parser can take for anything else."""
    text = json.dumps(packed(document), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return _UNSAFE.sub(lambda unsafe: f"\\u{ord(unsafe[0]):04x}", text)


def is_report(head: bytes) -> bool:
    """True if a file that begins like this is one of ours."""
    return head.startswith(b"<!doctype html>") and _GENERATOR.encode() in head[:_HEAD]


@dataclass(frozen=True, slots=True)
class _Parts:
    """The parts that all reports have in common."""

    script: str
    style: str
    policy: str


@cache
def _parts() -> _Parts:
    script = _short_script(joined(_ENTRY, _file))
    style = _short_style("".join(map(_file, _STYLES)))
    policy = "; ".join(
        [
            "default-src 'none'",
            f"script-src {_hash(script)}",
            f"style-src {_hash(style)}",
            "img-src data:",
            "base-uri 'none'",
            "form-action 'none'",
        ]
    )
    return _Parts(script, style, policy)


def _file(name: str) -> str:
    root = resources.files("gpsfsm.viewing") / "web"
    return root.joinpath(name).read_text(encoding="utf-8")


def _short_style(text: str) -> str:
    r"""A style sheet without comments, indentation and most ends of lines.

    >>> _short_style('/* why */a {\n  color: red;\n}\n')
    'a{color:red}'
    """
    bare = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    lines = re.sub(
        r"^\s*(--)?([\w-]+): ", r"\1\2:", re.sub(r"^\s+", "", bare, flags=re.M), flags=re.M
    )
    short = re.sub(r"(?<=[{;,}])\n+", "", re.sub(r" \{$", "{", lines, flags=re.M))
    return short.replace(";}", "}")


def _short_script(text: str) -> str:
    r"""A script without remarks, and without spaces around its signs but in texts and patterns.

    What follows an open line, a statement or a block stands on the same line, as does what closes.

    >>> _short_script('if (a === b) { return [c, d + 1]; } // why\nlet e = "a = b";\n')
    'if(a===b){return[c,d+1];}let e="a = b";'
    """
    whole = [line for line in text.split("\n") if not line.startswith("// ")]
    lines = [_REMARK.sub(r"\1", line) if "//" in line else line for line in whole]
    parts = _KEPT.split("\n".join(lines))
    # All that is not kept at once: a call for each part would take several times as long.
    short = _SIGNED.sub(r"\1", _SPACES.sub("", _GAP.join(parts[::2])))
    parts[::2] = short.split(_GAP)
    lines = [line for line in "".join(parts).split("\n") if line]
    return "".join(map(_with_end, lines, [*lines[1:], ""])).removesuffix("\n")


def _with_end(line: str, following: str) -> str:
    """A line with as much of its end as it needs."""
    if "//" in line:
        return f"{line}\n"
    if following.startswith((")", "]", "}")):
        return line[:-1] if line.endswith((";", ",")) else line
    return line if line.endswith(("{", "}", "(", "[", ",", ";")) else f"{line}\n"


def _hash(text: str) -> str:
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


def _without_script(document: Mapping[str, Any]) -> str:
    """The findings as text, for browsers that run no script."""
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
    for finding in shown[:_MOST_LISTED]:
        head = f"line {finding['line']}: {finding['severity']} {finding['rule']} "
        yield f"<li>{html.escape(head + clip(finding['message'], 1_000))}</li>"
    if len(shown) > _MOST_LISTED:
        yield f"<li>… and {len(shown) - _MOST_LISTED} more</li>"


_FEWEST = 10
_MARK = "$columns"
_ABSENT = object()
_SCALAR = {str, bool, int}
_PLAIN = {*_SCALAR, float, type(None)}
_dump = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode


def packed(value: Any) -> Any:
    """The value with its long lists as columns; no object of it may have a name with ``$``."""
    if isinstance(value, dict):
        return {name: packed(each) for name, each in value.items()}
    if not isinstance(value, list):
        return value
    kinds = set(map(type, value))
    if len(value) < _FEWEST or kinds != {dict}:
        return value if kinds <= _PLAIN else [packed(each) for each in value]
    names = dict.fromkeys(name for each in value for name in each)
    columns = [_column(name, [each.get(name, _ABSENT) for each in value]) for name in names]
    return {_MARK: columns, "$rows": len(value)}


def _column(name: str, cells: list[Any]) -> dict[str, Any]:
    kinds = set(map(type, cells))
    if object in kinds:
        at = [row for row, value in enumerate(cells) if value is not _ABSENT]
        return {"name": name, "at": at, "all": [packed(cells[row]) for row in at]}
    if not kinds <= _SCALAR:
        return {"name": name, "all": [packed(value) for value in cells]}
    forms: list[dict[str, Any]] = [{"name": name, "all": cells}]
    if kinds == {int}:
        forms.append({"name": name, "steps": list(map(sub, cells, [0, *cells]))})
    if len(kinds) == 1:  # True and 1 are equal, but not the same
        values = {value: place for place, value in enumerate(dict.fromkeys(cells))}
        of = list(map(values.__getitem__, cells))
        forms.append({"name": name, "values": list(values), "of": of})
    return min(forms, key=lambda form: len(_dump(form)))


def unpacked(value: Any) -> Any:
    """The value that was packed.

    >>> rows = [{"name": "a", "line": line} for line in range(1000, 1010)]
    >>> unpacked(packed({"rows": rows})) == {"rows": rows}
    True
    """
    if isinstance(value, list):
        return [unpacked(each) for each in value]
    if not isinstance(value, dict):
        return value
    if _MARK not in value:
        return {name: unpacked(each) for name, each in value.items()}
    rows: list[dict[str, Any]] = [{} for _ in range(value["$rows"])]
    for column in value[_MARK]:
        values = _values(column)
        for row, each in zip(column.get("at", range(len(rows))), values, strict=True):
            rows[row][column["name"]] = each
    return rows


def _values(column: dict[str, Any]) -> list[Any]:
    if "of" in column:
        return [column["values"][number] for number in column["of"]]
    if "steps" in column:
        return list(accumulate(column["steps"]))
    return [unpacked(each) for each in column["all"]]
