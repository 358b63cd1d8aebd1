"""The command line of gpsfsm with a stopper of the tests: python -m tests.service.real_child WORD…

The variable STOPPER names the folder of the stopper (see ``stopper_child``); empty for none.
"""

from __future__ import annotations

import os
import sys

from gpsfsm.cli import main
from gpsfsm.ros import stopper

if __name__ == "__main__":
    if folder := os.environ.get("STOPPER"):
        command = (sys.executable, "-P", "-m", "tests.service.stopper_child", folder)
        stopper.stopper_command = lambda *_: command
    sys.exit(main())
