"""Files of plans, repaired in place or elsewhere, and the lines that say what was repaired."""

from __future__ import annotations

import codecs
import difflib
import os
import re
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.errors import GpsfsmError, InputError, UsageError
from gpsfsm.model.printable import clip, printable
from gpsfsm.streams import STDOUT, Form, Stream, complain, is_terminal, to_stdout, write_bytes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.checking import CheckOptions
    from gpsfsm.checking.inputs import Input
    from gpsfsm.fixing import Fixed, Sameness
    from gpsfsm.model.report import PlanReport

_MAX_LISTED = 50
_MAX_ALSO = 5
_SAME = {
    "same": "the same behaviour as before, in every scenario",
    "renamed": "the same behaviour as before, but for names and parameters",
    "different": "another behaviour than before; gpsfsm diff shows where they part",
}
_LINE = re.compile(r"[^\n]*\n|[^\n]+")


@dataclass(frozen=True, slots=True)
class Wish:
    """The use of a fixed text; ``output_file`` None: write it in place."""

    unsafe: bool = False
    diff: bool = False
    output_file: str | None = None


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result for one input; ``fixed`` is None where it could not be read.

    ``changed``: the text is another one; ``unwritten``: it could not be written.
    ``same``: how the plan compares with what it was, None where that is not clear.
    """

    report: PlanReport
    fixed: Fixed | None = None
    changed: bool = False
    unwritten: bool = False
    same: Sameness | None = None


def check_target(inputs: Sequence[Input], wish: Wish) -> None:
    """Raise UsageError where the fixed texts could not all be written."""
    answers = next((source.answers for source in inputs if source.answers), "")
    if answers:
        raise UsageError(f"{answers} holds answers; only files of one plan can be repaired")
    if wish.diff and wish.output_file is not None:
        raise UsageError("--diff writes no plan, so --output-file makes no sense with it")
    if wish.output_file is not None and len(inputs) > 1:
        raise UsageError("--output-file takes one plan; without it each is fixed in its own file")
    if any(source.stdin for source in inputs) and len(inputs) > 1 and not wish.diff:
        raise UsageError("standard input is fixed to standard output, so it goes alone")


def fix_input(source: Input, options: CheckOptions, wish: Wish) -> Outcome:
    """Read, fix and write one plan, or show the difference."""
    from gpsfsm.checking import unreadable
    from gpsfsm.checking.inputs import read_bytes
    from gpsfsm.fixing import fix_text, sameness

    if not wish.diff and wish.output_file is None and not source.stdin and _special(source.path):
        return Outcome(unreadable(source.path, "is not a regular file: it cannot be changed"))
    try:
        data = read_bytes(source, options.limits.max_bytes)
    except InputError as error:
        return Outcome(unreadable(source.path, str(error)))
    fixed = fix_text(data, options, unsafe=wish.unsafe, path=source.path)
    changed = bool(fixed.applied)
    same = sameness(fixed.original, fixed.text, options) if changed else None
    if wish.diff:
        if changed:
            mark = "\ufeff" if data.startswith(codecs.BOM_UTF8) else ""
            show_difference(mark + fixed.original, mark + fixed.text, source.path)
        return Outcome(fixed.report, fixed, changed, same=same)
    try:
        _write(source, data, fixed, wish)
    except GpsfsmError as error:
        complain(f"{source.path}: {error}")
        return Outcome(fixed.report, fixed, changed, unwritten=True)
    return Outcome(fixed.report, fixed, changed, same=same)


def outcome_lines(outcome: Outcome, wish: Wish) -> str:
    """The fixes of a plan, one line each; "" if there are none, and nothing can be."""
    fixed = outcome.fixed
    if fixed is None:
        return ""
    path = printable(outcome.report.path)
    lines = [
        f"{path}:{fix.line}: {fix.rule} {printable(fix.title)}"
        + (f", and with it {', '.join(fix.also[:_MAX_ALSO])}" if fix.also else "")
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
        more = f"{count} more fix may help" if count == 1 else f"{count} more fixes may help"
        lines.append(f"{path}: {more}: --unsafe-fixes")
    lines += [
        f"{path}: the fix '{name}' failed ({clip(why, 200)}); this is a defect of gpsfsm"
        for name, why in sorted(fixed.failed.items())
    ]
    return "".join(line + "\n" for line in lines)


def total_line(outcomes: Sequence[Outcome], wish: Wish) -> str:
    """The number of fixes, and of findings before and after: fixes can bring others to light."""
    done = [outcome.fixed for outcome in outcomes if outcome.fixed]
    fixes = sum(len(fixed.applied) for fixed in done)
    left = sum(len(outcome.report.findings) for outcome in outcomes)
    if not fixes:
        remain = "1 finding remains" if left == 1 else f"{left:,} findings remain"
        return f"nothing to fix; {remain}\n" if left else "nothing to fix\n"
    changed = sum(outcome.changed for outcome in outcomes)
    unread = sum(len(outcome.report.findings) for outcome in outcomes if not outcome.fixed)
    before = unread + sum(fixed.before for fixed in done)
    many = "1 fix" if fixes == 1 else f"{fixes:,} fixes"
    where = "1 plan" if changed == 1 else f"{changed:,} plans"
    would = " would be made" if wish.diff else ""
    return f"{many} in {where}{would}; findings: {before:,} before, {left:,} after\n"


def _write(source: Input, data: bytes, fixed: Fixed, wish: Wish) -> None:
    from gpsfsm.syntax.source import encoded

    target = wish.output_file or (STDOUT if source.stdin else source.path)
    if not fixed.applied and target == source.path:
        return
    result = data
    if fixed.applied:
        result = encoded(fixed.text, data, fixed.original)
    if target == source.path and _read_only(target):
        raise GpsfsmError("cannot write: the file is read-only; -o writes another one")
    write_plan(result, fixed.text, target)


def write_plan(data: bytes, text: str, target: str) -> None:
    """Write the bytes of a plan to a file or to standard output; a terminal is shown its text."""
    if target != STDOUT:
        write_bytes(data, target)
    else:
        to_stdout(text if is_terminal(Stream.OUT) else data, Form.EXACT)


def _special(path: str) -> bool:
    """True if something is there that is neither a file nor a link to one: a pipe, a device."""
    try:
        return not stat.S_ISREG(Path(path).stat().st_mode)
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
