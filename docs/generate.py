"""Write docs/rules from the catalogue of rules, and docs/api.md from signatures and docstrings.

The grammars of the built-in capabilities, in grammars/, the man pages of all commands, in man/, the
tables of options in docs/cli.md, and those of what readers do with each construct are written along
with them.

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

import click

import gpsfsm
from gpsfsm.analysis.rules import all_rules
from gpsfsm.capabilities.library import builtin_capabilities
from gpsfsm.cli import group
from gpsfsm.cli._help import DOCUMENTATION
from gpsfsm.compile.constructs import DECLARATIONS
from gpsfsm.grammars import DEPTH, alphabet, find_format, format_names
from gpsfsm.model.precision import EXACT, REFUSED, Reading
from gpsfsm.report._rule_docs import rule_markdown, rules_index_markdown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from gpsfsm.model.precision import Construct

_RULES = Path(__file__).parent / "rules"
_API = Path(__file__).parent / "api.md"
_GRAMMARS = Path(__file__).parents[1] / "grammars"
_MAN = Path(__file__).parents[1] / "man"
_CLI = Path(__file__).parent / "cli.md"
_HEAD = """# The Python interface

This page is the reference of the Python interface: every function, class and error that
`import gpsfsm` offers, generated from signatures and docstrings. These names are public, and so is
the module [`gpsfsm.strategies`](fuzzing.md), which needs hypothesis. Everything else may change.

Functions that take a plan accept its text or the path of its file: a `str` that is empty or
contains a `<` or a line break is a text, any other `str` is a path. Invalid arguments raise
`UsageError`, and a file that cannot be read raises `InputError`; both are subclasses of
`GpsfsmError`. Names of quantities end with their unit: `_s` for seconds, `_ms` for milliseconds,
`_us` for microseconds and `_j` for joules.

With `progress=True`, `check`, `grade`, `rewards`, `fuzz` and `generate` show a progress bar on a
terminal or in a [notebook](notebooks.md).
"""
_COMMANDS = (
    *("check", "compile_plan", "parse", "fix", "generate", "generate_async", "grade", "rewards"),
    *("reward", "diff", "view", "run", "run_async", "resume", "replay", "port", "gate", "fuzz"),
    "render",
)


def pages() -> dict[str, str]:
    """The text of every page by its file name."""
    files = {f"{rule.code}.md": rule_markdown(rule) for rule in all_rules()}
    return {**files, "index.md": rules_index_markdown(all_rules())}


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
    signature = inspect.signature(function)
    lines, starred = [], False
    for each in signature.parameters.values():
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
    returned = (
        "" if signature.return_annotation is signature.empty else _type(signature.return_annotation)
    )
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
    pieces = [parts[0]]
    for part in parts[1:]:
        example, _, rest = part.partition("\n\n")
        pieces.append(f"```pycon\n{example}\n```" + (f"\n\n{rest}" if rest else ""))
    return "\n\n".join(pieces)


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
        yield from (f"| `{called}` | {cells} |" for called, cells in rows)


def grammars() -> dict[str, str]:
    """The grammars of the built-in library by the names of their files."""
    words = alphabet(builtin_capabilities().library)
    formats = map(find_format, format_names())
    return {each.file: each.emit(words, DEPTH) for each in formats if each.emit is not None}


# -- the command line --------------------------------------------------------------------------


def commands(context: click.Context | None = None) -> Iterator[click.Context]:
    """The contexts of all commands, each before those that it has."""
    context = context or click.Context(group, info_name="gpsfsm", **group.context_settings)
    context.meta["--help-all"] = True
    context.max_content_width = 80
    yield context
    if isinstance(context.command, click.Group):
        for name in context.command.list_commands(context):
            command = context.command.get_command(context, name)
            assert command is not None
            yield from commands(click.Context(command, parent=context, info_name=name))


def option_sections(context: click.Context) -> list[tuple[str, list[tuple[str, str]]]]:
    """The options of a command with their help, below their headings."""
    command = context.command
    if hasattr(command, "option_records"):
        return list(command.option_records(context, every=True))
    records = [each.get_help_record(context) for each in command.get_params(context)]
    return [("Options", [each for each in records if each is not None])]


def man_pages() -> dict[str, str]:
    """The man page of every command by the name of its file."""
    pages = {each.command_path.replace(" ", "-"): _man_page(each) for each in commands()}
    return {f"{name}.1": text for name, text in pages.items()}


def _man_page(context: click.Context) -> str:
    command, path = context.command, context.command_path
    name = path.replace(" ", "-")
    summary = command.get_short_help_str(limit=100).rstrip(".")
    usage = " ".join(command.collect_usage_pieces(context))
    lines = [
        f'.TH {_roff(name.upper())} 1 "" gpsfsm "gpsfsm manual"',
        *(".SH NAME", f"{_roff(name)} \\- {_roff(summary)}"),
        *(".SH SYNOPSIS", f".B {_roff(path)}", _roff(usage)),
        ".SH DESCRIPTION",
    ]
    for paragraph in inspect.cleandoc(f"{command.help}\n\n{command.epilog or ''}").split("\n\n"):
        exact = paragraph.startswith("\b")
        text = paragraph.removeprefix("\b").strip("\n")
        lines += [".PP", *([".nf"] if exact else []), *map(_roff, text.split("\n"))]
        lines += [".fi"] if exact else []
    for title, records in option_sections(context):
        lines.append(f".SH {_roff(title.upper())}")
        for names, text in records:
            lines += [".TP", f".B {_roff(names)}", _roff(" ".join(text.split()))]
    if isinstance(command, click.Group):
        lines += [".SH COMMANDS"]
        for each in command.list_commands(context):
            lines += [".TP", f".BR {_roff(f'{name}-{each}')} (1)"]
            described = command.get_command(context, each)
            lines += [_roff(described.get_short_help_str(limit=100)) if described else ""]
    lines += [".SH SEE ALSO"]
    parent = context.parent
    if parent is not None:
        lines += [f".BR {_roff(parent.command_path.replace(' ', '-'))} (1)", ".PP"]
    return "\n".join([*lines, _roff(DOCUMENTATION)]) + "\n"


def _roff(text: str) -> str:
    """A line of text for roff: no requests, no ligatures of hyphens, ASCII only."""
    escaped = (
        text.replace("\\", "\\e").replace("-", "\\-").replace("…", "...").replace("'", "\\(aq")
    )
    return f"\\&{escaped}" if escaped.startswith(".") else escaped


def cli_markdown(page: str) -> str:
    """The page about the command line with a table of options in each ``<!-- options: … -->``."""
    paths = {each.command_path.removeprefix("gpsfsm "): each for each in commands()}

    def table(match: re.Match[str]) -> str:
        context = paths[match[1]]
        lines = [f"<!-- options: {match[1]} -->"]
        for title, records in option_sections(context):
            lines += [f"| {title} | |", "|---|---|"]
            lines += [f"| `{_cell(names)}` | {_cell(text)} |" for names, text in records]
            lines.append("")
        return "\n".join([*lines, "<!-- /options -->"])

    return re.sub(r"(?s)<!-- options: ([a-z0-9 -]+) -->\n.*?<!-- /options -->", table, page)


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")


# -- what readers do with each construct -------------------------------------------------------


_KINDS = {
    "tree": "[behaviour trees](behaviour-trees.md#what-a-tree-means)",
    "scxml": "[SCXML](machines.md#scxml)",
    "flexbe": "[FlexBE](machines.md#flexbe)",
    "smach": "[SMACH](machines.md#smach)",
    "yasmin": "[YASMIN](machines.md#yasmin)",
    "langgraph": "[LangGraph](machines.md#langgraph)",
    "machine": "[JSON, GraphML, networkx](machines.md#attributes)",
}
_COLUMNS = {
    "exact": [EXACT],
    "over-approximated": [Reading.OVER],
    "skipped or assumed": [Reading.SKIPPED, Reading.DEFAULTED],
    "refused": [REFUSED],
}


def constructs_markdown(page: str) -> str:
    """A page with the tables of constructs between ``<!-- constructs: … -->`` and its end."""

    def table(match: re.Match[str]) -> str:
        lines = _every_kind() if match[1] == "all" else _of_kind(match[1])
        return "\n".join([f"<!-- constructs: {match[1]} -->", *lines, "<!-- /constructs -->"])

    return re.sub(r"(?s)<!-- constructs: (\w+) -->\n.*?<!-- /constructs -->", table, page)


def _every_kind() -> Iterator[str]:
    yield f"| input | {' | '.join(_COLUMNS)} |"
    yield "|---" * (1 + len(_COLUMNS)) + "|"
    for kind, title in _KINDS.items():
        cells = (
            "<br>".join(_words(each) for each in DECLARATIONS[kind] if each.reading in readings)
            for readings in _COLUMNS.values()
        )
        yield f"| {title} | {' | '.join(cells)} |"


def _of_kind(kind: str) -> Iterator[str]:
    yield "| construct | reading | becomes |"
    yield "|---|---|---|"
    for each in DECLARATIONS[kind]:
        causes = f"*{'; '.join(each.causes)}*" if each.causes else ""
        reading = "assumed" if each.reading is Reading.DEFAULTED else each.reading
        yield f"| {_words(each)} | {reading} | {': '.join(filter(None, (each.how, causes)))} |"


def _words(construct: Construct) -> str:
    names = ", ".join(f"`{name}`" for name in construct.names)
    return " ".join(filter(None, (names, construct.about)))


def tables() -> dict[Path, Callable[[str], str]]:
    """The pages with generated tables, and what writes these into the text of a page."""
    names = ("reliability.md", "behaviour-trees.md", "machines.md")
    return {_CLI: cli_markdown, **{_CLI.with_name(name): constructs_markdown for name in names}}


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
        for name in {*man_pages(), *(file.name for file in _MAN.glob("*.1"))}:
            (_MAN / name).unlink(missing_ok=True)
        _MAN.mkdir(exist_ok=True)
        for name, text in man_pages().items():
            (_MAN / name).write_text(text, encoding="ascii", newline="\n")
        for file, written in tables().items():
            file.write_text(written(file.read_text(encoding="utf-8")), encoding="utf-8")
        return 0
    outdated = differing(_RULES)
    for name in outdated:
        print(f"docs/rules/{name} differs from the catalogue: run python docs/generate.py")
    there = _API.read_text(encoding="utf-8") if _API.exists() else ""
    if there != api_markdown():
        outdated.append(_API.name)
        print("docs/api.md differs from the docstrings: run python docs/generate.py")
    for name, text in grammars().items():
        file = _GRAMMARS / name
        if not file.is_file() or file.read_bytes() != text.encode("ascii"):
            outdated.append(name)
            print(f"grammars/{name} differs from the capabilities: run python docs/generate.py")
    manual = {file.name: file.read_text(encoding="utf-8") for file in _MAN.glob("*.1")}
    if manual != man_pages():
        outdated.append("man")
        print("man/ differs from the help of commands: run python docs/generate.py")
    for file, written in tables().items():
        if written(page := file.read_text(encoding="utf-8")) != page:
            outdated.append(file.name)
            print(f"a table in docs/{file.name} is outdated: run python docs/generate.py")
    return int(bool(outdated))


if __name__ == "__main__":
    sys.exit(main())
