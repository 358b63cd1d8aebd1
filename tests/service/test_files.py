"""The files of the live page, served as they are and nothing besides; and who may ask at all."""

from __future__ import annotations

import asyncio
from importlib.resources import files

import httpx
import pytest

from gpsfsm.generation.providers.address import Secret
from gpsfsm.service import Settings, app

TOKEN = "t0k3n-of-sixteen-letters"  # noqa: S105
WEB = files("gpsfsm.viewing").joinpath("web")


def response_to(
    path: str, *, method: str = "GET", settings: Settings | None = None, **headers: str
) -> httpx.Response:
    """An answer of the application itself, without processes."""
    transport = httpx.ASGITransport(app(settings or Settings()))

    async def ask() -> httpx.Response:
        base = "http://localhost:8321"
        async with httpx.AsyncClient(transport=transport, base_url=base) as client:
            return await client.request(method, path, headers=headers)

    return asyncio.run(ask())


@pytest.mark.parametrize(
    ("path", "file", "media"),
    [
        ("/", "live.html", "text/html; charset=utf-8"),
        ("/ui/live.js", "live.js", "text/javascript; charset=utf-8"),
        ("/ui/live.css", "live.css", "text/css; charset=utf-8"),
        ("/ui/graph.js", "graph.js", "text/javascript; charset=utf-8"),
    ],
)
def test_a_file_comes_as_it_is(path: str, file: str, media: str) -> None:
    actual = response_to(path)
    assert actual.status_code == 200
    assert actual.content == WEB.joinpath(file).read_bytes()
    assert actual.headers["content-type"] == media
    assert actual.headers["x-content-type-options"] == "nosniff"
    assert actual.headers["x-frame-options"] == "DENY"
    policy = actual.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert "*" not in policy


@pytest.mark.parametrize(
    "path",
    [
        *("/ui/nothing.js", "/ui/vendor", "/ui/", "/ui/live.html", "/ui/vendor/live.js"),
        *("/ui/..%2f__init__.py", "/ui/../__init__.py", "/ui/vendor/..%2flive.js", "/ui/%00.js"),
        *("/ui/ui/live.js", "/ui//live.js", "/ui/LIVE.JS", "/ui/.live.js"),
    ],
)
def test_there_is_nothing_else(path: str) -> None:
    actual = response_to(path)
    assert actual.status_code == 404
    assert actual.headers["content-type"] == "application/problem+json"


def test_the_page_needs_no_token_but_what_it_asks_for_does() -> None:
    settings = Settings(tokens=(Secret(TOKEN),))
    for path in ("/", "/ui/live.js", "/ui/page.css"):
        assert response_to(path, settings=settings).status_code == 200
    for path in ("/v1/service", "/v1/runs", "/openapi.json", "/ui/live.js/x", "/uix"):
        assert response_to(path, settings=settings).status_code == 401


@pytest.mark.parametrize(
    ("method", "headers", "status"),
    [
        ("POST", {"origin": "http://localhost:8321"}, 501),
        ("POST", {"origin": "http://localhost:8321", "sec-fetch-site": "same-origin"}, 501),
        ("POST", {"sec-fetch-site": "none"}, 501),
        ("POST", {}, 501),
        ("POST", {"origin": "http://localhost:3000"}, 403),  # another server on this machine
        ("POST", {"origin": "http://127.0.0.1:8321"}, 403),  # the same, but another site
        ("POST", {"origin": "https://evil.example"}, 403),
        ("POST", {"origin": "null"}, 403),
        ("POST", {"sec-fetch-site": "same-site"}, 403),
        ("POST", {"sec-fetch-site": "cross-site"}, 403),
        ("GET", {"sec-fetch-site": "cross-site"}, 403),
        ("GET", {"sec-fetch-site": "same-origin"}, 501),
        ("GET", {"origin": "https://evil.example"}, 403),
        ("GET", {"host": "evil.example"}, 421),
    ],
)
def test_pages_of_others_do_nothing(method: str, headers: dict[str, str], status: int) -> None:
    path = "/v1/plans/1/cancel" if method == "POST" else "/v1/plans/1"
    assert response_to(path, method=method, **headers).status_code == status


def test_a_link_of_another_site_may_lead_to_the_page() -> None:
    there = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate"}
    assert response_to("/", **there).status_code == 200
    assert response_to("/", method="POST", **there).status_code == 403


def test_a_name_that_was_allowed_may_be_where_a_page_comes_from() -> None:
    settings = Settings(hosts=("robots.example",))
    headers = {"origin": "https://robots.example", "host": "localhost:8321"}
    actual = response_to("/v1/plans/1/cancel", method="POST", settings=settings, **headers)
    assert actual.status_code == 501


def test_a_page_is_told_that_nothing_can_be_run() -> None:
    document = response_to("/v1/service").json()
    assert (document["queue"], document["worlds"], document["regenerates"]) == (False, [], False)
    for path in ("/v1/runs", "/v1/runs/1", "/v1/runs/1/events", "/v1/worlds/home"):
        assert response_to(path).status_code == 501
    assert response_to("/v1/queue/events").status_code == 501
