"""HTTP requests, to hosts that the user allows; addresses as they may be shown."""

from __future__ import annotations

import asyncio
import re
from encodings.aliases import aliases
from typing import TYPE_CHECKING

from gpsfsm.execution.runner import LoadContext, RunContext, Runner, RunnerError, said
from gpsfsm.runners.generic import number, text

if TYPE_CHECKING:
    from collections.abc import Mapping

    import httpx

    from gpsfsm.execution.records import RunValue

_MAX_BODY = 900_000  # bytes of an answer
_MAX_TYPE = 500  # characters of the header Content-Type
_MAX_REDIRECTS = 5
_METHODS = ("GET", "POST", "PUT", "DELETE", "PATCH", "HEAD")
_PORTS = {"http": 80, "https": 443}
_CODECS = frozenset(
    (
        *("ascii", "latin_1", "utf_8", "utf_8_sig"),
        *(f"utf_{bits}{order}" for bits in (16, 32) for order in ("", "_le", "_be")),
        *(f"iso8859_{part}" for part in range(2, 17)),
        *(f"cp{page}" for page in (437, 850, 852, 866, 874, 932, 949, 950, *range(1250, 1259))),
        *("big5", "big5hkscs", "euc_jp", "euc_kr", "gb18030", "gb2312", "gbk"),
        *("koi8_r", "koi8_t", "koi8_u", "shift_jis", "tis_620"),
    )
)
"""The codecs of Python for what pages are written in; all take as long as a text is long."""


class HttpRunner(Runner):
    """Sends one request.

    The service ``allow_hosts`` holds the hosts that may be asked, ``host`` or ``host:port``;
    redirects are followed only to these. Proxies and passwords of the environment are not used.
    An answer is not unpacked, has at most 900,000 bytes and is in one of the usual encodings.
    """

    def __init__(self) -> None:
        self._hosts: frozenset[str] = frozenset()
        self._client: httpx.AsyncClient | None = None

    async def start(self, context: LoadContext) -> None:
        """Get ready. Raises RunnerError if httpx is not installed."""
        try:
            import httpx
        except ImportError as error:
            raise RunnerError("HTTP requests need httpx: pip install httpx") from error
        try:
            self._hosts = frozenset(map(allowed_host, context.services.get("allow_hosts", ())))
        except ValueError as error:
            raise RunnerError(f"a host that is allowed cannot be used: {error}") from error
        self._client = httpx.AsyncClient(
            follow_redirects=False,
            trust_env=False,
            timeout=httpx.Timeout(None),  # the whole request is bounded below
            headers={"Accept-Encoding": "identity", "User-Agent": "gpsfsm"},
        )

    async def stop(self) -> None:
        """Close all connections."""
        if self._client is not None:
            await self._client.aclose()

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """Send the request and read the answer."""
        url, method = text(parameters, "url"), text(parameters, "method", "GET").upper()
        if method not in _METHODS:
            raise RunnerError(f"the method {method[:40]!r} is not one of {', '.join(_METHODS)}")
        timeout_s = number(parameters, "timeout_s", 30.0)
        body = text(parameters, "body", "")
        try:
            async with asyncio.timeout(timeout_s):
                status, answer = await self._ask(method, url, body, context)
        except TimeoutError:
            raise RunnerError(f"no answer from {shown(url)} within {timeout_s:g} s") from None
        expected = parameters.get("expect_status")
        fine = 200 <= status <= 299 if expected is None else status == expected
        if not fine:
            raise RunnerError(
                f"the answer has the status {status}, and "
                f"{'any from 200 to 299' if expected is None else expected} was expected",
                status_code=status,
            )
        return {"response_body": answer, "status_code": status}

    async def _ask(self, method: str, url: str, body: str, context: RunContext) -> tuple[int, str]:
        import httpx

        assert self._client is not None
        try:
            headers = {"Idempotency-Key": context.key.encode("ascii", "replace").decode()}
            request = self._client.build_request(
                method, url, content=body.encode() if body else None, headers=headers
            )
            for _ in range(_MAX_REDIRECTS + 1):
                self._admit(request.url)
                response = await self._client.send(request, stream=True)
                try:
                    if response.next_request is None:
                        return response.status_code, await _read(response)
                    request = response.next_request
                finally:
                    await response.aclose()
        except (httpx.InvalidURL, ValueError) as error:  # it may quote a part of a password
            why = said(error) if "@" not in url else "the address cannot be read"
            raise RunnerError(f"no answer from {shown(url)}: {why}") from None
        except httpx.HTTPError as error:
            raise RunnerError(f"no answer from {shown(url)}: {said(error)}") from error
        raise RunnerError(f"more than {_MAX_REDIRECTS} redirects")

    def _admit(self, url: httpx.URL) -> None:
        """Raises RunnerError for an address that the user has not allowed."""
        if url.scheme not in _PORTS:
            raise RunnerError(
                f"the address {shown(str(url))!r} does not begin with http:// or https://"
            )
        host = host_name(url.raw_host.decode("ascii", "replace"))
        port = _PORTS[url.scheme] if url.port is None else url.port
        if not 0 < port < 65_536:
            raise RunnerError(f"there is no port {port}: ports go from 1 to 65535")
        if host not in self._hosts and f"{host}:{port}" not in self._hosts:
            raise RunnerError(f"the host {host[:300]}:{port} is not allowed")


async def _read(response: httpx.Response) -> str:
    """The text of an answer, as it was sent."""
    if response.headers.get("content-encoding", "identity").lower() != "identity":
        raise RunnerError("the answer is compressed, although that was not requested")
    if len(response.headers.get("content-type", "")) > _MAX_TYPE:  # long ones take long to read
        raise RunnerError("the answer says at too great a length of what type it is")
    content = bytearray()
    async for part in response.aiter_raw():
        content += part
        if len(content) > _MAX_BODY:
            raise RunnerError(f"the answer has more than {_MAX_BODY:,} bytes")
        await asyncio.sleep(0)  # time may be over, however many parts have come already
    return _decoded(bytes(content), response.charset_encoding or "utf-8")


def _decoded(content: bytes, charset: str) -> str:
    """The text, with U+FFFD for what is none. Raises RunnerError for an encoding that is unusual.

    Python has codecs that take longer and longer (punycode) or that make more of less (zlib): which
    one is used is not for a server to say.
    """
    name = charset.lower().replace("-", "_").replace(" ", "_")
    codec = aliases.get(name, name)
    if codec in _CODECS:
        decoded = content.decode(codec, "replace")
    elif content:
        raise RunnerError(f"the answer is in {charset[:40]!r}, an encoding that is not read here")
    else:
        decoded = ""
    return decoded.encode("utf-8", "replace").decode("utf-8")


_LABEL = r"[a-z0-9_](?:[a-z0-9_-]{0,61}[a-z0-9_])?"
_NAME = re.compile(rf"{_LABEL}(?:\.{_LABEL})*")
_HOST = re.compile(r"(\[[^\]]*\]|[^:\[\]]*)(?::([0-9]{1,5}))?")
_HOW = "write a host, as in robot.local, or with a port, as in robot.local:8080 or [::1]:8080"


def allowed_host(text: str) -> str:
    """The host that ``--allow-host`` names: ``host`` or ``host:port`` in lower case.

    Raises ValueError, which says what to write, for anything else.

    >>> allowed_host("Robot.local:8080"), allowed_host("[0::1]")
    ('robot.local:8080', '[::1]')
    """
    match = _HOST.fullmatch(text.lower())
    if match is None:
        raise ValueError(_why(text))
    name, port = match.groups()
    if port is not None and not 0 < int(port) < 65_536:
        raise ValueError(f"there is no port {port}: ports go from 1 to 65535")
    if name.startswith("["):
        try:
            name = host_name(_ipv6_text(name[1:-1].partition("%")[0]))
        except ValueError:
            raise ValueError(f"{name[:80]} is not an IPv6 address; {_HOW}") from None
        if "%" in text:
            raise ValueError(f"an address with a zone cannot be allowed; {_HOW}")
    elif len(name) > 253 or not _NAME.fullmatch(name):
        raise ValueError(_why(text))
    return name if port is None else f"{name}:{int(port)}"


def _why(text: str) -> str:
    """The mistake in a text that is no host, and what to write."""
    if not text.strip():
        return f"it is empty; {_HOW}"
    if "*" in text:
        return f"there are no patterns: name each host by itself; {_HOW}"
    if "://" in text or "/" in text or "@" in text:
        rest = text.partition("://")[2] or text
        host = re.split(r"[/?#]", rest.rpartition("@")[2])[0].lower()
        fits = host and host != text.lower() and _is_host(host)
        return f"it is more than a host; {f'write {host}' if fits else _HOW}"
    try:
        return f"write [{_ipv6_text(text)}], with brackets"
    except ValueError:
        pass
    if not text.isascii():
        return f"names with other letters are written in their ASCII form (xn--…); {_HOW}"
    return f"it is not a host; {_HOW}"


def _is_host(text: str) -> bool:
    try:
        return bool(allowed_host(text))
    except ValueError:
        return False


def host_name(name: str) -> str:
    """The host of an address as ``allowed_host`` writes it; IPv6 addresses in brackets."""
    name = name.lower()
    if ":" not in name:
        return name
    try:
        return f"[{_ipv6_text(name)}]"
    except ValueError:
        return f"[{name}]"


def shown(url: str, limit: int = 200) -> str:
    """An address for messages: without user, password and query, which may be secret.

    >>> shown("http://me:secret@robot/pose?token=secret")
    'http://***@robot/pose?***'
    """
    head, slashes, rest = url.partition("//")
    if not slashes:
        head, rest = "", url
    authority = re.split(r"[/?#]", rest, maxsplit=1)[0]
    if "@" in authority:
        rest = "***@" + rest[authority.rindex("@") + 1 :]
    elif "@" in rest and not _is_host(authority):  # a password may hold what ends a host
        rest = "***@" + rest.rpartition("@")[2]
    path, mark, _ = rest.partition("?")
    return f"{head}{slashes}{path}{'?***' if mark else ''}"[:limit]


def _ipv6_text(text: str) -> str:
    """An address in its one spelling; what providers of models use is loaded for these alone."""
    from gpsfsm.generation.providers.address import ipv6_text

    return ipv6_text(text)
