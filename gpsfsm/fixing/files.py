"""Files of plans and of answers, fixed in place or elsewhere, and the fixes as lines of text.

Answers are a record of what a model wrote, so their file is changed in place only on request;
otherwise, the fixed lines go to standard output.
"""

from __future__ import annotations

import codecs
import difflib
import os
import re
import stat
from dataclasses import dataclass, replace
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.errors import GpsfsmError, InputError, UsageError
from gpsfsm.model.printable import clip, printable
from gpsfsm.streams import (
    STDOUT,
    Form,
    Stream,
    check_writable,
    complain,
    is_terminal,
    to_stdout,
    write_bytes,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.checking import CheckOptions
    from gpsfsm.checking.inputs import Input
    from gpsfsm.fixing import Fixed, Sameness
    from gpsfsm.model.report import PlanReport

_MAX_LISTED = 50
_SPECIAL = "is not a regular file: it cannot be changed"
_MAX_ALSO = 5
_SAME = {
    "same": "behaviour unchanged in every scenario",
    "renamed": "behaviour unchanged except for names and parameters",
    "different": "behaviour changed; 'gpsfsm diff' shows where the old and the new plan differ",
}
_LINE = re.compile(r"[^\n]*\n|[^\n]+")


@dataclass(frozen=True, slots=True)
class Wish:
    """The use of a fixed text; ``output_file`` None: write it in place, answers if ``in_place``."""

    unsafe: bool = False
    diff: bool = False
    output_file: str | None = None
    in_place: bool = False


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result for one input; ``fixed`` is None where it could not be read.

    ``changed``: the text is another one; ``unwritten``: it could not be written.
    ``same``: how the plan compares with what it was, None where that is not clear. ``line``: the
    line of an answer after it.
    """

    report: PlanReport
    fixed: Fixed | None = None
    changed: bool = False
    unwritten: bool = False
    same: Sameness | None = None
    line: bytes = b""


def check_target(inputs: Sequence[Input], wish: Wish) -> None:
    """Raise UsageError where the fixed texts could not all be written, or GpsfsmError."""
    if wish.diff and wish.output_file is not None:
        raise UsageError("--output cannot be combined with --diff, which writes no plan")
    if wish.diff:
        return
    check_writable(wish.output_file or STDOUT, [])
    if wish.output_file is not None and len({source.file for source in inputs}) > 1:
        raise UsageError(
            "--output accepts only one plan; without it, each is fixed in its own file"
        )
    alone = len({(source.file, source.stdin) for source in inputs}) == 1
    if any(source.stdin for source in inputs) and not alone:
        raise UsageError("standard input is fixed to standard output, so it must be the only input")
    answers = next((source.answers for source in inputs if source.answers), "")
    if answers and not wish.in_place and not alone:
        raise UsageError(
            f"{answers} holds answers, which are fixed to standard output, so it must be the only "
            "input; 'gpsfsm check --fix' fixes them in place"
        )


def takes_stdout(inputs: Sequence[Input], wish: Wish) -> bool:
    """True if fixed texts or differences go to standard output, so that nothing else may."""
    if wish.diff or wish.output_file == STDOUT:
        return True
    return any(source.stdin or (source.answers and not wish.in_place) for source in inputs)


def fix_inputs(
    inputs: Sequence[Input], options: CheckOptions, wish: Wish
) -> Iterator[tuple[Outcome, str]]:
    """Fix all inputs in order: the outcome of each, and its ``outcome_lines``.

    A file of answers is written behind its last one; if that fails, that one is unwritten. Raises
    UsageError where plans and answers cannot be read in the same way.
    """
    from gpsfsm.checking.check import options_for

    options = options_for(inputs, options)
    for answers, group in groupby(inputs, key=attrgetter("answers")):
        sources, lines = list(group), []
        for source in sources:
            outcome = fix_input(source, options, wish)
            lines.append(outcome.line)
            if answers and len(lines) == len(sources) and not wish.diff:
                outcome = _with_written(outcome, sources, b"".join(lines), wish)
            yield outcome, outcome_lines(outcome, wish)


def fix_input(source: Input, options: CheckOptions, wish: Wish) -> Outcome:
    """Read, fix and write one plan, or show the difference; an answer is not written."""
    from gpsfsm.checking import unreadable
    from gpsfsm.checking.inputs import read_bytes
    from gpsfsm.fixing import fix_text, sameness

    in_place = not wish.diff and wish.output_file is None
    if in_place and not source.stdin and not source.answers and _special(source.path):
        return Outcome(unreadable(source.path, _SPECIAL))
    try:
        data = read_bytes(source, options.limits.max_bytes)
    except InputError as error:
        return Outcome(unreadable(source.path, str(error)), line=source.line)
    fixed = fix_text(data, options, unsafe=wish.unsafe, path=source.path)
    changed = bool(fixed.applied)
    same = sameness(fixed.original, fixed.text, options) if changed else None
    outcome = Outcome(fixed.report, fixed, changed, same=same, line=source.line)
    if wish.diff:
        if changed:
            mark = "\ufeff" if data.startswith(codecs.BOM_UTF8) else ""
            show_difference(mark + fixed.original, mark + fixed.text, source.path)
        return outcome
    try:
        if source.answers:
            return replace(outcome, line=_line(source, data, fixed))
        _write(source, data, fixed, wish)
    except GpsfsmError as error:
        complain(f"{source.path}: {error}")
        return replace(outcome, unwritten=True, same=None)
    return outcome


def outcome_lines(outcome: Outcome, wish: Wish) -> str:
    """The fixes of a plan, one line each; "" if there are none, and nothing can be."""
    fixed = outcome.fixed
    if fixed is None:
        return ""
    path = printable(outcome.report.path)
    lines = [
        f"{path}:{fix.line}: {fix.rule} {printable(fix.title)}"
        + (f", which also removes {', '.join(fix.also[:_MAX_ALSO])}" if fix.also else "")
        + ("…" if len(fix.also) > _MAX_ALSO else "")
        + (" (unsafe)" if fix.safety == "unsafe" else "")
        for fix in sorted(fixed.applied, key=lambda fix: (fix.line, fix.rule))
    ]
    if len(lines) > _MAX_LISTED:
        lines[_MAX_LISTED:] = [f"{path}: and {len(lines) - _MAX_LISTED:,} more fixes"]
    if outcome.same is not None:
        lines.append(f"{path}: {_SAME[outcome.same.value]}")
    if fixed.unsafe_left and not wish.unsafe:
        count = fixed.unsafe_left
        more = f"{count} more fix is possible" if count == 1 else f"{count} more fixes are possible"
        lines.append(f"{path}: {more} with --unsafe-fixes")
    lines += [
        f"{path}: the fix '{name}' failed ({clip(why, 200)}); this is a defect of gpsfsm"
        for name, why in sorted(fixed.failed.items())
    ]
    return "".join(line + "\n" for line in lines)


def total_line(outcomes: Sequence[Outcome], wish: Wish) -> str:
    """The number of fixes, and of findings before and after: fixes can bring others to light."""
    done = [outcome.fixed for outcome in outcomes if outcome.fixed]
    fixes = sum(len(fixed.applied) for fixed in done)
    unread = sum(len(outcome.report.findings) for outcome in outcomes if not outcome.fixed)
    left = unread + sum(fixed.after for fixed in done)
    if not fixes:
        remain = "1 finding remains" if left == 1 else f"{left:,} findings remain"
        return f"nothing to fix; {remain}\n" if left else "nothing to fix\n"
    changed = sum(outcome.changed for outcome in outcomes)
    before = unread + sum(fixed.before for fixed in done)
    many = "1 fix" if fixes == 1 else f"{fixes:,} fixes"
    where = "1 plan" if changed == 1 else f"{changed:,} plans"
    would = " would be made" if wish.diff else ""
    unwritten = sum(outcome.unwritten for outcome in outcomes)
    plans = "1 plan" if unwritten == 1 else f"{unwritten:,} plans"
    lost = f"; not written: {plans}" if unwritten else ""
    return f"{many} in {where}{would}; findings: {before:,} before, {left:,} after{lost}\n"


def _write(source: Input, data: bytes, fixed: Fixed, wish: Wish) -> None:
    target = wish.output_file or (STDOUT if source.stdin else source.path)
    if not fixed.applied and target == source.path:
        return
    result = _bytes(data, fixed)
    _refuse_read_only(target, source.path)
    write_plan(result, fixed.text, target, within=source.root if target == source.path else "")


def _bytes(data: bytes, fixed: Fixed) -> bytes:
    """The fixed text in the encoding of the original. Raises InputError."""
    from gpsfsm.syntax.source import encoded

    return encoded(fixed.text, data, fixed.original) if fixed.applied else data


def _line(source: Input, data: bytes, fixed: Fixed) -> bytes:
    """The line of an answer with the fixed text as its answer. Raises InputError."""
    from gpsfsm.checking.inputs import with_answer

    if not fixed.applied:
        return source.line
    return with_answer(source, _bytes(data, fixed).decode("utf-8", "surrogatepass"))


def _with_written(
    outcome: Outcome, sources: Sequence[Input], content: bytes, wish: Wish
) -> Outcome:
    """The last outcome of a file of answers, after its lines are written, if there are any."""
    source = sources[0]
    own = STDOUT if source.stdin else source.file
    target = wish.output_file or (own if wish.in_place else STDOUT)
    before = b"".join(each.line for each in sources)
    if not before or (content == before and target == source.file):
        return outcome
    try:
        if target == own != STDOUT and _special(target):
            raise GpsfsmError(_SPECIAL)
        _refuse_read_only(target, own)
        write_plan(content, content.decode("utf-8", "backslashreplace"), target)
    except GpsfsmError as error:
        complain(f"{source.file}: {error}")
        return replace(outcome, unwritten=True)
    return outcome


def _refuse_read_only(target: str, own: str) -> None:
    if target == own != STDOUT and _read_only(target):
        raise GpsfsmError("cannot write: the file is read-only; use -o to write another file")


def write_plan(data: bytes, text: str, target: str, *, within: str = "") -> None:
    """Write the bytes of a plan to a file or to standard output; a terminal is shown its text.

    ``within``: the folder that was named instead of the file.
    """
    if target != STDOUT:
        write_bytes(data, target, within=within or None)
    else:
        to_stdout(text if is_terminal(Stream.OUT) else data, Form.EXACT)


def _special(path: str) -> bool:
    """True if something is there that is no file, folder or link to one: a pipe, a device."""
    try:
        mode = Path(path).stat().st_mode
        return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))  # reading tells that of a folder
    except (OSError, ValueError):
        return False  # reading it tells why


def _read_only(path: str) -> bool:
    """True if a file may not be changed, although another one could take its place."""
    return not (os.access(path, os.W_OK) and Path(path).stat().st_mode & 0o222)


def show_difference(original: str, text: str, path: str) -> None:
    """A unified diff to standard output, as ``patch`` and ``git apply`` read it.

    Lines end with a line feed only; a byte order mark with which the file begins belongs to it.
    """
    old, new = _LINE.findall(original), _LINE.findall(text)
    name = printable(path)
    lines: list[str] = []
    for line in difflib.unified_diff(old, new, fromfile=name, tofile=name):
        lines.append(line)
        if not line.endswith("\n"):
            lines.append("\n\\ No newline at end of file\n")
    to_stdout("".join(lines), Form.DIFF)
