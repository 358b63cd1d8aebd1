"""Run the commands that the documentation shows, and compare what they print.

Checked are the blocks of README.md and docs/*.md that are fenced with three backticks and the
word ``console``. In such a block a line that begins with ``$ `` is a command, a line that begins
with ``> `` right after it continues it, and all lines up to the next command are what the command
prints (standard output and standard error together). A line that is nothing but ``…`` stands for
any number of lines.

Commands run in the root of the repository, one after the other, with the programs of this Python
installation first on the PATH; ``$?`` is the exit code of the command before.

Exit code: 0 everything is as shown, 1 something is not, 2 there is nothing to check.
"""

from __future__ import annotations

import argparse
import difflib
import os
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

ROOT = Path(__file__).resolve().parents[1]
LANGUAGE = "console"
ANYTHING = "…"
TIMEOUT_S = 120
_NOT_INHERITED = ("COLUMNS", "FORCE_COLOR", "GPSFSM_DEBUG")


class DocsError(Exception):
    """A block that cannot be read as commands and output."""


@dataclass(slots=True)
class Step:
    """A command and the lines that it should print."""

    line: int
    command: str
    expected: list[str] = field(default_factory=list)


@dataclass(slots=True)
class Block:
    """One console block; ``steps`` run in order."""

    file: Path
    line: int
    steps: list[Step] = field(default_factory=list)


def console_blocks(file: Path) -> Iterator[Block]:
    """The console blocks of a Markdown file; raises DocsError for one that makes no sense."""
    fence = ""
    block: Block | None = None
    for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), start=1):
        stripped = line.strip()
        if not fence:
            if stripped.startswith("```"):
                words = stripped.lstrip("`").split()
                fence = stripped[: len(stripped) - len(stripped.lstrip("`"))]
                block = Block(file, number) if words[:1] == [LANGUAGE] else None
        elif stripped == fence:
            if block is not None:
                yield block
            fence, block = "", None
        elif block is not None:
            _add_line(block, number, line)
    if fence:
        raise DocsError(f"{file}: the last fence is never closed")


def _add_line(block: Block, number: int, line: str) -> None:
    if line.startswith("$ "):
        block.steps.append(Step(number, line.removeprefix("$ ")))
    elif not block.steps:
        raise DocsError(f"{block.file}:{number}: output before the first command")
    elif line.startswith("> ") and not block.steps[-1].expected:
        block.steps[-1].command += "\n" + line.removeprefix("> ")
    else:
        block.steps[-1].expected.append(line)


def matches(expected: Sequence[str], actual: Sequence[str]) -> bool:
    """Whether ``actual`` is as expected; a line ``…`` matches any number of lines."""
    chunks: list[list[str]] = [[]]
    for line in expected:
        if line.strip() == ANYTHING:
            chunks.append([])
        else:
            chunks[-1].append(line)
    first, *others = chunks
    place = len(first)
    if list(actual[:place]) != first or not others:
        return list(actual) == first
    *middle, last = others
    for chunk in middle:  # the first place that fits leaves most to those behind it
        while list(actual[place : place + len(chunk)]) != chunk:
            place += 1
            if place > len(actual):
                return False
        place += len(chunk)
    end = len(actual) - len(last)
    return end >= place and list(actual[end:]) == last


def run_block(block: Block, root: Path, programs: Path | None) -> Iterator[str]:
    """Run the commands of a block; yields a report for each that does not print what it should."""
    status = 0
    for step in block.steps:
        status, printed = _run(step.command, status, root, programs)
        actual = printed.splitlines()
        if not matches(step.expected, actual):
            difference = difflib.unified_diff(
                step.expected, actual, "documented", "printed", lineterm=""
            )
            head = f"{block.file}:{step.line}: $ {step.command}  (exit code {status})"
            yield "\n".join((head, *difference))


def _run(command: str, status: int, root: Path, programs: Path | None) -> tuple[int, str]:
    """The exit code and the output of a command, trailing blanks left out."""
    try:
        finished = subprocess.run(  # noqa: S603  (the commands of our own documentation)
            ["/bin/bash", "-c", f"(exit {status})\n{command}"],
            cwd=root,
            env=_environment(programs),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return 124, f"(no end after {TIMEOUT_S} seconds)"
    text = finished.stdout.decode("utf-8", errors="replace")
    return finished.returncode, "\n".join(line.rstrip() for line in text.splitlines())


def _environment(first: Path | None) -> dict[str, str]:
    """As on any machine: no colours, no width of a terminal, UTF-8."""
    found = {name: value for name, value in os.environ.items() if name not in _NOT_INHERITED}
    programs = Path(sys.executable).parent  # not resolved: a virtual environment links its python
    path = (first, programs, os.environ.get("PATH", os.defpath))
    return found | {
        "PATH": os.pathsep.join(str(part) for part in path if part),
        "LC_ALL": "C.UTF-8",
        "XDG_CONFIG_HOME": os.devnull,  # nothing depends on what the developer has configured
        "NO_COLOR": "1",
        "PYTHONUTF8": "1",
        "TERM": "dumb",
    }


def documents(root: Path) -> list[Path]:
    """README.md and docs/*.md."""
    return [file for file in (root / "README.md", *sorted(root.glob("docs/*.md"))) if file.exists()]


def main() -> int:
    """Check the given files, or all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("files", nargs="*", type=Path, help="default: README.md and docs/*.md")
    parser.add_argument("--root", type=Path, default=ROOT, help="where commands run")
    parser.add_argument("--programs", type=Path, help="a folder of programs that come first")
    options = parser.parse_args()
    failures: list[str] = []
    commands = 0
    for file in options.files or documents(options.root):
        try:
            for block in console_blocks(file):
                commands += len(block.steps)
                failures += run_block(block, options.root, options.programs)
        except (DocsError, OSError, UnicodeDecodeError) as error:
            failures.append(str(error))
    for failure in failures:
        print(failure, end="\n\n")
    print(f"{commands} commands, {len(failures)} not as documented")
    if failures:
        return 1
    return 0 if commands else 2


if __name__ == "__main__":
    sys.exit(main())
