"""The line of a child process to the one that it works for."""

from __future__ import annotations

import subprocess
import sys

_CODE = """
import sys, threading
from gpsfsm.workers.parent_link import ParentLink

ended, links = threading.Event(), []
link = ParentLink(lambda link: (links.append(link), ended.set()))
assert ended.wait(30)
print(links == [link], file=sys.stderr)
"""


def test_an_end_before_the_beginning_is_noticed_with_the_link_itself() -> None:
    done = subprocess.run(
        [sys.executable, "-c", _CODE], stdin=subprocess.DEVNULL, capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, b"True\n")
