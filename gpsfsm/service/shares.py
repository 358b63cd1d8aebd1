"""Shares: one client, however much it wants, leaves the others what they need.

``Share`` divides what requests hold for a while: bytes of bodies, connections, streams. ``Line`` is
a waiting line with a turn for each client. Clients are names (``gpsfsm.service.clients``).
"""

from __future__ import annotations

import asyncio
from collections import Counter
from dataclasses import dataclass, field

from gpsfsm.service.shapes import Problem

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
        message = f"{waiting} requests of this client wait already; try again"
        return Problem(429, message, retry_s=self._retry_s)


def _due(ticket: Ticket) -> tuple[float, int]:
    return ticket.due_s, ticket.number


def _now_s() -> float:
    return asyncio.get_running_loop().time()
