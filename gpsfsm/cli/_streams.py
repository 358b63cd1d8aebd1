"""Standard output, standard error and output files, as commands use them."""

from __future__ import annotations

import os
import shutil
import stat
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.streams import Form, Stream, give_up_stdout, guarded, is_terminal, to_stderr, to_stdout

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

__all__ = [
    "STDOUT",
    "Form",
    "check_writable",
    "complain",
    "form_of",
    "give_up_stdout",
    "terminal_width",
    "wants_color",
    "write_bytes",
    "write_message",
    "write_text",
]

STDOUT = "-"
"""As a value of --output-file."""

_JSON = ("json", "jsonl", "connections")


def write_text(text: str, output_file: str = STDOUT, *, form: Form = Form.TEXT) -> None:
    """Write a result to standard output, or to a file, whole or not at all.

    UTF-8 with plain line feeds everywhere, and escaped by its form, so that the bytes are the same
    wherever it goes. Raises GpsfsmError if it cannot be written.
    """
    if output_file == STDOUT:
        to_stdout(text, form)
        return
    write_bytes(guarded(text, form).encode("utf-8", "backslashreplace"), output_file)


def form_of(output_format: str) -> Form:
    """The form of what a command writes under ``--format``."""
    return Form.JSON if output_format in _JSON else Form.TEXT


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
    """Write to standard error; where nobody reads it, that is fine."""
    to_stderr(text)


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
    return is_terminal(Stream.OUT) and os.environ.get("TERM") != "dumb"


def terminal_width(output_file: str = STDOUT) -> int | None:
    """The columns of the terminal, None where the output does not go to one."""
    if output_file != STDOUT or not is_terminal(Stream.OUT):
        return None
    return shutil.get_terminal_size().columns


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
