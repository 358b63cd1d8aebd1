"""What is said of connections that fail in ways that cannot be staged here."""

from __future__ import annotations

import errno
import socket
import ssl

import httpx
import pytest

from gpsfsm.generation.providers.address import Secret
from gpsfsm.generation.providers.dialect import without_thoughts
from gpsfsm.generation.providers.transport import Place, refused, unreachable
from tests.generation.providers.asking import KEY

PLACE = Place(url="https://x.example/v1", key=Secret(KEY, "THE_KEY"), start_hint="start it")


def caused(outer: Exception, *causes: BaseException) -> Exception:
    """An exception with a chain of causes, whose texts hold the key."""
    current: BaseException = outer
    for cause in causes:
        current.__cause__ = cause
        current = cause
    return outer


def untrusted() -> ssl.SSLCertVerificationError:
    error = ssl.SSLCertVerificationError(1, KEY)
    error.verify_message = "self-signed certificate\x1b"
    return error


@pytest.mark.parametrize(
    ("error", "said", "retry"),
    [
        (
            caused(httpx.ConnectError(KEY), untrusted()),
            "the certificate of https://x.example/v1 is not trusted: self-signed certificate\\x1b",
            False,
        ),
        (
            caused(httpx.ConnectError(KEY), ssl.SSLError(1, KEY)),
            "no encrypted connection to https://x.example/v1",
            False,
        ),
        (
            caused(httpx.ConnectError(KEY), socket.gaierror(socket.EAI_AGAIN, KEY)),
            "does not exist, or the network is down",
            True,
        ),
        (
            caused(httpx.ConnectError(KEY), socket.gaierror(socket.EAI_NONAME, KEY)),
            "does not exist, or the network is down",
            False,
        ),
        (
            caused(
                httpx.ConnectError(KEY),
                ExceptionGroup(
                    KEY, [OSError(errno.EHOSTUNREACH, KEY), ConnectionRefusedError(KEY)]
                ),
            ),
            "no one answers at https://x.example/v1; start it",
            True,
        ),
        (httpx.ConnectError(KEY), "no connection to https://x.example/v1; start it", True),
        (httpx.ConnectTimeout(KEY), "no connection to https://x.example/v1 in time", True),
        (httpx.ProxyError(KEY), "the proxy in the environment (HTTP_PROXY", False),
        (httpx.UnsupportedProtocol(KEY), "no request can be sent to https://x.example/v1", False),
        (httpx.ReadError(KEY), "ended before the answer did (ReadError)", True),
        (OSError(errno.ENETDOWN, KEY), "ended before the answer did (OSError)", True),
    ],
)
def test_no_connection(error: Exception, said: str, retry: bool) -> None:
    paths = unreachable(error, PLACE)
    assert said in paths.text
    assert (paths.retry, paths.again) == (retry, retry)
    assert KEY not in paths.text


def test_exceptions_that_cause_each_other() -> None:
    first, second = httpx.ReadError("a"), OSError("b")
    first.__cause__, second.__context__ = second, first
    assert unreachable(first, PLACE).retry


@pytest.mark.parametrize(
    ("status", "said", "grammar", "message", "retry"),
    [
        (
            407,
            "",
            False,
            "the server says 407; the proxy in the environment requires a pass",
            False,
        ),
        (403, f"no {KEY}", False, "403: no ***; the key in THE_KEY does not allow this", False),
        (400, "bad schema", True, "400: bad schema; it does not accept the grammar", False),
        (400, "bad schema", False, "the server says 400: bad schema", False),
        (400, "Context size exceeded", True, "--context says how much the model can read", False),
        (500, "context length exceeded", False, "--context says how much", False),
        (500, "oops", False, "the server says 500: oops", True),
        (599, "", False, "the server says 599", True),
        (418, "a" * 10_000, False, "aaa…", False),
        (400, "\x1b[2J\u202e", False, "the server says 400: \\x1b[2J\\u202e", False),
    ],
)
def test_refusals(status: int, said: str, grammar: bool, message: str, retry: bool) -> None:
    refusal = refused(status, said, PLACE, grammar=grammar, wait_s=None)
    assert message in refusal.text
    assert refusal.retry is refusal.again is retry
    assert len(refusal.text) < 600


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<Plan/>", "<Plan/>"),
        (" as it is \n", " as it is \n"),
        ("<think>a</think>\n\n<Plan/>", "<Plan/>"),
        ("\n<THINK>a</think><thinking>b</thinking> <Plan/>", "<Plan/>"),
        ("a <Plan> b </think> <Plan/>", "a <Plan> b </think> <Plan/>"),
        ("a </think> b </think> <Plan/>", "b </think> <Plan/>"),
        ("<think>a", ""),
        ("<think>" * 10_000, ""),
        ("<think></think>" * 100_000 + "<Plan/>", "<Plan/>"),
        ("", ""),
    ],
)
def test_thoughts_are_left_out(text: str, expected: str) -> None:
    assert without_thoughts(text) == expected
