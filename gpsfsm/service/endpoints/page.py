"""``GET /``: the live page, and the files that it is made of.

They hold no data, so no token is asked for. What a browser may do with them is said by the policy
that comes along: nothing but talk to this service.
"""

from __future__ import annotations

import asyncio
import re
from importlib.resources import files
from typing import TYPE_CHECKING

from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import Problem

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

    from starlette.requests import Request
    from starlette.responses import Response

    from gpsfsm.service.core import Core

_PAGE = "live.html"
_NAME = re.compile(r"[a-z][a-z0-9_.-]*")
_TYPES = {
    "js": "text/javascript; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "svg": "image/svg+xml",
    "png": "image/png",
}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' data: blob:; font-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
_HEADERS = {
    "content-security-policy": _POLICY,
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-frame-options": "DENY",
}


def _files() -> dict[str, Traversable]:
    """The files that may be requested, by name: a name that is not among them leads nowhere."""
    return {
        file.name: file
        for file in files("gpsfsm.viewing").joinpath("web").iterdir()
        if _NAME.fullmatch(file.name) and file.is_file()
    }


async def _to_response(name: str, media: str) -> Response:
    from starlette.responses import Response

    file = await asyncio.to_thread(lambda: _files().get(name))
    if file is None:
        raise Problem(404, "there is no such file")
    content = await asyncio.to_thread(file.read_bytes)
    return Response(content, media_type=media, headers=_HEADERS)


async def _page(_core: Core, _request: Request) -> Response:
    return await _to_response(_PAGE, "text/html; charset=utf-8")


async def _file(_core: Core, request: Request) -> Response:
    name: str = request.path_params["file"]
    media = _TYPES.get(name.rpartition(".")[2])
    if media is None:
        raise Problem(404, "there is no such file")
    return await _to_response(name, media)


_NONE = (404, "There is no such file.")

ENDPOINTS = (
    Endpoint(
        method="GET",
        path="/",
        name="page",
        summary="The live page",
        media="text/html",
        handle=_page,
        public=True,
        also=(_NONE,),
    ),
    Endpoint(
        method="GET",
        path="/ui/{file}",
        name="page_file",
        summary="A file of the live page",
        media="text/javascript",
        handle=_file,
        public=True,
        also=(_NONE,),
    ),
)
