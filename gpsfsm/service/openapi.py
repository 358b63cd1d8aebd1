"""The OpenAPI document (3.1), made from the endpoints and their shapes."""

from __future__ import annotations

import json
import re
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

from pydantic.json_schema import models_json_schema

from gpsfsm.service.problems import CONTENT_TYPE
from gpsfsm.service.registry import all_endpoints
from gpsfsm.service.shapes import ProblemDetails
from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from pydantic import BaseModel

    from gpsfsm.service.registry import Endpoint

__all__ = ["document"]

_REF = "#/components/schemas/{model}"
_PARAMETER = re.compile(r"\{(\w+)\}")
_WORKED = (
    (408, "The body came too slowly."),
    (413, "The body is too long."),
    (415, "The body is of another media type."),
    (422, "The request makes no sense."),
    (429, "Too much is asked at once; Retry-After says when to come again."),
    (503, "It could not be answered now."),
    (504, "It could not be decided in time."),
)


@cache
def document() -> bytes:
    """The document as JSON."""
    found = all_endpoints()
    asked: set[type[BaseModel]] = {each.request for each in found if each.request is not None}
    told: set[type[BaseModel]] = {each.answer for each in found if each.answer is not None}
    shapes: list[type[BaseModel]] = sorted(
        {*asked, *told, ProblemDetails}, key=lambda each: each.__name__
    )
    _, schemas = models_json_schema(
        [(each, _mode(each in asked)) for each in shapes], ref_template=_REF
    )
    paths: dict[str, dict[str, Any]] = {}
    for each in found:
        paths.setdefault(each.path, {})[each.method.lower()] = _operation(each)
    return json.dumps(
        {
            "openapi": "3.1.0",
            "info": {
                "title": "gpsfsm",
                "version": VERSION,
                "summary": "Formal checks for robot plans that language models write",
            },
            "paths": paths,
            "components": {
                "schemas": schemas["$defs"],
                "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
            },
        },
        indent=1,
    ).encode()


def _mode(asked: bool) -> Literal["validation", "serialization"]:
    return "validation" if asked else "serialization"


def _operation(wanted: Endpoint) -> dict[str, Any]:
    found: dict[str, Any] = {"operationId": wanted.name, "summary": wanted.summary}
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
        found["parameters"] = parameters
    if wanted.request is not None:
        content = {"application/json": _content(wanted.request)}
        if wanted.takes_plan:
            content["application/xml"] = {"schema": {"type": "string"}}
        found["requestBody"] = {"required": True, "content": content}
    found["responses"] = _responses(wanted)
    found["security"] = [] if wanted.public else [{}, {"token": []}]
    return found


def _responses(wanted: Endpoint) -> dict[str, Any]:
    content = (
        {"application/json": _content(wanted.answer)}
        if wanted.answer is not None
        else {wanted.media: {"schema": {"type": "object" if "json" in wanted.media else "string"}}}
    )
    found: dict[str, Any] = {str(wanted.status): {"description": "Done.", "content": content}}
    errors = dict(_WORKED) if wanted.request is not None else {}
    errors |= dict(wanted.also)
    if not wanted.public:
        errors[401] = "A token is needed."
    problem = {CONTENT_TYPE: _content(ProblemDetails)}
    told = wanted.public and wanted.answer is not None
    same = {"application/json": _content(wanted.answer)} if told else problem
    for status, text in sorted(errors.items()):
        found[str(status)] = {"description": text, "content": same if status == 503 else problem}
    return found


def _content(model: type[BaseModel] | None) -> dict[str, Any]:
    assert model is not None
    return {"schema": {"$ref": _REF.format(model=model.__name__)}}
