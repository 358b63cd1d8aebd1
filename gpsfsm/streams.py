"""Standard output, standard error and output files: the one place that writes to them.

A terminal obeys control characters, and servers of continuous integration obey lines of a log such
as ``::error::`` and ``##[error]``; plan texts, file names and models' answers may hold both. So all
that is written passes ``guarded``, which leaves nothing of it but text. What is data for another
program, byte for byte, is ``Form.EXACT``: docs/formats.md tells what holds for it.
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import stat
import sys
import time
from contextlib import contextmanager, suppress
from enum import Enum
from functools import cache, partial
from io import FileIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from gpsfsm.errors import GpsfsmError, UsageError, system_reason
from gpsfsm.late import pattern
from gpsfsm.model.printable import printable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from typing import TextIO


class Form(Enum):
    """The kind of a text, which determines how it is escaped.

    ``TEXT`` is for people; so is ``COLORED``, which contains gpsfsm's own colours. ``JSON`` keeps
    its value. ``COMMANDS`` contains gpsfsm's own commands to a CI server. ``DIFF`` keeps the line
    ends that ``patch`` compares. ``EXACT`` is data that must not change by a byte.
    """

    TEXT = "text"
    COLORED = "colored"
    JSON = "json"
    COMMANDS = "commands"
    DIFF = "diff"
    EXACT = "exact"


class Stream(Enum):
    """A standard stream."""

    OUT = "stdout"
    ERR = "stderr"


STDOUT = "-"
"""Standard output, as the name of a file."""

READER_S = 1.0
"""A pipe is not written to if nobody has opened it to read after so many seconds."""

_LOOK_S = 0.05

_JSON = ("json", "jsonl", "connections")

_LOST: set[Stream] = set()
"""The streams that have not taken what somebody was to read."""


def lose(stream: Stream) -> None:
    """Note that a stream has not taken something, for a command that goes on nevertheless."""
    _LOST.add(stream)


def losses() -> frozenset[Stream]:
    """The streams that have not taken something since this was last called."""
    lost = frozenset(_LOST)
    _LOST.clear()
    return lost


_PLAIN = "\n\t -~\xa1-\xac\xae-\xff\u2010-\u2027\u2190-\u21ff\u2500-\u257f"
_COLOR = r"\x1b\[[0-9;]*m"
_DRAWS = r"\x1b\[[0-9;?]*[A-Za-z]"
_ENDS = "\r\x0b\x0c\x1c\x1d\x1e\x85\u2028\u2029"
"""What some programs end lines with; ``patch`` does not, so it has to see them."""
_MARK = r"(?:(?<=\n[ +-])|(?<=^[ +-]))\ufeff"
_WIDE = r"[^!-~\n\r]*+"
"""Blanks, over which servers pass, and what has no width, over which some comparisons do."""
_START = pattern(rf"((?:^|[\n\r])(?:{_DRAWS}|[^!-~\n\r])*+):(?={_WIDE}:)")
_ANYWHERE = pattern(rf"#(?={_WIDE}#{_WIDE}(?:v{_WIDE}s{_WIDE}o|teamcity)?+{_WIDE}\[)", re.I)
_SERVERS = ("GITHUB_ACTIONS", "GITEA_ACTIONS", "FORGEJO_ACTIONS", "TF_BUILD", "TEAMCITY_VERSION")
"""Variables in the environment of servers that take lines of a log for commands."""


def _pattern(*kept: str, plain: str = _PLAIN) -> re.Pattern[str]:
    """A pattern for what is not plain, or kept in spite of that: that stands in a group."""
    return pattern(rf"({'|'.join(kept)})|[^{plain}]" if kept else rf"[^{plain}]")


_ODD = {
    Form.TEXT: _pattern(),
    Form.COMMANDS: _pattern(),
    Form.JSON: _pattern(),
    Form.COLORED: _pattern(_COLOR),
    Form.DIFF: _pattern(_MARK, plain=_PLAIN + _ENDS),
}
_ODD_DRAWN = _pattern(_DRAWS, r"\r")


def guarded(text: str, form: Form = Form.TEXT) -> str:
    r"""``text`` without anything that a terminal or the log of a server would obey.

    >>> guarded("  ::error::\x1b[2J")
    '  \\x3a:error::\\x1b[2J'
    >>> guarded('{"a": "##[error]\u202e"}', Form.JSON)
    '{"a": "\\u0023#[error]\\u202e"}'
    """
    if form is Form.EXACT:
        return text
    if form is Form.JSON:
        return _ANYWHERE.sub(r"\\u0023", _ODD[form].sub(_as_json, text))
    text = _ANYWHERE.sub(r"\\x23", _ODD[form].sub(_escaped, text))
    return text if form is Form.COMMANDS else _START.sub(r"\1\\x3a", text)


def _escaped(odd: re.Match[str]) -> str:
    return odd[0] if odd.re.groups and odd[1] is not None else _character(odd[0])


@cache
def _character(character: str) -> str:
    return printable(character)


def _as_json(odd: re.Match[str]) -> str:
    """JSON text has such characters only in strings; between them there are blanks."""
    if _character(odd[0]) == odd[0]:
        return odd[0]
    units = odd[0].encode("utf-16-be", "surrogatepass")
    return "".join(rf"\u{units[at]:02x}{units[at + 1]:02x}" for at in range(0, len(units), 2))


def to_stdout(text: str | bytes, form: Form = Form.TEXT) -> None:
    """Write a result to standard output, in UTF-8 with plain line feeds but for a terminal.

    ``EXACT`` text is shown on a terminal as text. Raises GpsfsmError if it cannot be written.
    """
    if not is_open(Stream.OUT):
        raise GpsfsmError("cannot write to standard output: it is closed")
    try:
        emit(text, form)
    except BrokenPipeError:  # "| head": it has read enough, and what we found stays found
        give_up_stdout()
    except OSError as error:
        give_up_stdout()
        reason = error.strerror or error
        raise GpsfsmError(f"cannot write to standard output: {reason}") from error


def emit(text: str | bytes, form: Form = Form.TEXT, *, flush: bool = True) -> None:
    """Write to standard output, which is open; raises OSError, and GpsfsmError as ``to_stdout``."""
    stream, encoding = sys.stdout, "utf-8"
    if is_terminal(Stream.OUT):
        encoding = stream.encoding
        if form in (Form.EXACT, Form.DIFF):
            shown = text if isinstance(text, str) else text.decode("utf-8", "backslashreplace")
            text, form = _shown(shown), Form.TEXT
    elif form is Form.EXACT:
        _refuse_commands(text)
    if isinstance(text, str):
        text = guarded(text, form).encode(encoding, "backslashreplace")
    stream.flush()
    stream.buffer.write(text)
    if flush:
        stream.buffer.flush()


_SINKS: list[Callable[[str], object]] = []


@contextmanager
def captured_stderr(sink: Callable[[str], object]) -> Iterator[None]:
    """Hand what would go to standard error to ``sink``: a log that has a format of its own."""
    _SINKS.append(sink)
    try:
        yield
    finally:
        _SINKS.remove(sink)


def to_stderr(text: str, form: Form = Form.TEXT) -> None:
    """Write to standard error, or to the log that has taken its place."""
    if _SINKS:
        _SINKS[-1](text)
    else:
        write_stderr(text, form)


def write_stderr(text: str, form: Form = Form.TEXT) -> None:
    """Write to standard error. Where nobody reads it, that is fine; a full device is a loss."""
    if not is_open(Stream.ERR):
        return
    try:
        sys.stderr.write(guarded(text, form))
        sys.stderr.flush()
    except (BrokenPipeError, ValueError):
        _give_up(sys.stderr)
    except OSError:
        lose(Stream.ERR)
        _give_up(sys.stderr)


def urgent(text: str, number: int = 2) -> None:
    """Write past all buffers: whoever writes now may be in the middle of it. May move and colour.

    ``number`` is a file descriptor, by default that of standard error.
    """
    with suppress(OSError):
        os.write(number, _ODD_DRAWN.sub(_escaped, text).encode("utf-8", "backslashreplace"))


def give_up_stdout() -> None:
    """Send what is still in the buffers nowhere, so that Python does not fail on it at its end."""
    _give_up(sys.stdout)


def is_open(stream: Stream) -> bool:
    """True if the caller has left a stream open."""
    return getattr(sys, stream.value) is not None


def is_terminal(stream: Stream) -> bool:
    """True if a stream goes to a terminal."""
    try:
        return is_open(stream) and bool(getattr(sys, stream.value).isatty())
    except ValueError:  # closed
        return False


def drawing(stream: Stream) -> TextIO:
    """A stream for those who draw on a terminal: movements and colours pass, nothing else does."""
    return cast("TextIO", _Drawing(getattr(sys, stream.value)))


class _Drawing:
    """A stream that escapes what is not to be obeyed."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write text with sequences that move and colour."""
        return self._stream.write(_ODD_DRAWN.sub(_escaped, text))

    def writelines(self, lines: list[str]) -> None:
        """Write one text after the other."""
        for line in lines:
            self.write(line)


def _shown(text: str) -> str:
    """Data as somebody sees it; line by line, so that no end of a line stands for another one."""
    return "".join(f"{line}\n" for line in text.replace("\t", "    ").splitlines())


def _refuse_commands(text: str | bytes) -> None:
    """Raise GpsfsmError for data that the log of a server would obey, if it may be going there.

    A file is no log. A pipe may lead to a program or to the log, which does not show.
    """
    if not any(map(os.environ.get, _SERVERS)) or _is_file():
        return
    content = text if isinstance(text, str) else text.decode("utf-8", "replace")
    places = [place for each in (_START, _ANYWHERE) if (place := each.search(content))]
    if places:
        line = content.count("\n", 0, min(place.end() for place in places)) + 1
        raise GpsfsmError(
            f"line {line} of this text would be a command to a CI server in whose log it may "
            "appear; write the text to a file, with --output or >"
        )


def _is_file() -> bool:
    try:
        return stat.S_ISREG(os.fstat(sys.stdout.fileno()).st_mode)
    except (OSError, ValueError, AttributeError):
        return False


def _give_up(stream: TextIO) -> None:
    with suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def complain(message: str, *, hint: str = "") -> None:
    """Tell what went wrong, in the form of all messages: ``gpsfsm: …``.

    A path in it may hold line breaks. So the lines of a message but the first are indented: none
    looks like a line of ours.
    """
    first, *others = message.splitlines() or ["it failed, without a reason"]
    lines = [first, *(line if line.startswith(" ") else f"  {line}" for line in others)]
    lines += hint.splitlines()
    text = "\n".join(line.replace("\t", "    ") for line in lines)
    to_stderr(f"gpsfsm: {text}\n")


def form_of(output_format: str) -> Form:
    """The form of what a command writes under ``--format``."""
    return Form.JSON if output_format in _JSON else Form.TEXT


def wants_color(choice: str, output_file: str = STDOUT) -> bool:
    """True if output is coloured: ``always``, ``never``, or ``auto`` for what the environment says.

    ``auto``: never in a file; NO_COLOR forbids, FORCE_COLOR demands, else only on a terminal.
    """
    if choice != "auto":
        return choice == "always"
    if output_file != STDOUT or os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR"):
        return True
    return is_terminal(Stream.OUT) and os.environ.get("TERM") != "dumb"


def write_text(
    text: str, output_file: str = STDOUT, *, form: Form = Form.TEXT, private: bool = False
) -> None:
    """Write a result to standard output, or to a file, whole or not at all.

    ``private``: nobody else may read a new file. UTF-8 with plain line feeds everywhere, and
    escaped by its form, so that the bytes are the same wherever it goes. Raises GpsfsmError if it
    cannot be written.
    """
    if output_file == STDOUT:
        to_stdout(text, form)
        return
    data = guarded(text, form).encode("utf-8", "backslashreplace")
    write_bytes(data, output_file, private=private)


write_private = partial(write_text, private=True)
"""``write_text`` for prompts, outputs of runners and receipts: a new file has the mode 0600."""


def write_bytes(
    data: bytes,
    output_file: str,
    *,
    parents: bool = False,
    within: str | None = None,
    private: bool = False,
) -> None:
    """Write a file, whole or not at all; it keeps its rights, and a link stays a link.

    ``parents``: make the folders that it needs. ``within``: the folder that somebody has named, out
    of which no link in it may lead. ``private``: as for a text. Raises GpsfsmError if it cannot be
    written.
    """
    with _explained(output_file):
        target = _target(output_file, within)
        if parents:
            target.parent.mkdir(parents=True, exist_ok=True)
        mode = _mode(Path(output_file))
        if mode is None or stat.S_ISREG(mode):
            _write_file(target, data, mode, private=private)
            return
        # A pipe or /dev/null cannot be replaced, and /dev/fd/3 leads to no name of a file.
        with open(output_file, "wb", opener=_without_waiting) as file:
            file.write(data)


def _target(output_file: str, within: str | None) -> Path:
    """The file that is written, which a link may lead to. Raises OSError, ValueError."""
    target = Path(os.path.realpath(output_file))
    if within is not None and not target.is_relative_to(os.path.realpath(within)):
        raise OSError(0, f"a link leads out of the folder {within}, to {target}")
    return target


def check_writable(
    output_file: str,
    inputs: Iterable[str],
    others: Iterable[str] = (),
    *,
    within: str | None = None,
) -> None:
    """Raise GpsfsmError for an output file that cannot be written, or that is one of ``inputs``.

    ``others`` are the other files that are written, or standard output. To be called before the
    work is done, so that a wrong path costs no time. ``within``: as for ``write_bytes``.
    """
    if output_file == STDOUT:
        return
    target = os.path.realpath(output_file)
    if any(os.path.realpath(path) == target for path in inputs):
        raise UsageError(f"writing {output_file} would overwrite a plan")
    with _explained(output_file):
        _target(output_file, within)
        if Path(target).is_dir():
            raise IsADirectoryError(0, "it is a folder")
        if not Path(target).parent.is_dir():
            raise FileNotFoundError(0, "its folder does not exist")
        is_device = Path(target).exists() and not Path(target).is_file()
    if not is_device and target in {os.path.realpath(each) for each in others if each != STDOUT}:
        raise UsageError(f"{output_file} would be written twice; each report needs its own file")


def terminal_width(output_file: str = STDOUT) -> int | None:
    """The columns of the terminal, None where the output does not go to one."""
    if output_file != STDOUT or not is_terminal(Stream.OUT):
        return None
    return shutil.get_terminal_size().columns


@contextmanager
def _explained(output_file: str) -> Iterator[None]:
    try:
        yield
    except (OSError, ValueError) as error:
        raise GpsfsmError(f"cannot write {output_file}: {system_reason(error)}") from error


def _write_file(target: Path, data: bytes, mode: int | None, *, private: bool) -> None:
    """Through a file beside it that takes its name at the end: nobody ever reads half a report."""
    temporary = target.with_name(f".gpsfsm-{os.urandom(8).hex()}.tmp")
    try:
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        rights = 0o600 if private else 0o666  # of which the umask takes some away
        with os.fdopen(os.open(temporary, flags, rights), "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        if mode is not None:
            temporary.chmod(stat.S_IMODE(mode))
        temporary.replace(target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _without_waiting(path: str, flags: int, *, mode: int = 0o666) -> int:
    """Open a file to write; a pipe must have a reader, or get one in a moment."""
    until_s = time.monotonic() + READER_S
    while True:
        try:
            number = os.open(path, flags | getattr(os, "O_NONBLOCK", 0), mode)
        except OSError as error:
            if error.errno != errno.ENXIO:
                raise
            if time.monotonic() >= until_s:
                raise OSError(0, f"nobody has read this pipe within {READER_S:g} s") from None
            time.sleep(_LOOK_S)
        else:
            os.set_blocking(number, True)
            return number


def _mode(target: Path) -> int | None:
    try:
        return target.stat().st_mode
    except FileNotFoundError:
        return None


def append_text(text: str, file: str) -> None:
    """As the steps of a pipeline do: what is there already stays, and nothing is half there.

    Nobody else may read a new file.
    """
    try:
        with FileIO(file, "a", opener=partial(_without_waiting, mode=0o600)) as target:
            before = os.fstat(target.fileno())
            rest = guarded(text).encode("utf-8", "backslashreplace")
            try:
                while rest:
                    rest = rest[target.write(rest) :]
            except OSError:
                if stat.S_ISREG(before.st_mode):
                    target.truncate(before.st_size)
                raise
    except (OSError, ValueError) as error:
        raise GpsfsmError(f"cannot write {file}: {system_reason(error)}") from error
