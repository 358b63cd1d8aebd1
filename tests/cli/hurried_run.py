"""A process that runs ``gpsfsm`` and waits a second for whoever is to write to a pipe.

python -m tests.cli.hurried_run ARGUMENTS…
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from gpsfsm import files
from gpsfsm.cli import main
from tests.cli.support import environment
from tests.forked import Forked

if TYPE_CHECKING:
    import subprocess
    from pathlib import Path

__all__ = ["hurried"]


def hurried(*arguments: str, cwd: Path) -> subprocess.Popen[bytes]:
    """Begin ``gpsfsm ARGUMENTS…``, with pipes for what it writes."""
    module = "tests.cli.hurried_run"
    return Forked(arguments, cwd=cwd, environment=environment(), module=module)


if __name__ == "__main__":
    files.WRITER_S = 1.0
    sys.exit(main(sys.argv[1:]))
