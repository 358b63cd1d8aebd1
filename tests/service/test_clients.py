"""Who a client is: its token, its address, or the address for which a proxy asks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.errors import UsageError
from gpsfsm.service.clients import Proxies, client_of, name_of
from gpsfsm.service.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Sequence


def mark(
    peer: str,
    headers: Sequence[tuple[str, str]] = (),
    *,
    proxies: Sequence[str] = (),
    token: int | None = None,
) -> str:
    lines = [(name.encode(), value.encode()) for name, value in headers]
    scope: dict[str, Any] = {"type": "http", "client": (peer, 1), "headers": lines}
    Proxies(proxies).mark(scope, token)
    return client_of(scope)


@pytest.mark.parametrize(
    ("host", "client"),
    [
        ("203.0.113.9", "203.0.113.9"),
        ("::ffff:203.0.113.9", "203.0.113.9"),
        ("2001:db8:1:2::7", "2001:db8:1:2::/64"),
        ("2001:db8:1:2:ffff::1", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("127.0.0.1", "this machine"),
        ("127.77.3.2", "this machine"),
        ("::1", "this machine"),
        ("::ffff:127.0.0.1", "this machine"),
        ("", "unknown"),
        ("a.sock", "unknown"),
    ],
)
def test_who_an_address_stands_for(host: str, client: str) -> None:
    assert name_of(host) == client


FORWARDED = "x-forwarded-for"
PROXY = "10.0.0.7"


@pytest.mark.parametrize(
    ("peer", "headers", "client"),
    [
        # nobody but a proxy that is trusted is believed
        ("203.0.113.9", [(FORWARDED, "198.51.100.1")], "203.0.113.9"),
        ("10.0.0.8", [("forwarded", "for=198.51.100.1")], "10.0.0.8"),
        (PROXY, [], PROXY),
        (PROXY, [(FORWARDED, "198.51.100.1")], "198.51.100.1"),
        (PROXY, [("forwarded", 'for="[2001:db8::1]:99";proto=https')], "2001:db8::/64"),
        (PROXY, [("forwarded", "proto=https;For=198.51.100.1:80")], "198.51.100.1"),
        # what the client has written itself stands on the left
        (PROXY, [(FORWARDED, "192.0.2.66, 198.51.100.1")], "198.51.100.1"),
        (PROXY, [(FORWARDED, "192.0.2.66"), (FORWARDED, "198.51.100.1")], "198.51.100.1"),
        (PROXY, [(FORWARDED, "192.0.2.66, 198.51.100.1, 10.1.0.3")], "198.51.100.1"),
        (PROXY, [(FORWARDED, "10.1.0.4, 10.1.0.3")], "10.1.0.4"),
        # nonsense leads back to whoever has sent it on
        (PROXY, [(FORWARDED, "192.0.2.66, nonsense")], PROXY),
        (PROXY, [(FORWARDED, "192.0.2.66, nonsense, 10.1.0.3")], "10.1.0.3"),
        (PROXY, [("forwarded", "for=unknown")], PROXY),
        (PROXY, [("forwarded", "for=_hidden")], PROXY),
        (PROXY, [(FORWARDED, "")], PROXY),
        # two headers: one of them the proxy has not looked at
        (PROXY, [(FORWARDED, "198.51.100.1"), ("forwarded", "for=192.0.2.66")], PROXY),
        (PROXY, [(FORWARDED, "192.0.2.66"), ("forwarded", "for=192.0.2.66")], "192.0.2.66"),
    ],
)
def test_for_whom_a_proxy_asks(peer: str, headers: list[tuple[str, str]], client: str) -> None:
    assert mark(peer, headers, proxies=(PROXY, "10.1.0.0/16")) == client


def test_a_token_that_was_verified_is_the_client() -> None:
    assert mark("203.0.113.9", token=3) == mark("198.51.100.1", token=3) == "token 3"
    headers = [("authorization", "Bearer whatever")]
    assert mark("203.0.113.9", headers) == "203.0.113.9"


@pytest.mark.parametrize("wrong", ["proxy.example", "10.0.0.1/8", "", "*"])
def test_proxies_are_addresses(wrong: str) -> None:
    with pytest.raises(UsageError, match="not the address of a proxy"):
        Settings(proxies=(wrong,))
