"""What the service needs to know, with its limits."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import UsageError
from gpsfsm.generation.providers.secret import Secret
from gpsfsm.syntax import Limits

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["LEAST_TOKEN", "Settings", "is_loopback", "plan_limits"]

LEAST_TOKEN = 16
"""Characters of a token: fewer can be guessed."""

_LEAST_MEMORY_MB = 256


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach a server that is bound to ``host``."""
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def plan_limits(**changes: int) -> Limits:
    """The limits on a plan that comes over the network: less than a file on a disk may have."""
    return Limits(**{"max_bytes": 1 << 20, "max_elements": 20_000, **changes})


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How the service runs; raises UsageError for what makes no sense.

    ``token``: what a client has to show, empty for none, which is for loopback alone. ``workers``
    is the number of processes that check plans, each with ``memory_mb`` at most; ``waiting`` how
    many requests may wait for one of them. ``request_s`` is what work on a request may take, and
    what it may wait for a worker before. ``header_s`` and ``body_s`` are what a client may take to
    send these, ``idle_s`` is how long a connection stays open between requests, ``grace_s`` what a
    shutdown waits for requests that are under way. ``max_bodies`` bounds the bytes of all bodies
    together. ``streams`` is how many clients may follow runs at once.

    ``capabilities`` are folders of capability files. ``journal`` is the file of the plan queue, ""
    for no queue; ``executor`` is the command that runs it, and ``runs`` what that is told: how
    plans are run. ``generator`` is the command that asks a language model, empty for none.
    ``most_waiting`` and ``most_plans`` bound the queue.
    """

    host: str = "127.0.0.1"
    port: int = 8321
    token: Secret = field(default_factory=lambda: Secret(""))
    hosts: tuple[str, ...] = ()
    workers: int = 2
    memory_mb: int = 1024
    waiting: int = 64
    request_s: float = 10.0
    header_s: float = 10.0
    body_s: float = 20.0
    idle_s: float = 15.0
    grace_s: float = 10.0
    max_body: int = 2 << 20
    max_bodies: int = 64 << 20
    connections: int = 2048
    streams: int = 64
    limits: Limits = field(default_factory=plan_limits)
    capabilities: tuple[str, ...] = ()
    builtin_capabilities: bool = True
    journal: str = ""
    executor: tuple[str, ...] = ()
    runs: Mapping[str, Any] = field(default_factory=dict)
    generator: tuple[str, ...] = ()
    generate_s: float = 600.0
    most_waiting: int = 1_000
    most_plans: int = 100_000

    def __post_init__(self) -> None:
        """Refuse what would leave the service open, or useless."""
        if not is_loopback(self.host) and not self.token:
            raise UsageError(
                f"{self.host} can be reached from other machines, so a token is needed; put one "
                f"into a file and name it with --token-file, or set GPSFSM_TOKEN"
            )
        if self.token and len(self.token.reveal()) < LEAST_TOKEN:
            raise UsageError(f"a token has at least {LEAST_TOKEN} characters")
        if not 0 <= self.port <= 65_535:
            raise UsageError(f"the port is a number from 0 to 65535, not {self.port}")
        if self.memory_mb < _LEAST_MEMORY_MB:
            raise UsageError(f"a worker needs at least {_LEAST_MEMORY_MB} MB of memory")
        for each in fields(self):
            value = getattr(self, each.name)
            if each.name != "port" and isinstance(value, int | float) and not _makes_sense(value):
                raise UsageError(f"{each.name} must be more than 0, not {value}")


def _makes_sense(value: float) -> bool:
    return isinstance(value, bool) or 0 < value < float("inf")
