"""Figures of the house: how large its modules are, how they hang together, how they read.

``python docs/house.py`` measures this checkout and writes the table of docs/architecture.md;
``python docs/house.py --measure FOLDER --name NAME`` measures the Python files of another project,
its tests left out, and keeps the figures in docs/house.json, as they were for the columns of the
table that do not change: the first edition, and the projects that this one takes as its models.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import re
import statistics
import tokenize
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PRODUCT = ("gpsfsm", "analysis", "grammars", "runners")
KEPT = ROOT / "docs" / "house.json"
PAGE = ROOT / "docs" / "architecture.md"
MARKERS = re.compile("(<!-- house -->\n).*?(<!-- /house -->)", re.DOTALL)
SUPPRESSION = re.compile(r"#\s*(?:noqa|type:\s*ignore|pragma:|pylint:|pyright:)")
NOTHING = "-"
BANNED = ("found", "known", "told", "given", "asked", "thing", "way")
"""Words that are not names, since they do not say of what."""
_NO_CODE = frozenset(
    (tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)
)
ROWS = {
    "modules": "modules",
    "lines": "lines",
    "code": "lines of code: no docstrings, comments, assertions, blank lines",
    "file": "lines of a module: median / 95 % / largest",
    "small": "modules below 50 lines",
    "single": "modules below 100 lines with one importer",
    "function": "lines of a function: median / 95 % / largest",
    "imports": "imports and `__all__`, share of lines",
    "comments": "comments per 1,000 lines",
    "suppressions": "suppressions per 1,000 lines",
    "assertions": "assertions",
    "banned": "names that say nothing (" + ", ".join(BANNED) + ")",
    "tests": "lines of tests per line",
    "command_line": "command line: modules / lines",
    "without_click": "command line: modules without click",
}


def python_files(folder: Path) -> list[Path]:
    """The Python files below a folder, by path; what is reached by a symbolic link is left out."""
    return sorted(
        file
        for file in folder.rglob("*.py")
        if not any(part.is_symlink() for part in (file, *file.parents))
    )


def module_name(file: Path, root: Path) -> str:
    """The dotted name of a file, as it is imported."""
    parts = [*file.relative_to(root).parts[:-1], file.stem]
    if parts[0] in PRODUCT[1:]:
        parts.insert(0, PRODUCT[0])
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def spread(values: list[int]) -> str:
    """Median, 95th percentile and largest of some lengths: ``97 / 277 / 400``."""
    if not values:
        return NOTHING
    ordered = sorted(values)
    ninety_five = ordered[min(len(ordered) - 1, int(0.95 * len(ordered)))]
    return f"{round(statistics.median(ordered)):,} / {ninety_five:,} / {ordered[-1]:,}"


def _lines(node: ast.AST) -> range:
    return range(node.lineno, (node.end_lineno or node.lineno) + 1)  # type: ignore[attr-defined]


def _docstring(node: ast.AST) -> ast.AST | None:
    body = getattr(node, "body", None)
    if isinstance(body, list) and body and isinstance(body[0], ast.Expr):
        value = body[0].value
        if isinstance(value, ast.Constant) and isinstance(value.value, str):
            return body[0]
    return None


def _is_all(node: ast.AST) -> bool:
    return isinstance(node, ast.Assign) and any(
        isinstance(target, ast.Name) and target.id == "__all__" for target in node.targets
    )


def identifiers(tree: ast.AST) -> list[str]:
    """Every name that a module gives: to a variable, a parameter, a function, a class, a field."""
    names: list[str] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            names.append(node.name)
        elif isinstance(node, ast.arg):
            names.append(node.arg)
        elif isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            names.append(node.id if isinstance(node, ast.Name) else node.attr)
    return names


def banned_names(tree: ast.AST) -> list[str]:
    """The names that a module gives which have one of the banned words as a part."""
    return [
        name
        for name in identifiers(tree)
        if any(part.lower() in BANNED for part in re.split(r"_|(?<=[a-z])(?=[A-Z])", name))
    ]


@dataclass(slots=True)
class _Counts:
    """What is added up over the files of a project."""

    totals: Counter[str] = field(default_factory=Counter)
    functions: list[int] = field(default_factory=list)
    lengths: dict[str, int] = field(default_factory=dict)
    importers: dict[str, set[str]] = field(default_factory=dict)

    def add(self, name: str, text: str) -> None:
        """Count a module. All names of modules must be in ``importers`` before."""
        self.lengths[name] = len(text.splitlines())
        tree = ast.parse(text)
        self.totals["banned"] += len(banned_names(tree))
        left_out: set[int] = set()
        imports: set[int] = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                self.functions.append(len(_lines(node)))
            if (docstring := _docstring(node)) is not None:
                left_out.update(_lines(docstring))
            if isinstance(node, ast.Assert):
                self.totals["assertions"] += 1
                left_out.update(_lines(node))
            if isinstance(node, ast.Import | ast.ImportFrom) or _is_all(node):
                imports.update(_lines(node))
                self._import(name, node)
        self.totals["imports"] += len(imports)
        self.totals["code"] += len(self._code(text) - left_out)

    def _import(self, name: str, node: ast.AST) -> None:
        targets: list[str] = []
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                targets.append(full if full in self.importers else node.module)
        elif isinstance(node, ast.Import):
            targets = [alias.name for alias in node.names]
        for target in targets:
            if target in self.importers:
                self.importers[target].add(name)

    def _code(self, text: str) -> set[int]:
        code: set[int] = set()
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type == tokenize.COMMENT:
                self.totals["comments"] += 1
                self.totals["suppressions"] += SUPPRESSION.match(token.string) is not None
            elif token.type not in _NO_CODE:
                code.update(range(token.start[0], token.end[0] + 1))
        return code


def measured(root: Path, folders: list[Path], tests: list[Path]) -> dict[str, str]:
    """The figures of some folders with Python files below ``root``, by the keys of ``ROWS``."""
    files = [file for folder in folders for file in python_files(folder)]
    names = {module_name(file, root): file for file in files}
    counts = _Counts(importers={name: set() for name in names})
    for name, file in names.items():
        counts.add(name, file.read_text(encoding="utf-8"))
    total, totals = sum(counts.lengths.values()), counts.totals
    tested = sum(
        len(file.read_text(encoding="utf-8", errors="replace").splitlines())
        for folder in tests
        for file in python_files(folder)
    )
    single = (len(counts.importers[name]) == 1 for name in names if counts.lengths[name] < 100)
    figures = {
        "modules": f"{len(files):,}",
        "lines": f"{total:,}",
        "code": f"{totals['code']:,}",
        "file": spread(list(counts.lengths.values())),
        "small": f"{sum(length < 50 for length in counts.lengths.values()):,}",
        "single": str(sum(single)),
        "function": spread(counts.functions),
        "imports": f"{100 * totals['imports'] / total:.1f} %",
        "comments": f"{1000 * totals['comments'] / total:.1f}",
        "suppressions": f"{1000 * totals['suppressions'] / total:.1f}",
        "assertions": f"{totals['assertions']:,}",
        "banned": f"{totals['banned']:,}",
        "tests": f"{tested / total:.2f}" if tested else NOTHING,
    }
    return figures | command_line(root)


def command_line(root: Path) -> dict[str, str]:
    """The figures of the command line of a checkout of this project."""
    texts = [file.read_text(encoding="utf-8") for file in python_files(root / "gpsfsm" / "cli")]
    if not texts:
        return {}
    lines = sum(len(text.splitlines()) for text in texts)
    return {
        "command_line": f"{len(texts)} / {lines:,}",
        "without_click": str(sum("import click" not in text for text in texts)),
    }


def house(root: Path) -> dict[str, str]:
    """The figures of a checkout of this project."""
    return measured(root, [root / folder for folder in PRODUCT], [root / "tests"])


def table(columns: dict[str, dict[str, str]]) -> str:
    """The figures as a table of Markdown, one column per project."""
    head = ["|  |", *(f" {name} |" for name in columns)]
    rows = ["".join(head), "|---|" + "---|" * len(columns)]
    for key, words in ROWS.items():
        cells = [column.get(key, NOTHING) for column in columns.values()]
        rows.append(f"| {words} | " + " | ".join(cells) + " |")
    return "\n".join(rows)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--measure", type=Path, help="keep the figures of this folder")
    parser.add_argument("--name", help="the column that these figures are")
    parser.add_argument("--print", action="store_true", help="print the table, write nothing")
    chosen = parser.parse_args()
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    if chosen.measure is not None:
        place = chosen.measure.resolve()
        own = (place / "gpsfsm" / "model").is_dir()
        kept[chosen.name] = house(place) if own else measured(place.parent, [place], [])
        KEPT.write_text(json.dumps(kept, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
        return
    before = [name for name in kept if name.startswith("first edition")]
    columns = {name: kept[name] for name in before} | {"now": house(ROOT)}
    columns |= {name: kept[name] for name in kept if name not in before}
    if chosen.print:
        print(table(columns))
        return
    page = PAGE.read_text(encoding="utf-8")
    if not MARKERS.search(page):
        raise SystemExit(f"{PAGE}: there are no markers <!-- house -->")
    PAGE.write_text(
        MARKERS.sub(lambda place: f"{place[1]}{table(columns)}\n{place[2]}", page), encoding="utf-8"
    )


if __name__ == "__main__":
    main()
