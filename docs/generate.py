"""Write docs/rules from the catalogue of rules, and docs/api.md from signatures and docstrings.

The grammars of the built-in capabilities, in grammars/, are written along with them.

python docs/generate.py            writes the files
python docs/generate.py --check    exits 1 if a file differs
"""

from __future__ import annotations

import argparse
import dataclasses
import enum
import inspect
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gpsfsm
from gpsfsm.analysis.rules import all_rules
from gpsfsm.capabilities.library import builtin_capabilities
from gpsfsm.grammars import DEPTH, alphabet, find_format, format_names
from gpsfsm.report._rule_docs import rule_markdown, rules_index_markdown

if TYPE_CHECKING:
    from collections.abc import Iterator

_RULES = Path(__file__).parent / "rules"
_API = Path(__file__).parent / "api.md"
_GRAMMARS = Path(__file__).parents[1] / "grammars"
_HEAD = """# The Python interface

`import gpsfsm` is all: these names are public, and the module
[`gpsfsm.strategies`](fuzzing.md), which needs hypothesis. Everything else may move. This page is
generated from the signatures and docstrings by `docs/generate.py`.

Functions that take a plan take its text, or the path of its file: a `str` that is empty or holds
a `<` or a line break is a text, any other a path. What makes no sense raises `UsageError`, a file
that cannot be read `InputError`; both are kinds of `GpsfsmError`. Names of arguments end with
their unit.
"""
_COMMANDS = (
    *("check", "compile_plan", "parse", "fix", "generate", "generate_async", "grade", "rewards"),
    *("reward", "diff", "view", "run", "run_async", "resume", "replay", "port", "gate", "fuzz"),
    "render",
)


def pages() -> dict[str, str]:
    """The text of every page by its file name."""
    found = {f"{rule.code}.md": rule_markdown(rule) for rule in all_rules()}
    return {**found, "index.md": rules_index_markdown(all_rules())}


def differing(folder: Path) -> list[str]:
    """The names of pages that are missing, that differ, or that no rule has any more."""
    wanted = pages()
    there = {file.name: file.read_text(encoding="utf-8") for file in folder.glob("*.md")}
    return sorted(name for name in {*wanted, *there} if wanted.get(name) != there.get(name))


def write(folder: Path) -> None:
    """Write all pages and delete those of rules that are gone."""
    folder.mkdir(parents=True, exist_ok=True)
    wanted = pages()
    for name in differing(folder):
        if name in wanted:
            (folder / name).write_text(wanted[name], encoding="utf-8")
        else:
            (folder / name).unlink()


# -- the Python interface ----------------------------------------------------------------------


def api_markdown() -> str:
    """The page about the public names."""
    objects = {name: getattr(gpsfsm, name) for name in gpsfsm.__all__ if name != "__version__"}
    classes = {name: each for name, each in objects.items() if inspect.isclass(each)}
    errors = [name for name, each in classes.items() if issubclass(each, BaseException)]
    others = [name for name in objects if name not in classes and name not in _COMMANDS]
    sections = {
        "Functions": _COMMANDS,
        "More functions": others,
        "Classes": [name for name in classes if name not in errors],
        "Errors": errors,
    }
    lines = [_HEAD]
    for title, names in sections.items():
        lines.append(f"## {title}\n")
        for name in names:
            shown = _class if name in classes else _function
            lines += [f"### {name}\n", *shown(name, objects[name]), ""]
    return "\n".join(lines).rstrip("\n") + "\n"


def _function(name: str, function: Any) -> Iterator[str]:
    yield f"```python\n{_signature(name, function)}\n```\n"
    yield _text(function)


def _signature(name: str, function: Any) -> str:
    """The signature, one argument per line."""
    found = inspect.signature(function)
    lines, starred = [], False
    for each in found.parameters.values():
        if each.kind is each.KEYWORD_ONLY and not starred:
            lines.append("*")
            starred = True
        text = {each.VAR_KEYWORD: "**", each.VAR_POSITIONAL: "*"}.get(each.kind, "") + each.name
        starred = starred or each.kind is each.VAR_POSITIONAL
        if each.annotation is not each.empty:
            text += f": {_type(each.annotation)}"
        if each.default is not each.empty:
            text += f" = {_plain(each.default)}"
        lines.append(text)
    inside = "".join(f"    {line},\n" for line in lines)
    returned = "" if found.return_annotation is found.empty else _type(found.return_annotation)
    arrow = f" -> {returned}" if returned else ""
    prefix = "async def" if inspect.iscoroutinefunction(function) else "def"
    return f"{prefix} {name}(\n{inside}){arrow}" if lines else f"{prefix} {name}(){arrow}"


def _type(annotation: object) -> str:
    return annotation if isinstance(annotation, str) else getattr(annotation, "__name__", "Any")


def _plain(value: object) -> str:
    """A default without addresses of objects."""
    if isinstance(value, enum.Enum):
        return str(value)
    return re.sub(r"<(?:function|class) '?([\w.]+).*?>", r"\1", repr(value))


def _text(documented: Any) -> str:
    """The docstring with its examples as code."""
    text = inspect.cleandoc(documented.__doc__ or "").replace("``", "`")
    parts = re.split(r"\n\n(?=>>> )", text)
    found = [parts[0]]
    for part in parts[1:]:
        example, _, rest = part.partition("\n\n")
        found.append(f"```pycon\n{example}\n```" + (f"\n\n{rest}" if rest else ""))
    return "\n\n".join(found)


def _class(name: str, documented: Any) -> Iterator[str]:
    yield _text(documented)
    if issubclass(documented, enum.Enum):
        yield "\nOne of " + ", ".join(f"`{each.name}`" for each in documented) + "."
        return
    rows = []
    if dataclasses.is_dataclass(documented):
        for each in dataclasses.fields(documented):
            if not each.name.startswith("_") and each.init:
                rows.append((each.name, f"`{str(each.type).replace('|', chr(92) + '|')}`"))
    for attribute, value in vars(documented).items():
        if attribute.startswith("_") or not (inspect.isfunction(value) or _is_computed(value)):
            continue
        first = inspect.cleandoc(value.__doc__ or "").split("\n")[0].replace("``", "`")
        called = f"{attribute}()" if inspect.isfunction(value) else attribute
        rows.append((called, first.replace("|", "\\|")))
    if rows:
        yield f"\n| `{name}.` | |\n|---|---|"
        yield from (f"| `{called}` | {told} |" for called, told in rows)


def grammars() -> dict[str, str]:
    """The grammars of the built-in library by the names of their files."""
    words = alphabet(builtin_capabilities().library)
    formats = map(find_format, format_names())
    return {each.file: each.emit(words, DEPTH) for each in formats if each.emit is not None}


def _is_computed(value: object) -> bool:
    return isinstance(value, property) or type(value).__name__ == "cached_property"


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="Write docs/rules, docs/api.md and grammars.")
    parser.add_argument("--check", action="store_true", help="only compare; exit 1 if they differ")
    if not parser.parse_args().check:
        write(_RULES)
        _API.write_text(api_markdown(), encoding="utf-8")
        for name, text in grammars().items():
            (_GRAMMARS / name).write_text(text, encoding="ascii", newline="\n")
        return 0
    found = differing(_RULES)
    for name in found:
        print(f"docs/rules/{name} differs from the catalogue: run python docs/generate.py")
    there = _API.read_text(encoding="utf-8") if _API.exists() else ""
    if there != api_markdown():
        found.append(_API.name)
        print("docs/api.md differs from the docstrings: run python docs/generate.py")
    for name, text in grammars().items():
        file = _GRAMMARS / name
        if not file.is_file() or file.read_bytes() != text.encode("ascii"):
            found.append(name)
            print(f"grammars/{name} differs from the capabilities: run python docs/generate.py")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
