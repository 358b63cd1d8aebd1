"""Requests go only where they may, and their answers are bounded."""

from __future__ import annotations

import bz2
import re
import subprocess
import sys
import threading
import time
import zlib
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

import pytest

from gpsfsm.runners import generic
from tests.runners.acting import WAIT_S, act, fails

if TYPE_CHECKING:
    from collections.abc import Iterator


BODIES = {  # what takes long to decode, or becomes more
    "punycode": b"a" * 400_000 + b"-" + b"9" * 100_000 + b"a" * 100_000,
    "idna": b"xn--" + b"9" * 200_000,
    "utf-7": b"+" * 500_000,
    "unicode_escape": b"\\N{BULLET}" * 50_000,
    "raw_unicode_escape": b"\\u0041" * 100_000,
    "zlib": zlib.compress(b"x" * 5_000_000),
    "bz2_codec": bz2.compress(b"x" * 900_000),
    "base64": b"eHh4",
    "rot13": b"x",
    "hex": b"00",
    "undefined": b"x",
    "mbcs": b"x",
}


class Answers(BaseHTTPRequestHandler):
    """Answers by what the path says."""

    def do_GET(self) -> None:
        length = int(self.headers.get("Content-Length") or 0)
        body = self.rfile.read(length)
        _, what, *more = self.path.split("/", 2)
        getattr(self, f"say_{what}")(body, more[0] if more else "")

    do_POST = do_GET  # noqa: N815

    def say_echo(self, body: bytes, _: str) -> None:
        key = self.headers.get("Idempotency-Key", "")
        self.answer(200, f"{self.command} {body.decode()} {key}".encode())

    def say_status(self, _: bytes, status: str) -> None:
        self.answer(int(status), b"as you like")

    def say_to(self, _: bytes, where: str) -> None:
        self.answer(302, b"", Location=where)

    def say_slow(self, _: bytes, seconds: str) -> None:
        time.sleep(float(seconds))
        self.answer(200, b"late")

    def say_much(self, _: bytes, __: str) -> None:
        self.send_response(200)
        self.end_headers()
        for _ in range(100):
            self.wfile.write(b"x" * 100_000)

    def say_packed(self, _: bytes, __: str) -> None:
        self.answer(200, b"\x1f\x8b", **{"Content-Encoding": "gzip"})

    def say_in(self, _: bytes, charset: str) -> None:
        body, name = BODIES.get(charset, b"\xff\x00"), unquote(charset)
        self.answer(200, body, **{"Content-Type": f"text/plain; charset={name}"})

    def say_typed(self, _: bytes, length: str) -> None:
        self.answer(200, b"x", **{"Content-Type": ";" * int(length)})

    def say_bits(self, _: bytes, __: str) -> None:
        self.send_response(200)
        self.send_header("Transfer-Encoding", "chunked")
        self.end_headers()
        for _ in range(100):
            self.wfile.write(b"1\r\nx\r\n" * 8_000)

    def say_drops(self, _: bytes, __: str) -> None:
        self.send_response(200)
        self.end_headers()
        while True:
            self.wfile.write(b"x")
            time.sleep(0.01)

    def say_header(self, _: bytes, __: str) -> None:
        self.wfile.write(b"HTTP/1.1 200 OK\r\n")
        while True:
            self.wfile.write(b"x")
            time.sleep(0.01)

    def say_soon(self, _: bytes, __: str) -> None:
        while True:
            self.wfile.write(b"HTTP/1.1 100 Continue\r\n\r\n" * 200)

    def answer(self, status: int, body: bytes, **headers: str) -> None:
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        return


class Quiet(ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, *_: object) -> None:
        return  # a client that leaves early


@contextmanager
def serving() -> Iterator[str]:
    server = Quiet(("127.0.0.1", 0), Answers)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
    thread.start()
    try:
        yield f"127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()


@pytest.fixture(scope="module")
def host() -> Iterator[str]:
    with serving() as server:
        yield server


def test_a_request_and_its_answer(host: str) -> None:
    services = {"allow_hosts": [host]}
    outputs = act(
        generic.HttpRunner(), services, url=f"http://{host}/echo", method="POST", body="hi"
    )
    assert outputs == {"response_body": "POST hi run:/Plan/Runner[1]", "status_code": 200}
    outputs = act(generic.HttpRunner(), {"allow_hosts": ["127.0.0.1"]}, url=f"http://{host}/echo")
    assert outputs["response_body"].startswith("GET  ")


def test_the_status_decides(host: str) -> None:
    services = {"allow_hosts": [host]}
    error = fails(generic.HttpRunner(), services, url=f"http://{host}/status/404")
    assert str(error) == "the answer has the status 404, and any from 200 to 299 was expected"
    assert error.outputs == {"status_code": 404}
    outputs = act(
        generic.HttpRunner(), services, url=f"http://{host}/status/404", expect_status=404
    )
    assert outputs["status_code"] == 404
    error = fails(generic.HttpRunner(), services, url=f"http://{host}/echo", expect_status=404)
    assert str(error) == "the answer has the status 200, and 404 was expected"


def test_redirects_lead_only_where_it_is_allowed(host: str) -> None:
    with serving() as other:
        url = f"http://{host}/to/http://{other}/echo"
        error = fails(generic.HttpRunner(), {"allow_hosts": [host]}, url=url)
        assert str(error) == f"the host {other} is not allowed"
        outputs = act(generic.HttpRunner(), {"allow_hosts": [host, other]}, url=url, method="POST")
        assert outputs["response_body"].startswith("GET ")
    error = fails(
        generic.HttpRunner(), {"allow_hosts": [host]}, url=f"http://{host}/to/file:///etc/passwd"
    )
    assert "does not begin with http" in str(error)


def test_redirects_in_a_circle(host: str) -> None:
    circle = f"http://{host}/to/../to/"
    error = fails(generic.HttpRunner(), {"allow_hosts": [host]}, url=f"http://{host}/to/{circle}")
    assert str(error).startswith(("more than 5 redirects", "no answer from"))


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("much", "the answer has more than 900,000 bytes"),
        ("packed", "the answer is compressed, although that was not requested"),
        ("typed/60000", "the answer says at too great a length of what type it is"),
    ],
)
def test_answers_that_are_too_much(host: str, path: str, message: str) -> None:
    error = fails(generic.HttpRunner(), {"allow_hosts": [host]}, url=f"http://{host}/{path}")
    assert str(error) == message


@pytest.mark.parametrize("charset", ["utf-8", "%22UTF-8%22", "us-ascii"])
def test_an_answer_that_is_no_text_is_made_one(host: str, charset: str) -> None:
    outputs = act(generic.HttpRunner(), {"allow_hosts": [host]}, url=f"http://{host}/in/{charset}")
    assert outputs["response_body"] == "\ufffd\0"


@pytest.mark.parametrize(
    ("charset", "read"),
    [
        *[("ISO-8859-1", "\xff\0"), ("windows-1252", "\xff\0"), ("koi8-r", "Ъ\0")],
        *[("utf-16", "\xff"), ("UTF-16BE", "\uff00"), ("utf-32", "\ufffd")],
        *[("gb18030", "\ufffd\0"), ("Shift_JIS", "\ufffd\0"), ("ISO-8859-15", "\xff\0")],
    ],
)
def test_an_answer_in_a_usual_encoding(host: str, charset: str, read: str) -> None:
    outputs = act(generic.HttpRunner(), {"allow_hosts": [host]}, url=f"http://{host}/in/{charset}")
    assert outputs["response_body"] == read


@pytest.mark.parametrize("charset", [*BODIES, "no-such-thing", "x" * 400, "os"])
def test_no_answer_says_which_codec_is_used(host: str, charset: str) -> None:
    began_s = time.monotonic()
    error = fails(
        generic.HttpRunner(),
        {"allow_hosts": [host]},
        url=f"http://{host}/in/{charset}",
        timeout_s=1.0,
    )
    assert str(error) == (
        f"the answer is in {unquote(charset)[:40]!r}, an encoding that is not read here"
    )
    assert time.monotonic() - began_s < WAIT_S


@pytest.mark.parametrize("what", ["bits", "drops", "header", "soon"])
def test_an_answer_that_comes_slowly_is_over_in_time(host: str, what: str) -> None:
    began_s = time.monotonic()
    url = f"http://{host}/{what}"
    error = fails(generic.HttpRunner(), {"allow_hosts": [host]}, url=url, timeout_s=0.3)
    assert str(error) == f"no answer from {url} within 0.3 s"
    assert time.monotonic() - began_s < WAIT_S


def test_no_answer_in_time(host: str) -> None:
    error = fails(
        generic.HttpRunner(), {"allow_hosts": [host]}, url=f"http://{host}/slow/5", timeout_s=0.2
    )
    assert str(error) == f"no answer from http://{host}/slow/5 within 0.2 s"


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"url": "ftp://127.0.0.1/x"}, "the address 'ftp://127.0.0.1/x' does not begin with"),
        ({"url": "x"}, "the address '/x' does not begin with"),
        ({"url": "http://[::1"}, "no answer from http://[::1: "),
        ({"url": "http://127.0.0.1@evil.example/"}, "the host evil.example:80 is not allowed"),
        ({"url": "http://[::1]:9/"}, "the host [::1]:9 is not allowed"),
        ({"url": "http://127.0.0.1:0/"}, "there is no port 0"),
        ({"url": "http://127.0.0.1:99999/"}, "there is no port 99999"),
        ({"url": "http://127.0.0.1\\@evil.example/"}, "the host evil.example:80 is not allowed"),
        ({"url": "http://evil.example\\.127.0.0.1/"}, "the host evil.example"),
        ({"url": "http://evil.example#@127.0.0.1/"}, "the host evil.example:80 is not allowed"),
        ({"url": "http://127.0.0.1.evil.example/"}, "the host 127.0.0.1.evil.example:80 is not"),
        ({"url": "http://127.1/"}, "the host 127.1:80 is not allowed"),
        ({"url": "http://2130706433/"}, "the host 2130706433:80 is not allowed"),
        ({"url": "http://[::ffff:127.0.0.1]/"}, "the host [::ffff:127.0.0.1]:80 is not allowed"),
        ({"url": "http:///127.0.0.1/"}, "the address '/127.0.0.1/' does not begin with"),
        ({"url": "http://127.0.0.1:1/"}, "no answer from http://127.0.0.1:1/: ConnectError"),
        ({"url": "http://127.0.0.1/", "method": "TRACE"}, "the method 'TRACE' is not one of"),
        ({}, "'url' is missing"),
    ],
)
def test_requests_that_are_not_sent(parameters: dict[str, Any], message: str) -> None:
    error = fails(generic.HttpRunner(), {"allow_hosts": ["127.0.0.1"]}, **parameters)
    assert str(error).startswith(message)


@pytest.mark.parametrize(
    ("url", "seen"),
    [
        ("http://me:secret@127.0.0.1:1/x", "http://***@127.0.0.1:1/x"),
        ("http://me:secret@evil.example/x", "the host evil.example:80 is not allowed"),
        ("http://me:sec/ret@127.0.0.1:1/x", "http://***@127.0.0.1:1/x"),
        ("http://me:sec#ret@127.0.0.1:1/x", "http://***@127.0.0.1:1/x"),
        ("http://me:sec ret@127.0.0.1:1/x", "http://***@127.0.0.1:1/x"),
        ("http://127.0.0.1:1/x?token=secret", "http://127.0.0.1:1/x?***"),
        ("ftp://me:secret@127.0.0.1:1/x", "ftp://***@127.0.0.1:1/x"),
    ],
)
def test_what_is_secret_in_an_address_is_not_shown(url: str, seen: str) -> None:
    error = fails(generic.HttpRunner(), {"allow_hosts": ["127.0.0.1"]}, url=url)
    assert seen in str(error)
    assert not re.search("sec|ret@|me:", str(error))


def test_a_redirect_shows_no_secrets_and_keeps_none(host: str) -> None:
    url = f"http://{host}/to/http://me:secret@evil.example/"
    error = fails(generic.HttpRunner(), {"allow_hosts": [host]}, url=url)
    assert str(error) == "the host evil.example:80 is not allowed"


@pytest.mark.parametrize(
    "where",
    ["//evil.example/", "http://{host}@evil.example/", "http:\\\\evil.example/", "/\\evil.example"],
)
def test_redirects_do_not_get_around(host: str, where: str) -> None:
    """Wherever they lead, it is not to another host."""
    url = f"http://{host}/to/{where.format(host=host)}"
    error = str(fails(generic.HttpRunner(), {"allow_hosts": [host]}, url=url))
    assert "is not allowed" in error or error.startswith(("no answer from", "more than 5"))


def test_a_host_may_be_written_in_any_case(host: str) -> None:
    port = host.rpartition(":")[2]
    outputs = act(
        generic.HttpRunner(),
        {"allow_hosts": [f"LocalHost:{port}"]},
        url=f"http://LOCALHOST:{port}/echo",
    )
    assert outputs["status_code"] == 200


def test_hosts_that_make_no_sense_keep_it_from_loading() -> None:
    error = fails(generic.HttpRunner(), {"allow_hosts": ["*"]}, url="http://127.0.0.1/")
    assert str(error).startswith("a host that is allowed cannot be used: there are no patterns")


def test_proxies_of_the_environment_are_not_used(
    host: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("HTTP_PROXY", "http_proxy", "ALL_PROXY"):
        monkeypatch.setenv(name, "http://127.0.0.1:1")
    outputs = act(generic.HttpRunner(), {"allow_hosts": [host]}, url=f"http://{host}/echo")
    assert outputs["status_code"] == 200


def test_httpx_is_imported_only_for_requests() -> None:
    code = (
        "import sys, gpsfsm.runners.generic as generic\n"
        "for name in generic.__all__:\n"
        "    getattr(generic, name)()\n"
        "assert 'httpx' not in sys.modules\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
