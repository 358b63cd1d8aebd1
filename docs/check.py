"""Run the commands that the documentation shows, and compare what they print.

Checked are the blocks of README.md and of the pages below docs/ that are fenced with three
backticks and the word ``console``. In such a block a line that begins with ``$ `` is a command, a
line that begins with ``> `` right after it continues it, and all lines up to the next command are
what the command prints (standard output and standard error together). A line that is nothing but
``…`` stands for any number of lines.

Commands run in the root of the repository, one after the other, with the programs of this Python
installation first on the PATH; ``$?`` is the exit code of the command before.

``--write`` puts what commands print now into the pages, where it is not what they show. A line
``…`` stays where lines beside it are still printed, perhaps a little changed; else the whole output
takes its place, and the page and line are listed: somebody has to look at them.

Exit code: 0 everything is as shown, or was written; 1 something is not, or has to be looked at; 2
there is nothing to check.
"""

from __future__ import annotations

import argparse
import difflib
import os
import re
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
_TIMED_OUT = 124
_ALIKE = 0.6
"""Two lines that are this much alike are the same one, a little changed."""
_NOT_INHERITED = re.compile(
    r"COLUMNS|FORCE_COLOR|GPSFSM_DEBUG|EMAIL|GIT_(?:AUTHOR|COMMITTER|CONFIG)_\w+"
)
_BARE = {
    "HOME": os.devnull,
    "XDG_CONFIG_HOME": os.devnull,
    "GIT_CONFIG_GLOBAL": os.devnull,
    "GIT_CONFIG_NOSYSTEM": "1",
    "GIT_CONFIG_COUNT": "1",
    "GIT_CONFIG_KEY_0": "user.useConfigOnly",  # else git guesses an author where it can
    "GIT_CONFIG_VALUE_0": "true",
}
"""Nothing depends on what the developer has configured: a page says all that its commands need."""


class DocsError(Exception):
    """A block that cannot be read as commands and output."""


@dataclass(slots=True)
class Step:
    """A command and the lines that it should print.

    ``replaced``: the number of lines in the page whose place these take; -1: it is as it was.
    """

    line: int
    command: str
    expected: list[str] = field(default_factory=list)
    replaced: int = -1


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


# ---- new output in the place of the old ----------------------------------------------------------
# The lines between two ``…`` are a chunk. Of each chunk the first and the last line that are still
# printed are looked for, exactly or nearly, in order; what is printed from the one to the other is
# the new chunk.
#
#     documented   printed     written
#     a.xml: old   a.xml: new  a.xml: new
#     …            x, y        …
#     1 plan       1 plan      1 plan


def aligned(expected: Sequence[str], actual: Sequence[str]) -> list[str] | None:
    """What is printed now, with the ``…`` of what was expected; None if they have no place."""
    chunks: list[list[str]] = [[]]
    for line in expected:
        if line.strip() == ANYTHING:
            chunks.append([])
        else:
            chunks[-1].append(line)
    written: list[str] = []
    place, last = 0, len(chunks) - 1
    for number, chunk in enumerate(chunks):
        span = _span(chunk, actual, place) if chunk and last else (place, place)
        if span is None:
            return None
        start = 0 if number == 0 else span[0]
        place = len(actual) if number == last and (chunk or not last) else span[1]
        written += [ANYTHING] if number else []
        written += actual[start:place]
    return written if matches(written, actual) else None


def _span(chunk: Sequence[str], actual: Sequence[str], place: int) -> tuple[int, int] | None:
    """The part of ``actual``, from ``place``, in which the lines of ``chunk`` are."""
    located: list[tuple[int, int]] = []
    for number, line in enumerate(chunk):
        at = _locate(line, actual, located[-1][1] + 1 if located else place)
        if at is not None:
            located.append((number, at))
    if not located:
        return None
    (number, first), (last_number, last) = located[0], located[-1]
    while number > 0 and first > place and actual[first - 1] == chunk[number - 1]:
        number, first = number - 1, first - 1
    while last_number + 1 < len(chunk) and [chunk[last_number + 1]] == actual[last + 1 : last + 2]:
        last_number, last = last_number + 1, last + 1
    return first, last + 1


def _locate(line: str, actual: Sequence[str], place: int) -> int | None:
    """The place of a line with words in it, or of the one that is most like it."""
    if not any(character.isalnum() for character in line):
        return None
    rest = list(actual[place:])
    if line in rest:
        return place + rest.index(line)
    alike = difflib.get_close_matches(line, rest, n=1, cutoff=_ALIKE)
    return place + rest.index(alike[0]) if alike else None


def rewrite(step: Step, actual: list[str]) -> str:
    """Let a step expect what its command prints; returns what somebody has to look at."""
    marks = any(line.lstrip().startswith("```") or line.startswith("$ ") for line in actual)
    if marks or (actual and actual[0].startswith("> ")):
        return "what it prints cannot stand in a block"
    written = aligned(step.expected, actual)
    step.replaced = len(step.expected)
    step.expected = actual if written is None else written
    return f"its '{ANYTHING}' had no place any more" if written is None else ""


def write_page(file: Path, blocks: Sequence[Block]) -> None:
    """Write the steps that were rewritten into their page."""
    lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
    steps = [step for block in blocks for step in block.steps if step.replaced >= 0]
    for step in sorted(steps, key=lambda step: -step.line):
        first = step.line + step.command.count("\n")  # lines count from 1: that is behind it
        lines[first : first + step.replaced] = [f"{line}\n" for line in step.expected]
    if steps:
        file.write_text("".join(lines), encoding="utf-8")


# ---- running -------------------------------------------------------------------------------------


def run_block(
    block: Block, root: Path, programs: Path | None, *, write: bool = False
) -> Iterator[str]:
    """Run the commands of a block; yields a report for each that does not print what it should.

    With ``write`` its steps are rewritten, and the reports are of what has to be looked at.
    """
    status = 0
    for step in block.steps:
        status, printed = _run(step.command, status, root, programs)
        actual = printed.splitlines()
        if matches(step.expected, actual):
            continue
        head = f"{block.file}:{step.line}: $ {step.command}  (exit code {status})"
        if write and status != _TIMED_OUT:
            remark = rewrite(step, actual)
            if remark:
                yield f"{head}\n{remark}"
            continue
        difference = difflib.unified_diff(
            step.expected, actual, "documented", "printed", lineterm=""
        )
        yield "\n".join((head, *difference))


def _run(command: str, status: int, root: Path, programs: Path | None) -> tuple[int, str]:
    """The exit code and the output of a command, trailing blanks left out."""
    try:
        finished = subprocess.run(  # noqa: S603  (the commands of our own documentation)
            ["/bin/bash", "-c", f"(exit {status})\n{command}"],
            cwd=root,
            env=environment(programs),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return _TIMED_OUT, f"(no end after {TIMEOUT_S} seconds)"
    text = finished.stdout.decode("utf-8", errors="replace")
    return finished.returncode, "\n".join(line.rstrip() for line in text.splitlines())


def environment(first: Path | None) -> dict[str, str]:
    """As on a new machine: no colours, no width of a terminal, UTF-8, and nothing configured."""
    inherited = {n: value for n, value in os.environ.items() if not _NOT_INHERITED.fullmatch(n)}
    programs = Path(sys.executable).parent  # not resolved: a virtual environment links its python
    path = (first, programs, os.environ.get("PATH", os.defpath))
    return inherited | {
        "PATH": os.pathsep.join(str(part) for part in path if part),
        "LC_ALL": "C.UTF-8",
        "NO_COLOR": "1",
        "PYTHONUTF8": "1",
        "TERM": "dumb",
        **_BARE,
    }


def documents(root: Path) -> list[Path]:
    """README.md and the pages below docs/."""
    return [
        file for file in (root / "README.md", *sorted(root.glob("docs/**/*.md"))) if file.exists()
    ]


def main() -> int:
    """Check the given files, or all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("files", nargs="*", type=Path, help="default: README.md and docs/**/*.md")
    parser.add_argument("--root", type=Path, default=ROOT, help="where commands run")
    parser.add_argument("--programs", type=Path, help="a folder of programs that come first")
    parser.add_argument("--write", action="store_true", help="write what commands print now")
    options = parser.parse_args()
    failures: list[str] = []
    commands = written = 0
    for file in options.files or documents(options.root):
        try:
            blocks = list(console_blocks(file))
            for block in blocks:
                failures += run_block(block, options.root, options.programs, write=options.write)
            write_page(file, blocks)
        except (DocsError, OSError, UnicodeDecodeError) as error:
            failures.append(str(error))
            continue
        steps = [step for block in blocks for step in block.steps]
        commands += len(steps)
        written += sum(step.replaced >= 0 for step in steps)
    for failure in failures:
        print(failure, end="\n\n")
    if options.write:
        print(f"{commands} commands, {written} written, {len(failures)} to be looked at")
    else:
        print(f"{commands} commands, {len(failures)} not as documented")
    if failures:
        return 1
    return 0 if commands else 2


if __name__ == "__main__":
    sys.exit(main())
