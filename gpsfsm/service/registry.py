"""The endpoints: every module of ``gpsfsm.service.endpoints`` with ``ENDPOINTS``.

A family of endpoints is one file, and a new one is a new file. Those modules import little: what
is heavy is imported by the functions that run in a worker.
"""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

from gpsfsm.service import endpoints

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from pydantic import BaseModel
    from starlette.requests import Request
    from starlette.responses import Response

    from gpsfsm.service.core import Core
    from gpsfsm.service.kitchen import Kitchen

__all__ = ["Endpoint", "Query", "all_endpoints", "endpoint"]


@dataclass(frozen=True, slots=True)
class Query:
    """A number that may stand behind the question mark of an address."""

    name: str
    what: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Endpoint:
    """One endpoint.

    ``request`` and ``answer`` are the shapes of the bodies; without ``answer`` it is of the media
    type ``media``. Either ``work`` answers, in a worker process: it gets the request, the text of
    the plan and what the worker has; or ``handle``, in the service itself. ``takes_plan``: the body
    may also be the plan itself, as XML. ``refuses``: errors say that the plan is refused.
    ``public``: no token is asked for. ``query``: what may stand behind the address. ``also`` are
    further statuses of answers, and what they mean.
    """

    method: Literal["GET", "POST"]
    path: str
    name: str
    summary: str
    request: type[BaseModel] | None = None
    answer: type[BaseModel] | None = None
    status: int = 200
    media: str = "application/json"
    work: Callable[[Any, bytes, Kitchen], BaseModel] | None = None
    handle: Callable[[Core, Request], Awaitable[Response]] | None = None
    takes_plan: bool = False
    refuses: bool = False
    public: bool = False
    query: tuple[Query, ...] = ()
    also: tuple[tuple[int, str], ...] = ()


@cache
def all_endpoints() -> tuple[Endpoint, ...]:
    """All endpoints, by path."""
    names = sorted(module.name for module in pkgutil.iter_modules(endpoints.__path__))
    modules = [
        importlib.import_module(f"{endpoints.__name__}.{name}") for name in names if name[0] != "_"
    ]
    found = [each for module in modules for each in module.ENDPOINTS]
    return tuple(sorted(found, key=lambda each: (each.path, each.method)))


@cache
def endpoint(name: str) -> Endpoint:
    """The endpoint of this name. Raises KeyError if there is none."""
    return {each.name: each for each in all_endpoints()}[name]
