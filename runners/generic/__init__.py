"""Generic runners: wait, log, HTTP requests, programs, and functions of Python.

What they may reach is not for the plan to say. The user allows it, through the services
``allow_hosts``, ``allow_programs`` and ``allow_functions`` of a run; without them nothing is
allowed.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gpsfsm.runners.generic.basic import LogRunner, WaitRunner
    from gpsfsm.runners.generic.http import HttpRunner
    from gpsfsm.runners.generic.process import ProcessRunner
    from gpsfsm.runners.generic.python import PythonRunner

__all__ = ["HttpRunner", "LogRunner", "ProcessRunner", "PythonRunner", "WaitRunner"]

_MODULES = {
    "HttpRunner": "http",
    "LogRunner": "basic",
    "ProcessRunner": "process",
    "PythonRunner": "python",
    "WaitRunner": "basic",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
