"""ES modules → one script: what a page that is opened from disk can run.

No bundler is needed, because modules keep to a small form: they import names from their
neighbours, ``import { a, b } from "./x.js";``, and put ``export`` before what others may use. All
names at the top are different, so the modules can stand behind each other in one function, each
behind those that it imports. What does not keep to that form is refused. Indentation and comments
that have lines to themselves stay behind: they are a quarter of the modules. No text may go over
several lines, so that neither is ever a part of one.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.errors import InternalError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_IMPORT = re.compile(r'^import\s*\{([^{}]*)\}\s*from\s*"\./([\w-]+\.js)";[ \t]*(?:\n|\Z)', re.M)
_EXPORT = re.compile(r"^export (?=(?:async function|function|const|let|class)\b)", re.M)
_DECLARED = re.compile(
    r"^(export )?(?:async function|function|const|let|var|class)\b[ \t*]*([\w$]+|[\[{])", re.M
)
# Patterns that begin with plain letters are found several times as fast.
_LEFT = re.compile(r"\n[ \t]*(?:import|export)\b(?!\s*:)")
_LEFT_INSIDE = re.compile(r"import(?<!\wimport)(?:\s*\(|\.meta\b)")
_BLOCK = re.compile(r"^[ \t]*/\*.*?\*/[ \t]*\n", re.M | re.S)
_NAME = re.compile(r"[A-Za-z_$][\w$]*\Z")


class JoinError(InternalError):
    """A module has a form that the joiner does not know."""


@dataclass(frozen=True, slots=True)
class Module:
    """A module without its imports and exports.

    ``imports``: the names per file that it takes; ``declares``: its names at the top, of which
    others may use those in ``exports``.
    """

    name: str
    text: str
    imports: tuple[tuple[str, tuple[str, ...]], ...]
    declares: tuple[str, ...]
    exports: frozenset[str]


def read_module(name: str, source: str) -> Module:
    r"""Take a module apart. Raises JoinError.

    >>> found = read_module("a.js", 'import { b } from "./b.js";\nexport const a = b;\n')
    >>> found.imports, found.declares, found.text
    ((('b.js', ('b',)),), ('a',), 'const a = b;\n')
    """
    imports = []
    for listed, file in _IMPORT.findall(source):
        names = tuple(part.strip() for part in listed.split(",") if part.strip())
        for each in names:
            if not _NAME.match(each):
                raise JoinError(f"{name}: cannot import '{each}': names are not changed on import")
        imports.append((file, names))
    body = _IMPORT.sub("", source)
    declared = _DECLARED.findall(body)
    for _, each in declared:
        if each in ("[", "{"):
            raise JoinError(f"{name}: give each name at the top a declaration of its own")
    text = _EXPORT.sub("", body)
    _refuse(name, text)
    lines = (line.strip(" \t") for line in _BLOCK.sub("", text).split("\n"))
    text = "".join(f"{line}\n" for line in lines if line and not line.startswith("//"))
    return Module(
        name,
        text,
        tuple(imports),
        tuple(each for _, each in declared),
        frozenset(each for exported, each in declared if exported),
    )


def _refuse(name: str, text: str) -> None:
    left = _LEFT.search(f"\n{text}") or _LEFT_INSIDE.search(text)
    if left is not None:
        line = left.string[left.start() :].strip().splitlines()[0][:80]
        raise JoinError(f"{name}: this import or export has another form than is known: {line}")
    if any(line.count("`") % 2 for line in text.split("\n")):
        raise JoinError(f"{name}: holds a text of several lines, which cannot be shortened")
    if "<!--" in text or "</script" in text.lower():
        raise JoinError(f"{name}: holds text that would end the script in a page")


def joined(entry: str, read: Callable[[str], str]) -> str:
    """One script of a module and all that it imports; ``read`` gives the text of a file.

    The same files give the same bytes. Raises JoinError.
    """
    modules = list(_in_order(entry, read))
    homes: dict[str, str] = {}
    for module in modules:
        for each in module.declares:
            if each in homes:
                raise JoinError(f"{module.name}: '{each}' is declared in {homes[each]}, too")
            homes[each] = module.name
    exports = {module.name: module.exports for module in modules}
    for module in modules:
        for file, names in module.imports:
            for each in names:
                if each not in exports[file]:
                    raise JoinError(f"{module.name}: {file} does not export '{each}'")
    parts = "\n".join(f"// {module.name}\n{module.text.strip()}\n" for module in modules)
    return f'(function () {{\n"use strict";\n{parts}}})();\n'


def _in_order(entry: str, read: Callable[[str], str]) -> Iterator[Module]:
    """Each module behind those that it imports."""
    done: set[str] = set()
    open_: list[str] = [entry]
    loaded: dict[str, Module] = {}
    while open_:
        name = open_[-1]
        if name in done:
            open_.pop()
            continue
        if name not in loaded:
            loaded[name] = read_module(name, read(name))
        waiting = [file for file, _ in loaded[name].imports if file not in done]
        for file in waiting:
            if file in open_:
                around = " → ".join([*open_[open_.index(file) :], file])
                raise JoinError(f"modules import each other in a circle: {around}")
        if waiting:
            open_.append(waiting[0])
            continue
        done.add(name)
        open_.pop()
        yield loaded[name]
