"""The server of a model: its address as users write it, its key, and where the key may go."""

from __future__ import annotations

import hmac
from contextlib import suppress
from enum import Enum
from ipaddress import IPv4Address, IPv6Address, ip_address
from typing import TYPE_CHECKING, Any, NoReturn
from urllib.parse import SplitResult, urlsplit

from gpsfsm.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Iterable

_ANY = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}  # noqa: S104  (where a server listens)
_OLLAMA_PORT = 11434
_OLLAMA_PATHS = ("/api/chat", "/api/generate", "/api", "/v1")
_MAX = 2000
_SHAPE = "the base URL must look like http://localhost:8000/v1"
_PORTS = {"http": 80, "https": 443}
_SHORTEST = 8  # shorter ones are no secrets but words such as EMPTY, which local servers are given
_HIDDEN = "***"


class Secret:
    """A key and where it came from; shows neither in ``str``, ``repr``, copies nor pickles.

    ``source`` is the name of the environment variable, or what else to call it in a message.
    """

    __slots__ = ("_value", "source")

    def __init__(self, value: str = "", source: str = "") -> None:
        """Raises UsageError, which does not hold the key, if no header could carry it."""
        self._value = value.strip()
        self.source = source
        if not (self._value.isascii() and self._value.isprintable()) or " " in self._value:
            raise UsageError(f"the key in {source} cannot be one: it has blanks or odd characters")

    def reveal(self) -> str:
        """The key itself. Never keep it in a variable: tracebacks may show those."""
        return self._value

    def hidden(self, text: str) -> str:
        """A text without the key, should a server have sent it back."""
        return text.replace(self._value, _HIDDEN) if len(self._value) >= _SHORTEST else text

    def __bool__(self) -> bool:
        return bool(self._value)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Secret):
            return NotImplemented
        return hmac.compare_digest(self._value, other._value)

    def __hash__(self) -> int:
        return hash((Secret, self._value))

    def __repr__(self) -> str:
        return f"Secret({_HIDDEN!r}, {self.source!r})" if self else "Secret()"

    def __str__(self) -> str:
        return _HIDDEN if self else ""

    def __copy__(self) -> Secret:
        return self

    def __deepcopy__(self, _: dict[int, Any]) -> Secret:
        return self

    def __reduce__(self) -> NoReturn:
        raise TypeError("a key is not written anywhere")


def address(text: str, provider: str) -> str:
    """The base URL without a slash at its end. Raises UsageError, which holds no password.

    An address of a server of OpenAI's kind that has no path gets ``/v1``. What Ollama's own
    environment variable may hold, such as ``0.0.0.0`` or ``robot:11434``, becomes an address.

    >>> address("localhost:8000", "vllm")
    'http://localhost:8000/v1'
    >>> address("0.0.0.0", "ollama")
    'http://127.0.0.1:11434'
    """
    if not text.strip():
        raise UsageError(f"{provider} has no default address; name one with --base-url")
    text = text.strip()
    if provider == "ollama" and text.startswith(":"):  # OLLAMA_HOST may be a port alone
        text = f"127.0.0.1{text}"
    parts = _parts(text)
    host = parts.hostname or ""
    host = _ANY.get(host, f"[{host}]" if ":" in host else host)
    port, path = parts.port, parts.path.rstrip("/")
    if provider == "ollama":
        path = next((path.removesuffix(p) for p in _OLLAMA_PATHS if path.endswith(p)), path)
        if port is None and "://" not in text:
            port = _OLLAMA_PORT
    elif not path:
        path = "/v1"
    else:
        path = path.removesuffix("/chat/completions")
    return f"{parts.scheme}://{host}{'' if port is None else f':{port}'}{path}"


def _parts(text: str) -> SplitResult:
    if len(text) > _MAX or not (text.isascii() and text.isprintable()) or " " in text:
        raise UsageError("the base URL has blanks or odd characters, or is too long")
    try:
        parts = urlsplit(text if "://" in text else f"http://{text}")
        _ = parts.port
    except ValueError:
        raise UsageError(_SHAPE) from None
    if "@" in parts.netloc:
        raise UsageError(
            "the base URL has a user or password in it; keys belong in the environment, such as "
            "GPSFSM_API_KEY"
        )
    if parts.query or parts.fragment:
        raise UsageError("the base URL must not contain '?' or '#'")
    slashes_lost = "://" not in text and parts.netloc.lower() in ("http:", "https:")
    if parts.scheme not in ("http", "https") or not parts.hostname or slashes_lost:
        raise UsageError(_SHAPE)
    return parts


class Permission(Enum):
    """The answer of a list of hosts: PLAIN means that only encryption is missing."""

    YES = "yes"
    PLAIN = "plain"
    NO = "no"


def permission(url: str, hosts: Iterable[str]) -> Permission:
    """The permission for a key to go to an address, by the hosts that are permitted for it.

    ``host`` stands for the usual port, ``host:port`` for that one. Nothing is sent unencrypted to
    another computer, except where ``http://host`` permits it.

    >>> permission("https://api.openai.com/v1", ["api.openai.com"]).value
    'yes'
    >>> permission("http://api.openai.com/v1", ["api.openai.com"]).value
    'plain'
    >>> permission("https://api.openai.com.evil.example/v1", ["api.openai.com"]).value
    'no'
    """
    scheme, host, port = _server(url)
    plain = scheme == "http" and not is_loopback(host)
    named = False
    for each in hosts:
        with_scheme = "://" in each
        own_scheme, own_host, own_port = _server(each if with_scheme else f"{scheme}://{each}")
        if own_host != host:
            continue
        named = True
        may = not plain or (with_scheme and own_scheme == "http")
        if own_port == port and may:
            return Permission.YES
    return Permission.PLAIN if named and plain else Permission.NO


def server_of(url: str) -> str:
    """The host of an address, as a list of hosts names it.

    >>> server_of("http://gpu.example:8000/v1"), server_of("https://API.openai.com/v1")
    ('http://gpu.example:8000', 'api.openai.com')
    """
    scheme, host, port = _server(url)
    shown = f"[{host}]" if ":" in host else host
    shown += "" if port == _PORTS[scheme] else f":{port}"
    return f"http://{shown}" if scheme == "http" and not is_loopback(host) else shown


def is_loopback(host: str) -> bool:
    """True if a host is this computer, and nothing that is sent there leaves it."""
    if host.lower() == "localhost":
        return True
    try:
        return bare_address(host).is_loopback
    except ValueError:
        return False


def bare_address(text: str) -> IPv4Address | IPv6Address:
    """The address in a text, of IPv4 also where one of IPv6 only wraps it. Raises ValueError.

    Versions of Python differ in what a wrapped address is, and in how it is spelled.

    >>> bare_address("::ffff:127.0.0.1")
    IPv4Address('127.0.0.1')
    """
    address = ip_address(text)
    mapped = address.ipv4_mapped if isinstance(address, IPv6Address) else None
    return mapped or address


def ipv6_text(text: str) -> str:
    """An address of IPv6 in its one spelling. Raises ValueError for anything else.

    >>> ipv6_text("0::1"), ipv6_text("::FFFF:7F00:1")
    ('::1', '::ffff:127.0.0.1')
    """
    address = IPv6Address(text)
    return str(address) if address.ipv4_mapped is None else f"::ffff:{address.ipv4_mapped}"


def _server(url: str) -> tuple[str, str, int]:
    """Scheme, host and port in one spelling of many."""
    parts = urlsplit(url)
    scheme = parts.scheme
    host = (parts.hostname or "").removesuffix(".")
    with suppress(ValueError):
        host = str(bare_address(host))
    return scheme, host, _PORTS.get(scheme, 0) if parts.port is None else parts.port
