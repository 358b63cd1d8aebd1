"""The HTTP service (docs/service.md): checks, gate, grades, repairs, rules, and a queue of plans.

Needs the extra ``serve`` (Starlette and uvicorn), which ``app`` and ``serve`` import when called.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError, installing
from gpsfsm.service.settings import Settings

if TYPE_CHECKING:
    from starlette.applications import Starlette

__all__ = ["Settings", "app", "serve"]


def app(settings: Settings | None = None) -> Starlette:
    """The service as an ASGI application, for a server of your own.

    Timeouts of connections are the business of that server: ``serve`` has them. Raises UsageError
    without the extra ``serve``.
    """
    _require("starlette")
    from gpsfsm.service.application import make_app

    return make_app(settings or Settings())


def serve(settings: Settings) -> int:
    """Serve until a signal says to stop; the exit code. Raises GpsfsmError if it cannot begin."""
    _require("starlette", "uvicorn")
    from gpsfsm.service.server import run

    return run(settings)


def _require(*modules: str) -> None:
    """Raises UsageError without one of these, which the extra ``serve`` brings."""
    try:
        for module in modules:
            importlib.import_module(module)
    except ImportError as error:
        needed = f"the service needs Starlette and uvicorn: {installing('serve')}"
        raise UsageError(f"{needed} ({error})") from error
