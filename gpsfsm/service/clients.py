"""Clients: whose request it is, so that each gets its share.

A client is its token, else the address from which it comes; a token that was not verified names
nobody. An address in a ``Forwarded`` or ``X-Forwarded-For`` header counts only where a proxy that
is trusted has sent it.
"""

from __future__ import annotations

import asyncio
import ipaddress
import re
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import UsageError
from gpsfsm.generation.providers.address import bare_address
from gpsfsm.service.shapes import Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from starlette.types import Scope

_Address = ipaddress.IPv4Address | ipaddress.IPv6Address
_HERE = "this machine"
_NOBODY = "unknown"
_HOST_BITS = 64
"""Of an IPv6 address: whoever has one of them has them all."""
_KEY, _ADDRESS = "gpsfsm.client", "gpsfsm.address"
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


def client_of(scope: Mapping[str, Any], otherwise: str = _NOBODY) -> str:
    """The client of a request that has passed the guard."""
    client = scope.get(_KEY, otherwise)
    assert isinstance(client, str)
    return client


def address_of(scope: Mapping[str, Any]) -> str:
    """The address from which a request comes: that before a trusted proxy, once it is known."""
    peer = scope.get("client")
    return str(scope.get(_ADDRESS) or (peer[0] if peer else _NOBODY))


class Proxies:
    """The proxies that are trusted to say for whom they ask. Raises UsageError for no address."""

    def __init__(self, addresses: Iterable[str]) -> None:
        self._networks = []
        for text in addresses:
            try:
                self._networks.append(ipaddress.ip_network(text))
            except ValueError:
                message = (
                    f"'{text[:80]}' is not the address of a proxy; write 10.0.0.7 or 10.0.0.0/24"
                )
                raise UsageError(message) from None

    def __contains__(self, host: str) -> bool:
        address = _address(host)
        return address is not None and any(address in each for each in self._networks)

    def mark(self, scope: Scope, token: int | None) -> None:
        """Write down whose request it is; ``token`` is the number of the one that was verified."""
        scope[_ADDRESS] = self._origin(scope)
        scope[_KEY] = name_of(scope[_ADDRESS]) if token is None else f"token {token}"

    def _origin(self, scope: Mapping[str, Any]) -> str:
        """The address of the client: its own, or what a trusted proxy says."""
        peer = scope.get("client")
        host = str(peer[0]) if peer else ""
        if host not in self:
            return host
        headers = scope["headers"]
        claims = {
            name_of(behind := self._behind(host, hops)): behind
            for hops in (
                _listed(headers, b"x-forwarded-for"),
                [_for(part) for part in _listed(headers, b"forwarded")],
            )
            if hops
        }
        # Two headers that contradict each other: one of them the proxy has not written.
        return next(iter(claims.values())) if len(claims) == 1 else host

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
        return last


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
        return bare_address(host.partition("%")[0])
    except ValueError:
        return None


# ---- Shares: one client, however much it wants, leaves the others what they need -----------------
# ``Share`` divides what requests hold for a while: bytes of bodies, connections, streams. ``Line``
# is a waiting line with a turn for each client.


_GREED = 3
"""A client may hold so many times what it leaves to others: alone three quarters. However many such
clients there are, something is left for the next one."""
_MOST_REMEMBERED = 4_096
_YIELDS = 20
"""A request lets others of its client go before it that come so many times its cost later."""


class Share:
    """Units that clients hold for a while, ``most`` over all of them."""

    def __init__(self, most: int) -> None:
        self.most = most
        self.used = 0
        self._held: Counter[str] = Counter()

    def take(self, client: str, units: int = 1, *, trusted: bool = False) -> bool:
        """Count units for a client, unless that is more than its share.

        Who holds nothing yet is the one for whom the others leave something: it may have all that
        is left. Who is ``trusted`` stands for many clients, and is bound by what there is alone.
        """
        left, held = self.most - self.used - units, self._held.get(client, 0)
        fair = trusted or not held or held + units <= _GREED * left
        if left < 0 or not fair:
            return False
        self.used += units
        self._held[client] += units
        assert self.used <= self.most
        return True

    def give_back(self, client: str, units: int = 1) -> None:
        """They are free again."""
        self.used -= units
        self._held[client] -= units
        assert min(self.used, self._held[client]) >= 0
        if not self._held[client]:
            del self._held[client]


@dataclass(eq=False, slots=True)
class Ticket:
    """A place in a waiting line; ``granted`` is done when its turn has come, or never will.

    ``cost_s`` is what it is expected to take. Of one client the one that is due first is next: a
    dear request lets cheap ones go before it, for a while.
    """

    client: str
    number: int
    cost_s: float
    due_s: float
    granted: asyncio.Future[None] = field(
        default_factory=lambda: asyncio.get_running_loop().create_future()
    )


class Line:
    """A waiting line: next is the client that will have been served the least, by time.

    When all ``most`` places are taken, a client that has fewer of them than another gets the last
    one of the client that has the most of them. ``retry_s`` is when that one may come again.
    """

    def __init__(self, most: int, retry_s: int = 1) -> None:
        self._most, self._retry_s = most, retry_s
        self._waiting: dict[str, list[Ticket]] = {}
        self._served_s: dict[str, float] = {}
        self._floor_s = 0.0
        self._length = 0

    def __len__(self) -> int:
        return self._length

    @property
    def clients(self) -> frozenset[str]:
        """Those that wait."""
        return frozenset(self._waiting)

    def has_room(self, client: str) -> bool:
        """True if a request of this client could wait here now."""
        self._clear()
        return self._length < self._most or self._of(client) < self._of(self._longest())

    def join(self, client: str, number: int, cost_s: float) -> Ticket:
        """A place at the end. Raises Problem 429 if the client has its share of places already."""
        if not self.has_room(client):
            raise self._full(client)
        if self._length >= self._most:
            longest = self._longest()
            last = max(self._waiting[longest], key=_due)
            self.leave(last)
            last.granted.set_exception(self._full(longest))
        ticket = Ticket(client, number, cost_s, _now_s() + _YIELDS * cost_s)
        if client not in self._waiting:  # who was away gets no turns for that
            self._served_s[client] = max(self._served_s.get(client, 0.0), self._floor_s)
        self._waiting.setdefault(client, []).append(ticket)
        self._length += 1
        return ticket

    def leave(self, ticket: Ticket) -> bool:
        """Give up a place; whether it still was one."""
        line = self._waiting.get(ticket.client)
        if line is None or ticket not in line:
            return False
        line.remove(ticket)
        self._length -= 1
        if not line:
            del self._waiting[ticket.client]
        assert self._length == sum(map(len, self._waiting.values())), "somebody waits uncounted"
        return True

    def head(self) -> Ticket | None:
        """The ticket whose turn it is."""
        self._clear()
        if not self._waiting:
            return None
        firsts = (min(line, key=_due) for line in self._waiting.values())
        return min(firsts, key=lambda each: self._served_s[each.client] + each.cost_s)

    def call(self, ticket: Ticket) -> None:
        """It is the turn of this one; its cost is charged."""
        self._floor_s = max(self._floor_s, self._served_s[ticket.client])
        self.leave(ticket)
        self.charge(ticket.client, ticket.cost_s)
        ticket.granted.set_result(None)

    def charge(self, client: str, seconds: float) -> None:
        """Count what a client was served; less than nothing gives back what was too much."""
        self._served_s[client] = self._served_s.get(client, self._floor_s) + seconds
        if len(self._served_s) > _MOST_REMEMBERED:
            kept = self._waiting
            self._served_s = {name: s for name, s in self._served_s.items() if name in kept}

    def _clear(self) -> None:
        """Give up the places of those that have gone, and have not come to do so themselves yet."""
        for ticket in [each for line in self._waiting.values() for each in line]:
            if ticket.granted.done():
                self.leave(ticket)

    def _of(self, client: str) -> int:
        return len(self._waiting.get(client, ()))

    def _longest(self) -> str:
        return max(self._waiting, key=self._of, default="")

    def _full(self, client: str) -> Problem:
        waiting = self._of(client)
        message = (
            f"{waiting} requests of this client are already waiting; try again later. "
            "--waiting and --workers of the service set how many may wait, and how fast they go"
        )
        return Problem(429, message, retry_s=self._retry_s)


def _due(ticket: Ticket) -> tuple[float, int]:
    return ticket.due_s, ticket.number


def _now_s() -> float:
    return asyncio.get_running_loop().time()
