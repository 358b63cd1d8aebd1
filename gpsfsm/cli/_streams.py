"""Standard output, standard error and output files."""

from __future__ import annotations

import os
import shutil
import stat
import sys
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.errors import GpsfsmError, UsageError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from typing import TextIO

__all__ = [
    "STDOUT",
    "check_writable",
    "complain",
    "give_up_stdout",
    "terminal_width",
    "wants_color",
    "write_bytes",
    "write_message",
    "write_text",
]

STDOUT = "-"
"""As a value of --output-file."""


def write_text(text: str, output_file: str = STDOUT) -> None:
    """Write a result to standard output, or to a file, whole or not at all.

    UTF-8 with plain line feeds everywhere, so that the bytes are the same on every machine.
    Raises GpsfsmError if it cannot be written.
    """
    if output_file == STDOUT:
        _write_stdout(text)
        return
    write_bytes(text.encode("utf-8", "backslashreplace"), output_file)


def write_bytes(data: bytes, output_file: str) -> None:
    """Write a file, whole or not at all; it keeps its rights, and a link stays a link.

    Raises GpsfsmError if it cannot be written.
    """
    with _explained(output_file):
        _write_file(Path(os.path.realpath(output_file)), data)


def check_writable(output_file: str, inputs: Iterable[str]) -> None:
    """Raise GpsfsmError for an output file that cannot be written, or that is one of ``inputs``.

    To be called before the work is done, so that a wrong path costs no time.
    """
    if output_file == STDOUT:
        return
    target = os.path.realpath(output_file)
    if any(os.path.realpath(path) == target for path in inputs):
        raise UsageError(f"--output-file {output_file} would overwrite a plan")
    with _explained(output_file):
        if Path(target).is_dir():
            raise IsADirectoryError(0, "it is a folder")
        if not Path(target).parent.is_dir():
            raise FileNotFoundError(0, "its folder does not exist")


def write_message(text: str) -> None:
    """Write to standard error; if that is not possible, nobody wants to read it."""
    if sys.stderr is None:  # closed by the caller; typeshed does not know
        return
    try:
        sys.stderr.write(text)
        sys.stderr.flush()
    except (OSError, ValueError):
        _give_up(sys.stderr)


def complain(message: str, *, hint: str = "") -> None:
    """Tell what went wrong, in the form of all messages: ``gpsfsm: …``.

    Paths and plans may hold anything, so control characters are written as escapes.
    """
    from gpsfsm.model.printable import printable  # noqa: PLC0415  (needed for errors only)

    lines = [*message.splitlines(), *hint.splitlines()] or ["it failed, without a reason"]
    text = "\n".join(printable(line.replace("\t", "    ")) for line in lines)
    write_message(f"gpsfsm: {text}\n")


def give_up_stdout() -> None:
    """Send what is still in the buffers nowhere, so that Python does not fail on it at its end."""
    _give_up(sys.stdout)


def _give_up(stream: TextIO) -> None:
    with suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def wants_color(choice: str, output_file: str = STDOUT) -> bool:
    """Whether to colour: ``always``, ``never``, or ``auto`` for what the environment says.

    ``auto``: never in a file; NO_COLOR forbids, FORCE_COLOR demands, else only on a terminal.
    """
    if choice != "auto":
        return choice == "always"
    if output_file != STDOUT or os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR"):
        return True
    return _is_terminal() and os.environ.get("TERM") != "dumb"


def terminal_width(output_file: str = STDOUT) -> int | None:
    """The columns of the terminal, None where the output does not go to one."""
    if output_file != STDOUT or not _is_terminal():
        return None
    return shutil.get_terminal_size().columns


def _is_terminal() -> bool:
    try:
        return sys.stdout is not None and sys.stdout.isatty()
    except ValueError:  # closed
        return False


def _write_stdout(text: str) -> None:
    if sys.stdout is None:  # closed by the caller; typeshed does not know
        raise GpsfsmError("cannot write to standard output: it is closed")
    encoding = sys.stdout.encoding if _is_terminal() else "utf-8"
    try:
        sys.stdout.flush()
        sys.stdout.buffer.write(text.encode(encoding, "backslashreplace"))
        sys.stdout.buffer.flush()
    except BrokenPipeError:  # "| head": it has read enough, and what we found stays found
        give_up_stdout()
    except OSError as error:
        give_up_stdout()
        reason = error.strerror or error
        raise GpsfsmError(f"cannot write to standard output: {reason}") from error


@contextmanager
def _explained(output_file: str) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise GpsfsmError(f"cannot write {output_file}: {error.strerror or error}") from error
    except ValueError as error:  # a NUL character in the path
        raise GpsfsmError(f"cannot write {output_file}: {error}") from error


def _write_file(target: Path, data: bytes) -> None:
    """Through a file beside it that takes its name at the end: nobody ever reads half a report."""
    mode = _mode(target)
    if mode is not None and not stat.S_ISREG(mode):  # a pipe or /dev/null cannot be replaced
        with target.open("wb") as file:
            file.write(data)
        return
    temporary = target.with_name(f".gpsfsm-{os.urandom(8).hex()}.tmp")
    try:
        with temporary.open("xb") as file:  # with the rights that the umask gives new files
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        if mode is not None:
            temporary.chmod(stat.S_IMODE(mode))
        temporary.replace(target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _mode(target: Path) -> int | None:
    try:
        return target.stat().st_mode
    except FileNotFoundError:
        return None
