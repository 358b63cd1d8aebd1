"""A process that runs ``gpsfsm`` and can make no file longer than some bytes.

python -m tests.cli.limited_run BYTES ARGUMENTS…
"""

from __future__ import annotations

import resource
import subprocess
import sys
from contextlib import ExitStack
from typing import TYPE_CHECKING

from gpsfsm.cli import main
from tests.cli.support import TIMEOUT_S, environment
from tests.forked import Forked

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["FULL", "limited"]


FULL = "/dev/full"


def limited(
    most: int, *arguments: str, cwd: Path, full: str = ""
) -> subprocess.CompletedProcess[bytes]:
    """``gpsfsm ARGUMENTS…`` with that limit; must end in time and without a traceback.

    ``full`` names the streams (``out``, ``err``) that take nothing.
    """
    words = [str(most), *arguments]
    with ExitStack() as stack:
        out, err = (  # else pipes: a file that takes what it writes would be limited as well
            stack.enter_context(open(FULL, "wb")) if name in full else subprocess.PIPE  # noqa: PTH123
            for name in ("out", "err")
        )
        process = stack.enter_context(
            Forked(
                words,
                cwd=cwd,
                environment=environment(),
                stdout=out,
                stderr=err,
                module="tests.cli.limited_run",
            )
        )
        said, errors = process.communicate(timeout=TIMEOUT_S)
    said, errors = said or b"", errors or b""
    assert b"Traceback" not in said + errors
    return subprocess.CompletedProcess(words, process.returncode, said, errors)


if __name__ == "__main__":
    sys.dont_write_bytecode = True  # Python would leave half of a module behind
    limit = int(sys.argv[1])
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    sys.exit(main(sys.argv[2:]))
