"""From paths to plans: files, folders, standard input, and answers of models as JSON lines."""

from __future__ import annotations

import codecs
import os
import stat
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Final

from gpsfsm.errors import GpsfsmError, InputError, UsageError, misused
from gpsfsm.files import read, read_from
from gpsfsm.late import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.syntax import Limits, Parsed

STDIN = "<stdin>"
"""How standard input is called in reports."""

_SUFFIX = ".xml"
_NOT_REGULAR = "is not a regular file"

LINES: Final = (".jsonl", ".ndjson")
"""How the names of files end that hold one answer of a model per line, as JSON."""

FIELDS: Final = ("response", "response_text", "answer", "completion", "output", "plan")
"""The fields of a line that hold an answer, if nobody says which one."""

MOST_LINES: Final = 100_000
MOST_LINES_BYTES: Final = 1 << 28


@dataclass(frozen=True, slots=True)
class Input:
    """One plan to check: a path, or why there is none; ``stdin`` is standard input.

    ``answers`` is the file of an answer that is a line of it, ``text`` the answer, ``line`` the
    bytes of the line with its end, and ``field`` where the answer is in it, if that was specified.
    The lines of a file are all of its bytes, also where one holds no answer. ``root`` is the folder
    that was named, if it was one; included files are in it, else in the folder of the file.
    """

    path: str
    problem: str = ""
    stdin: bool = False
    answers: str = ""
    text: bytes = b""
    line: bytes = b""
    field: str | None = None
    root: str = ""

    @property
    def file(self) -> str:
        """The path of the file that was read."""
        return self.answers or self.path


def find_inputs(
    paths: Sequence[str], field: str | None = None, *, within_s: float | None = None
) -> Iterator[Input]:
    """Every plan that the paths name, each once: files as they are, folders recursively.

    A folder stands for its ``*.xml`` files in the order of their paths; ``-`` is standard input.
    Links to folders are not followed, so that no plan comes twice and no walk goes in circles.
    A file of JSON lines stands for its answers, one for each line; so does standard input if
    ``field`` says which field they are in (``a.b``: ``b`` in ``a``). ``within_s``: as for
    ``files.read``. Raises UsageError if there is a field, and there are no JSON lines.
    """
    seen: set[tuple[str, bool]] = set()
    if field is not None and not any(holds_lines(path, field) for path in paths):
        endings = " or ".join(LINES)
        raise UsageError(f"--field needs JSON lines: a file that ends in {endings}, or -")
    for path in paths:
        lines = holds_lines(path, field)
        for item in _answers(path, field, within_s) if lines else _expand(path):
            key = (os.path.normpath(item.path), item.stdin)
            if key not in seen:
                seen.add(key)
                yield item


def read_bytes(item: Input, max_bytes: int, *, within_s: float | None = None) -> bytes:
    """The text of one input, at most one byte more than is allowed; raises InputError.

    The byte more tells the front end that the text is too long; the rest of a huge file is never
    read. ``within_s``: as for ``files.read``.
    """
    if item.problem:
        raise InputError(item.problem)
    if item.answers:
        return item.text[: max_bytes + 1]
    if item.stdin:
        return _read_stdin(max_bytes, within_s)
    if _is_folder(item.path):
        raise InputError("is a folder")
    return read(item.path, max_bytes, within_s=within_s)


def read_named(path: str, max_bytes: int) -> tuple[str, bytes]:
    """The name of a file, or of standard input for ``-``, and its content. Raises GpsfsmError."""
    stdin = path == "-"
    name = STDIN if stdin else path
    try:
        return name, read_bytes(Input(name, stdin=stdin), max_bytes)
    except GpsfsmError as error:
        raise GpsfsmError(f"{name}: {error}") from error


def parse_named(path: str, limits: Limits, *, from_response: bool = False) -> Parsed:
    """The plan, tree or machine in a file, or in standard input for ``-``. Raises GpsfsmError."""
    from gpsfsm.checking.includes import includes_of
    from gpsfsm.compile.plan_text import read_plan_or_machine  # (loads the front end)

    name, text = read_named(path, limits.max_bytes)
    return read_plan_or_machine(
        text,
        file=name,
        limits=limits,
        from_response=from_response,
        includes=includes_of(Input(name, stdin=path == "-"), text, limits),
    )


def read_joined(path: str, limits: Limits) -> tuple[str, bytes]:
    """As ``read_named``, for those who keep one text: with the trees that a tree includes in it.

    Raises GpsfsmError also where an included file cannot be read.
    """
    from gpsfsm.checking.includes import joined_text

    name, text = read_named(path, limits.max_bytes)
    try:
        return name, joined_text(Input(name, stdin=path == "-"), text, limits)
    except InputError as error:
        raise GpsfsmError(f"{name}: {error}") from error


def is_text(value: str, *, from_response: bool = False) -> bool:
    """True if a ``str`` is the text of a plan, not a path.

    What holds a ``<`` or a line break, or nothing, is a text, and so is a machine in JSON. A
    model's answer may be any text: it is a path only if such a file exists.
    """
    if not value or "<" in value or "\n" in value:
        return True
    if value.startswith("{") and '"nodes"' in value:
        return True
    return from_response and value != "-" and not os.path.exists(value)  # noqa: PTH110  (too long)


def text_of(
    value: object, function: str, max_bytes: int, *, from_response: bool = False
) -> tuple[str, str | bytes]:
    """The name and the content of a text that is given itself, or by the path of its file.

    Raises UsageError for what is neither, InputError for a file that cannot be read.
    """
    if isinstance(value, bytes):
        return "<text>", value
    if isinstance(value, str) and is_text(value, from_response=from_response):
        return "<text>", value
    if not isinstance(value, str | Path):
        raise misused(function, "the text of a plan or the path of a file", value)
    try:
        return str(value), read_bytes(Input(str(value)), max_bytes)
    except InputError as error:
        raise InputError(f"{value}: {error}") from error


def holds_lines(path: str, field: str | None) -> bool:
    """True if a path names JSON lines, by its ending; standard input holds them with a field."""
    if path == "-":
        return field is not None
    return path.lower().endswith(LINES) and not _is_folder(path)


def _answers(path: str, field: str | None, within_s: float | None) -> Iterator[Input]:
    """The answers in a file of JSON lines, ``file:line`` by name; a line that holds none says why.

    The last line may end without a line break. Nothing is skipped, empty lines neither: each is an
    input that cannot be read.
    """
    stdin = path == "-"
    name = STDIN if stdin else path
    try:
        content = _whole(path, within_s)
    except InputError as error:
        yield Input(name, str(error), stdin, name)
        return
    lines = content.split(b"\n")
    lines[:-1] = (each + b"\n" for each in lines[:-1])
    if not lines[-1] or lines == [codecs.BOM_UTF8]:
        lines.pop()
    if not lines:
        yield Input(name, "holds no answer: it is empty", stdin, name)
    for number, line in enumerate(lines[:MOST_LINES], start=1):
        where = f"{name}:{number}"
        try:
            text = _answer(_bare(line, first=number == 1), field)
            yield Input(where, "", stdin, name, text, line, field)
        except (ValueError, RecursionError) as error:
            problem = str(error) if isinstance(error, _NoAnswerError) else _no_json(error)
            yield Input(where, problem, stdin, name, line=line)
    if len(lines) > MOST_LINES:
        problem = f"holds {len(lines):,} lines; only the first {MOST_LINES:,} are read"
        yield Input(name, problem, stdin, name, line=b"".join(lines[MOST_LINES:]))


def _bare(line: bytes, *, first: bool) -> bytes:
    """A line without its end, and without the mark with which a file may begin."""
    return line.removeprefix(codecs.BOM_UTF8 if first else b"").removesuffix(b"\n")


def _whole(path: str, within_s: float | None) -> bytes:
    whole = Input(path, stdin=path == "-")
    content = read_bytes(whole, MOST_LINES_BYTES, within_s=within_s)
    if len(content) > MOST_LINES_BYTES:
        raise InputError(f"is larger than {MOST_LINES_BYTES:,} bytes")
    return content


class _NoAnswerError(ValueError):
    """A line without an answer, and why."""


def _no_json(error: Exception) -> str:
    if isinstance(error, UnicodeDecodeError):
        return f"is not UTF-8 at byte {error.start + 1} of the line"
    return "is not JSON" if isinstance(error, RecursionError) else f"is not JSON: {error}"


def _answer(line: bytes, field: str | None) -> bytes:
    """The text of the answer in a line. Raises ValueError, or RecursionError.

    >>> _answer(b'{"choice": {"text": "<Plan/>"}}', "choice.text")
    b'<Plan/>'
    """
    from gpsfsm.strict_json import strict_loads

    text = line.decode("utf-8")
    if not text.strip():
        raise _NoAnswerError("is an empty line")
    record = strict_loads(text)
    if not isinstance(record, dict):
        raise _NoAnswerError("is not a JSON object")
    value: object = record
    for name in _steps(record, field):
        if not isinstance(value, dict) or name not in value:
            raise _NoAnswerError(f"has no field '{field}'")
        value = value[name]
    if not isinstance(value, str):
        raise _NoAnswerError(f"has no text in its field '{field}'")
    return value.encode("utf-8", "surrogatepass")


def with_answer(item: Input, text: str) -> bytes:
    """The line of an answer with another text as its answer; no other byte of it changes.

    What is ASCII stays ASCII. Raises InputError for a line that is nested too deep to be edited.

    >>> line = b'{"id": 1e0, "plan" : "<Plan>"}'
    >>> with_answer(Input("a.jsonl:1", line=line), "<Plan/>")
    b'{"id": 1e0, "plan" : "<Plan/>"}'
    """
    import json

    from gpsfsm.strict_json import strict_loads

    line = item.line.decode("utf-8")
    try:
        record = strict_loads(line.removeprefix("\ufeff"))
        start, end = _span(line, _steps(record, item.field))
    except RecursionError:
        raise InputError("cannot be changed: the line is nested too deep") from None
    value = json.dumps(text, ensure_ascii=line[start:end].isascii())
    # Half a character becomes an escape, which JSON has as well.
    return f"{line[:start]}{value}{line[end:]}".encode("utf-8", "backslashreplace")


def _span(line: str, steps: Sequence[str]) -> tuple[int, int]:
    """The place of a value in an object of JSON, which leads to it by these keys.

    Key by key and value by value, since a parser tells no places:

        {"a": [1, {"c": 2}], "b": {"c": "text"}}    for the steps b and c
              ^^^^^^^^^^^^^ skipped                 no step is a
                                        ^^^^^^ place
    """
    from json import JSONDecoder

    decoder, at = JSONDecoder(), line.index("{")
    for depth, step in enumerate(steps, start=1):
        key = None
        while key != step:
            key, at = decoder.raw_decode(line, line.index('"', at))
            at = line.index(":", at) + 1
            while line[at].isspace():
                at += 1
            start = at
            if key != step or depth == len(steps):
                at = decoder.raw_decode(line, at)[1]
    return start, at


def _steps(record: dict[str, object], field: str | None) -> tuple[str, ...]:
    """The keys that lead to the answer: a field of this very name, else one step at each dot."""
    if field is not None:
        return (field,) if field in record else tuple(field.split("."))
    names = [name for name in FIELDS if isinstance(record.get(name), str)]
    if len(names) == 1:
        return (names[0],)
    if names:
        fields = " and ".join(names)
        raise _NoAnswerError(f"has a text in {fields}; name the right one with --field")
    fields = ", ".join(FIELDS)
    raise _NoAnswerError(
        f"has no text in any of {fields}; name the field of the answer with --field"
    )


def _expand(path: str) -> Iterator[Input]:
    if path == "-":
        yield Input(STDIN, stdin=True)
        return
    if not _is_folder(path):
        yield Input(path)
        return
    items = sorted(_walk(path), key=lambda each: each.path)
    yield from items
    if not items:
        yield Input(path, f"is a folder without any *{_SUFFIX} file")


def _is_folder(path: str) -> bool:
    try:
        return path != "" and stat.S_ISDIR(Path(path).stat().st_mode)
    except (OSError, ValueError):
        return False  # reading it tells why


def _walk(top: str) -> Iterator[Input]:
    """The plans of a folder, and what keeps it from being read; in no order.

    A loop and not os.walk, whose recursion a deep tree of folders exhausts.
    """
    folders = [str(Path(top))]
    while folders:
        folder = folders.pop()
        try:
            with os.scandir(folder) as entries:
                for entry in entries:
                    if entry.is_dir(follow_symlinks=False):
                        folders.append(entry.path)
                    elif entry.name.endswith(_SUFFIX):
                        yield from _entry(entry, top)
        except OSError as error:
            yield Input(folder, f"cannot be read: {error.strerror or error}")


def _entry(entry: os.DirEntry[str], top: str) -> Iterator[Input]:
    """A file of a folder. Nobody named it, so a pipe must not make the check wait for ever."""
    # Path drops the leading "./" that scandir keeps.
    path = str(Path(entry.path))
    try:
        mode = entry.stat().st_mode
    except OSError as error:
        yield Input(path, f"cannot be read: {error.strerror or error}")
        return
    if stat.S_ISREG(mode):
        yield Input(path, root=top)
    elif not stat.S_ISDIR(mode):
        yield Input(path, _NOT_REGULAR)


def _read_stdin(max_bytes: int, within_s: float | None) -> bytes:
    if sys.stdin is None:  # the caller closed it; typeshed does not know
        raise InputError("cannot be read: standard input is closed")
    try:
        number = sys.stdin.fileno()
    except (OSError, ValueError, AttributeError):  # somebody has put something in its place
        return _read_substitute(max_bytes)
    return read_from(number, max_bytes, within_s=within_s)


def _read_substitute(max_bytes: int) -> bytes:
    try:
        return sys.stdin.buffer.read(max_bytes + 1)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise InputError("cannot be read: standard input is closed") from error
