"""The line of a child process to the one that it works for."""

from __future__ import annotations

import subprocess
import sys

_CODE = """
import sys, threading
from gpsfsm.workers.line import Line

ended, lines = threading.Event(), []
line = Line(lambda line: (lines.append(line), ended.set()))
assert ended.wait(30)
print(lines == [line], file=sys.stderr)
"""


def test_an_end_before_the_beginning_is_noticed_with_the_line_itself() -> None:
    done = subprocess.run(
        [sys.executable, "-c", _CODE], stdin=subprocess.DEVNULL, capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, b"True\n")
