"""Clients that mean no good: they get an answer, or are cut off, and the service stays up."""

from __future__ import annotations

import json
import os
import signal
import socket
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING

import pytest

from gpsfsm.service.registry import all_endpoints
from gpsfsm.service.shapes import Problem, parsed
from tests.service.support import GOOD, Service, slow_plan

if TYPE_CHECKING:
    from collections.abc import Iterator

    import httpx

    from gpsfsm.service.registry import Endpoint

PROBLEM = "application/problem+json"
WORDS = ("--workers", "1", "--time-limit", "2", "--max-body", "300000")


@pytest.fixture(scope="module")
def service() -> Iterator[Service]:
    with Service(*WORDS) as server:
        yield server


@pytest.fixture(autouse=True)
def _still_there(service: Service) -> Iterator[None]:
    yield
    with service.client() as client:
        until_s = time.monotonic() + 60
        while client.get("/health").status_code != 200:  # a worker may have to be replaced
            assert time.monotonic() < until_s
            time.sleep(0.1)
        response = client.post("/v1/gate", json={"plan": GOOD})
        assert (response.status_code, response.json()["verdict"]) == (200, "accepted"), (
            response.text
        )


def refused(response: httpx.Response, status: int) -> str:
    """The reason in a problem of the gate, which says no whatever has happened."""
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == PROBLEM
    body = response.json()
    assert (body["status"], body["verdict"], body["reason"]) == (
        status,
        "undecided",
        "inconclusive",
    )
    detail: str = body["detail"]
    return detail


def raw(service: Service, *parts: bytes) -> bytes:
    """All that comes back for these bytes, until the service closes."""
    with service.connect() as line:
        for part in parts:
            with suppress(OSError):  # it may have closed already
                line.sendall(part)
        output = b""
        with suppress(ConnectionResetError):
            while part := line.recv(65_536):
                output += part
        return output


def test_a_plan_that_takes_too_long_costs_a_worker_and_nothing_else(client: httpx.Client) -> None:
    began_s = time.monotonic()
    slow = {"plan": slow_plan(), "options": {"consistent": True}}
    detail = refused(client.post("/v1/gate", json=slow), 504)
    assert "undecided after 2 s" in detail
    assert time.monotonic() - began_s < 30  # a bound, no measure


def test_a_worker_that_is_killed_is_replaced(service: Service, client: httpx.Client) -> None:
    with ThreadPoolExecutor(1) as pool:
        slow = {"plan": slow_plan(), "options": {"consistent": True}}
        pending = pool.submit(lambda: client.post("/v1/gate", json=slow))
        until_s = time.monotonic() + 60
        with service.client() as other:
            while "gpsfsm_workers_busy 1" not in other.get("/metrics").text.splitlines():
                assert time.monotonic() < until_s
                time.sleep(0.02)
        for child, command in service.children().items():
            assert "gpsfsm.service.worker" in command
            os.kill(child, signal.SIGKILL)
        assert "SIGKILL" in refused(pending.result(), 503)


def test_a_worker_that_ends_in_its_sleep_fails_no_request(
    service: Service, client: httpx.Client
) -> None:
    killed = set(service.children())
    for child in killed:
        os.kill(child, signal.SIGKILL)
    until_s = time.monotonic() + 60
    while killed & set(service.children()) or client.get("/health").status_code != 200:
        assert time.monotonic() < until_s
        time.sleep(0.02)  # others begin, although nobody has missed them yet
    for path in ("/v1/gate", "/v1/check"):
        assert client.post(path, json={"plan": GOOD}).status_code == 200


def test_a_body_that_is_announced_too_long_is_not_read(service: Service) -> None:
    head = b"POST /v1/gate HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
    response = raw(service, head + b"Content-Length: 300001\r\n\r\n")  # and nothing comes
    assert response.startswith(b"HTTP/1.1 413 ")
    assert b'"verdict": "undecided"' in response
    odd = raw(service, head + b"Content-Length: 9999999999999999999999\r\n\r\n")
    assert odd.startswith((b"HTTP/1.1 400 ", b"HTTP/1.1 413 "))


def test_a_body_that_turns_out_too_long(service: Service) -> None:
    head = b"POST /v1/gate HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
    chunk = b"10000\r\n" + b"x" * 0x10000 + b"\r\n"
    response = raw(service, head + b"Transfer-Encoding: chunked\r\n\r\n", *[chunk] * 20)
    assert response.startswith(b"HTTP/1.1 413 ")


@pytest.mark.parametrize(
    "body",
    [
        b"[" * 100_000,
        b'{"plan":' * 20_000,
        b'{"plan": ' + b"[" * 1_000 + b"]" * 1_000 + b"}",
        b"",
        b"null",
        b"\xff\xfe",
        b'{"plan": "\\ud800"}',
        b'{"plan": "<Plan/>", "options": {"rlimit": 1e999}}',
        b'{"plan": "<Plan/>", "options": {"assume": ["((((("]}}',
        b'{"plan": "<Plan/>", "more": 1}',
        b'{"plan": "<Plan>", "plan": "<Plan/>"}',
        b'{"plan": "<Plan/>", "options": {"solver": "z3", "solver": "auto"}}',
        rb'{"plan": "<Plan/>", "\u0070lan": "<Plan/>"}',
        b'{"plan": "<Plan/>", "plan": "' + b"x" * 50_000 + b'"}',
    ],
)
def test_bodies_that_make_no_sense(client: httpx.Client, body: bytes) -> None:
    headers = {"content-type": "application/json"}
    refused(client.post("/v1/gate", content=body, headers=headers), 422)


@pytest.mark.parametrize(
    "plan",
    [
        "<Control type='sequential'>" * 10_000,
        "<Plan>" + "<Control type='recovery'>" * 5_000 + "</Control>" * 5_000 + "</Plan>",
        "<Plan " + "a='1' " * 5_000 + "/>",
        "<!DOCTYPE p [<!ENTITY a 'aaaa'><!ENTITY b '&a;&a;&a;'>]><Plan>&b;</Plan>",
        "<Plan>" + "&lt;" * 50_000,
        "\0" * 1_000,
    ],
)
def test_plans_that_are_none(client: httpx.Client, plan: str) -> None:
    response = client.post("/v1/gate", json={"plan": plan})
    assert response.status_code == 200
    assert response.json()["verdict"] in ("rejected", "undecided")


@pytest.mark.parametrize("media", ["text/plain", "application/x-www-form-urlencoded", "", "x"])
def test_only_media_types_that_no_page_sends_unasked(client: httpx.Client, media: str) -> None:
    body = json.dumps({"plan": GOOD}).encode()
    refused(client.post("/v1/gate", content=body, headers={"content-type": media}), 415)


@pytest.mark.parametrize(
    "headers",
    [{"host": "robots.example"}, {"host": "127.0.0.1.example:80"}, {"origin": "http://x.example"}],
)
def test_pages_of_other_sites_may_not_ask(client: httpx.Client, headers: dict[str, str]) -> None:
    response = client.post("/v1/gate", json={"plan": GOOD}, headers=headers)
    refused(response, 421 if "host" in headers else 403)


@pytest.mark.parametrize("each", [each for each in all_endpoints() if each.request is not None])
def test_a_key_twice_is_refused_by_every_endpoint_that_reads_json(each: Endpoint) -> None:
    """By those that read the body themselves, as by the ones whose workers do."""
    assert each.request is not None
    with pytest.raises(Problem) as refused:
        parsed(each.request, b'{"plan": "a", "task": "b", "plan": "c"}')
    assert refused.value.status == 422
    assert "the key 'plan' occurs twice" in refused.value.detail


@pytest.mark.parametrize(
    "heads",
    [
        b"Host: localhost\r\nHost: evil.example\r\n",
        b"Host: localhost\r\nContent-Type: application/json\r\nContent-Type: text/xml\r\n",
        b"Host: localhost\r\nContent-Length: 2\r\nContent-Length: 3\r\n",
        b"Host: localhost\r\nTransfer-Encoding: chunked\r\nTransfer-Encoding: identity\r\n",
    ],
)
def test_heads_that_say_two_things(service: Service, heads: bytes) -> None:
    response = raw(service, b"POST /v1/gate HTTP/1.1\r\n" + heads + b"\r\n{}")
    assert response.startswith((b"HTTP/1.1 400 ", b"HTTP/1.1 501 ")), response
    assert b'"verdict": "undecided"' in response


CHUNKED = b"Transfer-Encoding: chunked\r\n"


@pytest.mark.parametrize(
    "heads",
    [
        b"HTTP/1.1\r\nContent-Length: 2\r\n" + CHUNKED,
        b"HTTP/1.1\r\n" + CHUNKED + b"content-length: 7\r\n",
        b"HTTP/1.1\r\nContent-Length: 2\r\nContent-Length: 7\r\n",
        b"HTTP/1.1\r\nContent-Length : 2\r\n",
        b"HTTP/1.1\r\nTransfer-Encoding : chunked\r\n",
        b"HTTP/1.1\r\nTransfer-Encoding: gzip, chunked\r\n",
        b"HTTP/1.1\r\nTransfer-Encoding: identity\r\n",
        b"HTTP/1.1\r\nTransfer-Encoding: \x0bchunked\r\n",
        b"HTTP/1.1\r\nContent-Length: +2\r\n",
        b"HTTP/1.1\r\nContent-Length: 0x2\r\n",
        b"HTTP/1.1\r\nX: y\n" + CHUNKED + b"Content-Length: 2\r\n",
        b"HTTP/1.0\r\n" + CHUNKED,
        b"HTTP/1.0\r\nConnection: keep-alive\r\n" + CHUNKED,
    ],
)
def test_a_request_whose_end_is_not_clear_is_the_last_of_its_connection(
    service: Service, heads: bytes
) -> None:
    """Else a part of its body would be a request that no proxy has seen."""
    hidden = b"GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n"
    head = b"POST /v1/gate " + heads + b"Host: localhost\r\nContent-Type: application/json\r\n\r\n"
    response = raw(service, head + b"2\r\n{}\r\n0\r\n\r\n" + hidden)
    assert response.startswith(b"HTTP/1.1 400 "), response
    assert response.count(b"HTTP/1.1 ") == 1
    assert b"connection: close" in response.lower()


def test_a_target_with_a_host_of_its_own(service: Service) -> None:
    target = b"POST http://evil.example/v1/gate HTTP/1.1\r\nHost: localhost\r\n"
    assert raw(service, target + b"Content-Length: 0\r\n\r\n").startswith(b"HTTP/1.1 400 ")


@pytest.mark.parametrize(
    "request_line",
    [b"nonsense\r\n\r\n", b"GET / HTTP/1.1\r\n\r\n", b"GET / HTTP/1.1\r\nHost: a\r\nx y\r\n\r\n"],
)
def test_what_is_no_http(service: Service, request_line: bytes) -> None:
    response = raw(service, request_line)
    assert response.startswith(b"HTTP/1.1 400 ")
    assert PROBLEM.encode() in response


def test_a_head_without_an_end(service: Service) -> None:
    response = raw(service, b"GET / HTTP/1.1\r\nHost: localhost\r\nX: " + b"x" * 100_000)
    assert response.startswith(b"HTTP/1.1 400 ") or response == b""


def test_many_connections_at_once(service: Service, client: httpx.Client) -> None:
    """All of them ask; whoever is not served is told so."""
    body = json.dumps({"plan": GOOD}).encode()
    head = "POST /v1/gate HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
    head += f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\n\r\n"
    lines = [service.connect() for _ in range(300)]
    for line in lines:
        line.sendall(head.encode() + body)
    statuses = []
    for line in lines:
        with line, line.makefile("rb") as file:
            statuses.append(int(file.readline().split()[1]))
            if statuses[-1] == 429:
                assert b"retry-after" in file.read().lower()
    assert set(statuses) <= {200, 429, 503}
    assert statuses.count(200) >= 64
    assert client.get("/health").status_code == 200


def test_clients_that_send_a_byte_now_and_then_are_cut_off() -> None:
    """With shorter times than the command line allows to ask for."""
    code = (
        "import sys; from gpsfsm.service import Settings, serve; "
        "sys.exit(serve(Settings(port=0, workers=1, header_s=0.5, body_s=0.5, idle_s=1)))"
    )
    service = Service()
    service.command = ["-c", code]
    with service:
        head = b"POST /v1/gate HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
        assert raw(service) == b""  # says nothing at all
        assert drip(service, head) == b""
        answer = raw(service, head + b"Content-Length: 100\r\n\r\n", b"x")
        assert answer.startswith(b"HTTP/1.1 408 ")
        with service.client() as client:
            assert client.get("/health").status_code == 200
            time.sleep(1.5)  # kept alive, but not for ever
            assert client.get("/health").status_code == 200


def test_one_peer_does_not_take_all_connections() -> None:
    """The longest silent ones make room for who comes from there with a request."""
    with Service("--workers", "1", "--connections", "16") as service, ExitStack() as lines:
        silent = [lines.enter_context(service.connect()) for _ in range(40)]
        for _ in range(3):
            with service.client() as client:
                assert client.post("/v1/gate", json={"plan": GOOD}).status_code == 200
                assert client.get("/health").status_code == 200
        cut = 0
        for line in silent:
            line.settimeout(0.05)
            with suppress(TimeoutError, ConnectionResetError):
                if line.recv(1_000):
                    continue
            cut += 1
        assert cut >= 40 - 12  # three quarters of 16 stay


def test_who_has_a_request_under_way_is_not_cut_off() -> None:
    words = ("--workers", "1", "--connections", "8", "--time-limit", "2")
    with Service(*words) as service, ExitStack() as lines:
        slow = json.dumps({"plan": slow_plan(), "options": {"consistent": True}}).encode()
        head = "POST /v1/gate HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
        whole = f"{head}Content-Length: {len(slow)}\r\n\r\n".encode() + slow
        first = lines.enter_context(service.connect())
        first.sendall(whole)
        time.sleep(0.5)
        for _ in range(20):
            lines.enter_context(service.connect())
        assert first.recv(1_000).startswith(b"HTTP/1.1 504 ")


def drip(service: Service, content: bytes) -> bytes:
    """What comes back if this is sent one byte after the other."""
    with service.connect() as line:
        line.settimeout(0.05)
        output = b""
        for byte in content:
            try:
                line.sendall(bytes((byte,)))
                part = line.recv(65_536)
            except TimeoutError:
                continue
            except OSError:
                return output
            output += part
            if not part:
                return output
        raise AssertionError("it was never cut off")


def test_a_client_that_does_not_read_holds_nobody_up(service: Service) -> None:
    with socket.socket() as line:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4_096)
        line.connect(service.place)
        ask = b"GET /openapi.json HTTP/1.1\r\nHost: localhost\r\n\r\n"
        with suppress(OSError):
            line.settimeout(1)
            line.sendall(ask * 200)
        with service.client() as client:
            assert client.get("/health").status_code == 200
