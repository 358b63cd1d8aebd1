"""The endpoints: every module of ``gpsfsm.service.endpoints`` with ``ENDPOINTS``.

A family of endpoints is one file, and a new one is a new file. Those modules import little: what
is heavy is imported by the functions that run in a worker. The OpenAPI document (3.1) is made from
the endpoints and their shapes.
"""

from __future__ import annotations

import importlib
import json
import pkgutil
import re
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any, Literal

from gpsfsm.service import endpoints
from gpsfsm.service.shapes import CONTENT_TYPE, ProblemDetails
from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from pydantic import BaseModel
    from starlette.requests import Request
    from starlette.responses import Response

    from gpsfsm.service.core import Core
    from gpsfsm.service.worker import WorkerContext


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
    work: Callable[[Any, bytes, WorkerContext], BaseModel] | None = None
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
    listed = [each for module in modules for each in module.ENDPOINTS]
    return tuple(sorted(listed, key=lambda each: (each.path, each.method)))


@cache
def endpoint(name: str) -> Endpoint:
    """The endpoint of this name. Raises KeyError if there is none."""
    return {each.name: each for each in all_endpoints()}[name]


_REF = "#/components/schemas/{model}"
_PARAMETER = re.compile(r"\{(\w+)\}")
_WORKED = (
    (408, "The body arrived too slowly."),
    (413, "The body is too long."),
    (415, "The body is of another media type."),
    (422, "The request is invalid."),
    (429, "Too many requests at once; Retry-After says when to try again."),
    (503, "It could not be answered now."),
    (504, "It could not be decided in time."),
)


@cache
def _paths_and_schemas() -> dict[str, Any]:
    """The part of the document that is the same wherever the service stands."""
    from pydantic.json_schema import models_json_schema

    listed = all_endpoints()
    requests: set[type[BaseModel]] = {each.request for each in listed if each.request is not None}
    answers: set[type[BaseModel]] = {each.answer for each in listed if each.answer is not None}
    shapes: list[type[BaseModel]] = sorted(
        {*requests, *answers, ProblemDetails}, key=lambda each: each.__name__
    )
    _, schemas = models_json_schema(
        [(each, _mode(each in requests)) for each in shapes], ref_template=_REF
    )
    paths: dict[str, dict[str, Any]] = {}
    for each in listed:
        paths.setdefault(each.path, {})[each.method.lower()] = _operation(each)
    return {
        "paths": paths,
        "components": {
            "schemas": schemas["$defs"],
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
        },
    }


@lru_cache(maxsize=16)  # it is made on the event loop, and takes some 15 ms
def document(prefix: str = "") -> bytes:
    """The document as JSON; ``prefix`` is the path below which the service stands."""
    about = {
        "title": "gpsfsm",
        "version": VERSION,
        "summary": "Formal checks for robot plans that language models write",
    }
    servers = [{"url": prefix or "/"}]
    whole = {"openapi": "3.1.0", "info": about, "servers": servers, **_paths_and_schemas()}
    return json.dumps(whole, indent=1).encode()


def _mode(is_request: bool) -> Literal["validation", "serialization"]:
    return "validation" if is_request else "serialization"


def _operation(wanted: Endpoint) -> dict[str, Any]:
    operation: dict[str, Any] = {"operationId": wanted.name, "summary": wanted.summary}
    parameters: list[dict[str, Any]] = [
        {"name": name, "in": "path", "required": True, "schema": {"type": "string"}}
        for name in _PARAMETER.findall(wanted.path)
    ]
    parameters += [
        {
            "name": each.name,
            "in": "query",
            "required": False,
            "description": each.what,
            "schema": {"type": "integer", "minimum": 0},
        }
        for each in wanted.query
    ]
    if parameters:
        operation["parameters"] = parameters
    if wanted.request is not None:
        content = {"application/json": _content(wanted.request)}
        if wanted.takes_plan:
            content["application/xml"] = {"schema": {"type": "string"}}
        operation["requestBody"] = {"required": True, "content": content}
    operation["responses"] = _responses(wanted)
    operation["security"] = [] if wanted.public else [{}, {"token": []}]
    return operation


def _responses(wanted: Endpoint) -> dict[str, Any]:
    content = (
        {"application/json": _content(wanted.answer)}
        if wanted.answer is not None
        else {wanted.media: {"schema": {"type": "object" if "json" in wanted.media else "string"}}}
    )
    responses: dict[str, Any] = {str(wanted.status): {"description": "Done.", "content": content}}
    errors = dict(_WORKED) if wanted.request is not None else {}
    errors |= dict(wanted.also)
    if not wanted.public:
        errors[401] = "A token is needed."
    problem = {CONTENT_TYPE: _content(ProblemDetails)}
    is_status = wanted.public and wanted.answer is not None
    same = {"application/json": _content(wanted.answer)} if is_status else problem
    for status, text in sorted(errors.items()):
        responses[str(status)] = {
            "description": text,
            "content": same if status == 503 else problem,
        }
    return responses


def _content(model: type[BaseModel] | None) -> dict[str, Any]:
    assert model is not None
    return {"schema": {"$ref": _REF.format(model=model.__name__)}}
