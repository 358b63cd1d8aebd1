"""Settings of the service, with their limits."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import InputError, UsageError
from gpsfsm.files import read_whole
from gpsfsm.generation.providers.address import ipv6_text, is_loopback
from gpsfsm.model.printable import clip
from gpsfsm.service.clients import Proxies
from gpsfsm.syntax import Limits

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.generation.providers.address import Secret
    from gpsfsm.logs import Format, Level


LEAST_TOKEN = 16
"""Characters of a token: fewer can be guessed."""

MOST_TOKENS = 1_000
"""Each of them is compared with what a client shows."""

_VARIABLE = "GPSFSM_TOKEN"
_MOST_TOKEN_BYTES = 1 << 18
_LEAST_MEMORY_MB = 256
_MOST_RESERVED = 2
_MOST_PORT = 65_535
_HOST = re.compile(
    r"(?:\[(?P<address>[0-9A-Fa-f:.]+)\]|(?P<name>\w(?:[\w.-]*\w)?))(?::(?P<port>[0-9]{1,5}))?",
    re.ASCII,
)
_MAY_BE_ZERO = ("port", "drain_s")
_PREFIX = re.compile(r"(?:/[A-Za-z0-9_~-][A-Za-z0-9._~-]*)+")
_LONGEST_PREFIX = 200
_OWN = frozenset(("health", "livez", "metrics", "openapi.json", "readyz", "ui", "v1"))
"""The first parts of paths of the service: a prefix that begins with one could be either."""
_LEAST_BODIES = 4
"""There is room for so many bodies of the greatest length, whoever sends them."""


def host_of(text: str) -> str | None:
    """The host of a Host header or an origin, without its port; None for what is no such thing.

    >>> host_of("LOCALHOST:8321"), host_of("[0::1]:80"), host_of("[::1].evil.example")
    ('localhost', '::1', None)
    """
    match = _HOST.fullmatch(text)
    if match is None or int(match["port"] or 0) > _MOST_PORT:
        return None
    if match["name"]:
        return match["name"].lower()
    try:
        return ipv6_text(match["address"])
    except ValueError:
        return None


def is_prefix(text: str) -> bool:
    """True for a path below which a service may stand, such as ``/robots/gpsfsm``."""
    if len(text) > _LONGEST_PREFIX or not _PREFIX.fullmatch(text):
        return False
    return text.split("/")[1] not in _OWN


def refuse_prefix(text: str) -> None:
    """Raises UsageError for a root path that makes no sense; "" is none."""
    if text and not is_prefix(text):
        own = ", ".join(sorted(_OWN))
        raise UsageError(
            f"'{clip(text, 80)}' is not a root path; write one such as /gpsfsm or /robots/gpsfsm, "
            f"without a slash at the end and not below any of {own}"
        )


def plan_limits(**changes: int) -> Limits:
    """The limits on a plan that comes over the network: less than a file on a disk may have."""
    return Limits(**{"max_bytes": 1 << 20, "max_elements": 20_000, **changes})


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The settings of the service; raises UsageError for what makes no sense.

    ``tokens``: one of them a client has to show, none for loopback alone. ``hosts`` are further
    names of the service; ``proxies`` the addresses, or networks, of those that are trusted to say
    for whom they ask, and ``root_path`` is the path below which one shows the service.
    ``log_level`` and ``log_format`` are those of the log; ``otel``: traces are exported, None if
    the environment names a collector.

    ``workers`` is the number of processes that check plans, each with
    ``memory_mb`` at most, and ``gate_workers`` that of those which small gate requests have for
    themselves, None for as many, but at most two; ``waiting`` how many requests of a cost class may
    wait. ``request_s`` is what work on a request may take, a third of what it may wait for a
    worker before, ``small_s`` what a small gate request may take of a core. ``header_s`` and
    ``body_s`` are what a client may take to send these, ``idle_s`` how long a connection stays open
    between requests, ``grace_s`` what a shutdown waits for requests under way, and ``drain_s`` how
    long before that the service answers as ever and says that it is not ready. ``max_bodies``
    bounds the bytes of all bodies together. ``streams`` is how many clients may follow runs at
    once, ``generating`` how many requests a model may be writing plans for.

    ``capabilities`` are folders of capability files. ``journal`` is the file of the plan queue, ""
    for no queue; ``executor`` is the command that runs it, and ``runs`` what that is told: how
    plans are run; with ``real`` among it real runners act, which needs a token. ``stopper`` is the
    command of the process that cancels all goals of the robot, empty for none; ``allow`` what plans
    may reach, kinds and values. ``generator`` is the command that asks a language model, empty for
    none.
    ``most_waiting`` and ``most_plans`` bound the queue.
    """

    host: str = "127.0.0.1"
    port: int = 8321
    tokens: tuple[Secret, ...] = ()
    hosts: tuple[str, ...] = ()
    proxies: tuple[str, ...] = ()
    root_path: str = ""
    log_level: Level = "info"
    log_format: Format = "text"
    otel: bool | None = None
    workers: int = 2
    gate_workers: int | None = None
    memory_mb: int = 1024
    waiting: int = 64
    request_s: float = 10.0
    small_s: float = 0.5
    header_s: float = 10.0
    body_s: float = 20.0
    idle_s: float = 15.0
    grace_s: float = 10.0
    drain_s: float = 0.0
    max_body: int = 2 << 20
    max_bodies: int = 64 << 20
    connections: int = 2048
    streams: int = 64
    generating: int = 2
    limits: Limits = field(default_factory=plan_limits)
    capabilities: tuple[str, ...] = ()
    builtin_capabilities: bool = True
    robot: str | None = None
    journal: str = ""
    executor: tuple[str, ...] = ()
    runs: Mapping[str, Any] = field(default_factory=dict)
    stopper: tuple[str, ...] = ()
    allow: tuple[tuple[str, str], ...] = ()
    generator: tuple[str, ...] = ()
    generate_s: float = 600.0
    most_waiting: int = 1_000
    most_plans: int = 100_000

    def __post_init__(self) -> None:
        """Refuse what would leave the service open, or useless."""
        if not is_loopback(self.host) and not self.tokens:
            raise UsageError(
                f"{self.host or 'every address'} can be reached from other machines, so a token "
                "is needed; put one into a file and name it with --token-file, or set "
                "GPSFSM_TOKEN. For a reverse proxy on this machine leave --host out and name the "
                "service with --allow-name NAME"
            )
        if self.real and not self.tokens:
            raise UsageError(
                "--real lets plans move a robot, so a token is needed, also on this machine; put "
                "one into a file and name it with --token-file, or set GPSFSM_TOKEN"
            )
        if any(len(each.reveal()) < LEAST_TOKEN for each in self.tokens):
            raise UsageError(f"a token has at least {LEAST_TOKEN} characters")
        if len(self.tokens) > MOST_TOKENS:
            raise UsageError(
                f"at most {MOST_TOKENS:,} tokens are allowed, not {len(self.tokens):,}"
            )
        for host in self.hosts:
            if host_of(f"{host}:1") is None:
                raise UsageError(
                    f"'{clip(host, 80)}' is not a host name without a port; "
                    "write --allow-name robot.example or --allow-name 10.0.0.7"
                )
        Proxies(self.proxies)
        refuse_prefix(self.root_path)
        if not 0 <= self.port <= _MOST_PORT:
            raise UsageError(f"the port is a number from 0 to 65535, not {self.port}")
        if self.memory_mb < _LEAST_MEMORY_MB:
            raise UsageError(f"a worker needs at least {_LEAST_MEMORY_MB} MB of memory")
        for each in fields(self):
            value = getattr(self, each.name)
            if value == 0 and each.name in _MAY_BE_ZERO:
                continue
            if isinstance(value, int | float) and not _makes_sense(value):
                raise UsageError(f"{each.name} must be more than 0, not {value}")

    @property
    def real(self) -> bool:
        """True if plans are run by real runners."""
        return self.runs.get("real") is True

    @property
    def reserved(self) -> int:
        """The number of workers that small gate requests have for themselves."""
        return self.gate_workers or min(self.workers, _MOST_RESERVED)

    @property
    def bodies(self) -> int:
        """The bytes of all bodies together."""
        needed = _LEAST_BODIES * self.max_body
        return max(self.max_bodies, needed + -(-needed // 3))  # a client gets three quarters


def _makes_sense(value: float) -> bool:
    return isinstance(value, bool) or 0 < value < float("inf")


def tokens_of(file: str | None) -> tuple[Secret, ...]:
    """The tokens of a file, or of the environment. Raises GpsfsmError."""
    from gpsfsm.generation.providers.address import Secret

    if file is None:
        alone = Secret(os.environ.get(_VARIABLE, ""), _VARIABLE)
        return (alone,) if alone else ()
    try:
        text = read_whole(file, _MOST_TOKEN_BYTES).decode("utf-8", "replace")
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
    lines = enumerate(text.splitlines(), start=1)
    tokens = [Secret(line, f"{file}:{number}") for number, line in lines if line.strip()]
    if not tokens:
        raise UsageError(f"there is no token in {file}")
    if len(set(tokens)) < len(tokens):
        raise UsageError(f"{file} has the same token twice: each client needs its own")
    return tuple(tokens)
