"""Clients: whose request it is, so that each gets its share.

A client is its token, else the address from which it comes; a token that was not verified names
nobody. An address in a ``Forwarded`` or ``X-Forwarded-For`` header counts only where a proxy that
is trusted has sent it.
"""

from __future__ import annotations

import ipaddress
import re
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from starlette.types import Scope

_Address = ipaddress.IPv4Address | ipaddress.IPv6Address
_HERE = "this machine"
_NOBODY = "unknown"
_HOST_BITS = 64
"""Of an IPv6 address: whoever has one of them has them all."""
_KEY = "gpsfsm.client"
_FOR = re.compile(r'(?:^|;)\s*for\s*=\s*("[^"]*"|[^;"\s]*)\s*(?=;|$)', re.IGNORECASE)
_MOST_HOPS = 100


def name_of(host: str) -> str:
    """The client behind an address.

    >>> name_of("2001:db8:1:2::7"), name_of("::ffff:203.0.113.9"), name_of("127.3.2.1")
    ('2001:db8:1:2::/64', '203.0.113.9', 'this machine')
    """
    address = _address(host)
    if address is None:
        return _NOBODY
    if address.is_loopback:  # who is here may take any of them
        return _HERE
    if isinstance(address, ipaddress.IPv6Address):
        return str(ipaddress.ip_network((address, _HOST_BITS), strict=False))
    return str(address)


def client_of(scope: Mapping[str, Any]) -> str:
    """The client of a request that has passed the guard."""
    client = scope.get(_KEY, _NOBODY)
    assert isinstance(client, str)
    return client


class Proxies:
    """The proxies that are trusted to say for whom they ask. Raises UsageError for no address."""

    def __init__(self, addresses: Iterable[str]) -> None:
        self._networks = []
        for text in addresses:
            try:
                self._networks.append(ipaddress.ip_network(text))
            except ValueError:
                message = f"'{text[:80]}' is no address of a proxy; such are 10.0.0.7, 10.0.0.0/24"
                raise UsageError(message) from None

    def __contains__(self, host: str) -> bool:
        address = _address(host)
        return address is not None and any(address in each for each in self._networks)

    def mark(self, scope: Scope, token: int | None) -> None:
        """Write down whose request it is; ``token`` is the number of the one that was verified."""
        scope[_KEY] = self._client(scope) if token is None else f"token {token}"

    def _client(self, scope: Mapping[str, Any]) -> str:
        peer = scope.get("client")
        host = str(peer[0]) if peer else ""
        if host not in self:
            return name_of(host)
        headers = scope["headers"]
        claims = {
            self._behind(host, hops)
            for hops in (
                _listed(headers, b"x-forwarded-for"),
                [_for(part) for part in _listed(headers, b"forwarded")],
            )
            if hops
        }
        # Two headers that contradict each other: one of them the proxy has not written.
        return claims.pop() if len(claims) == 1 else name_of(host)

    def _behind(self, proxy: str, hops: list[str]) -> str:
        """The last address that no trusted proxy has; only those have added what follows it."""
        last = proxy
        for hop in reversed(hops[-_MOST_HOPS:]):
            host = _bare(hop)
            if _address(host) is None:
                break
            last = host
            if host not in self:
                break
        return name_of(last)


def _listed(headers: Iterable[tuple[bytes, bytes]], name: bytes) -> list[str]:
    """The elements of a list that may be in several headers."""
    lines = [value.decode("latin-1") for key, value in headers if key == name]
    return [part.strip() for part in ",".join(lines).split(",")] if lines else []


def _for(part: str) -> str:
    """Of an element of ``Forwarded`` for whom it was (RFC 7239)."""
    match = _FOR.search(part)
    return match[1].strip('"') if match else ""


def _bare(hop: str) -> str:
    """An address without its port."""
    if hop.startswith("["):
        return hop[1:].partition("]")[0]
    return hop.partition(":")[0] if hop.count(":") == 1 else hop


def _address(host: str) -> _Address | None:
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return None
    mapped = address.ipv4_mapped if isinstance(address, ipaddress.IPv6Address) else None
    return mapped or address
