"""One JSON request over HTTP: bounded in time and size, sent again where that may help.

No error, log or traceback shows the key: exceptions of httpx, whose frames hold headers, are
dropped and never chained.
"""

from __future__ import annotations

import asyncio
import json
import ssl
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from gpsfsm.generation.providers.address import is_loopback
from gpsfsm.generation.providers.chat import said_wrong
from gpsfsm.generation.providers.failures import Failure, Place, broken, refused, unreachable
from gpsfsm.generation.providers.patience import asked_to_wait_s, pause_s
from gpsfsm.strict_json import strict_loads
from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    import httpx

    from gpsfsm.generation.providers.secret import Secret
    from gpsfsm.generation.providers.settings import ModelSettings

__all__ = ["Received", "Transport"]

_MAX_REFUSAL = 1 << 16  # bytes that are read of an error message
_LISTING_S = 10.0


@dataclass(frozen=True, slots=True)
class Received:
    """An answer: JSON, how long the request took that it answers, and how many were sent."""

    data: Any
    latency_s: float
    requests: int


class Transport:
    """A server that is asked with JSON.

    ``sleep`` waits between requests. It works from any event loop and keeps no connection.
    """

    def __init__(
        self,
        place: Place,
        settings: ModelSettings,
        *,
        sleep: Callable[[float], Awaitable[object]] = asyncio.sleep,
    ) -> None:
        self._place = place
        self._settings = settings
        self._sleep = sleep

    async def post(
        self, path: str, body: dict[str, Any], *, grammar: bool = False, retries: int | None = None
    ) -> Received | Failure:
        """Send a body. ``grammar`` tells whether there is one in it, for error messages."""
        content = json.dumps(body, ensure_ascii=False).encode("utf-8", "replace")
        most = self._settings.retries if retries is None else retries
        sent = 0
        while True:
            sent += 1
            found = await self._bounded(
                "POST", path, content, grammar=grammar, timeout_s=self._settings.timeout_s
            )
            if not isinstance(found, Failure):
                data, latency_s = found
                return Received(data, latency_s, sent)
            if not found.retry or sent > most:
                return found if sent == 1 else _tried(found, sent)
            asked_s, longest_s = found.wait_s, self._settings.max_wait_s
            await self._sleep(
                pause_s(sent, asked_s=asked_s, longest_s=longest_s, seed=content[:65_536])
            )

    async def get(self, path: str) -> Any:
        """What a short list says; None if it cannot be had soon."""
        timeout_s = min(_LISTING_S, self._settings.timeout_s)
        found = await self._bounded("GET", path, b"", grammar=False, timeout_s=timeout_s)
        return None if isinstance(found, Failure) else found[0]

    async def _bounded(
        self, method: str, path: str, content: bytes, *, grammar: bool, timeout_s: float
    ) -> tuple[Any, float] | Failure:
        """The JSON of an answer and how long it took."""
        began_s = time.monotonic()
        cancelled: asyncio.CancelledError | None = None
        found: Any = None
        try:
            async with asyncio.timeout(timeout_s):
                found = await self._once(method, path, content, grammar=grammar)
        except TimeoutError:
            text = f"no answer from {self._place.url} within {timeout_s:g} s"
            return Failure(f"{text}; --timeout allows more", again=True)
        except asyncio.CancelledError as error:
            cancelled = error
        if cancelled is not None:  # without the frames of httpx, in which headers are
            cancelled.__cause__ = cancelled.__context__ = None
            raise cancelled.with_traceback(None)
        return found if isinstance(found, Failure) else (found, time.monotonic() - began_s)

    async def _once(self, method: str, path: str, content: bytes, *, grammar: bool) -> Any:
        """The JSON of an answer, or a Failure."""
        import httpx  # noqa: PLC0415  (slow)

        try:
            async with self._client() as client:
                headers = {"Content-Type": "application/json"} if content else {}
                url = f"{self._place.url}/{path}"
                request = client.build_request(
                    method, url, content=content or None, headers=headers
                )
                response = await client.send(request, stream=True, auth=_Bearer(self._settings.key))
                try:
                    return await self._read(response, grammar=grammar)
                finally:
                    await response.aclose()
        except (httpx.HTTPError, httpx.InvalidURL, httpx.StreamError, OSError) as error:
            return unreachable(error, self._place)
        except (ImportError, ValueError, TypeError) as error:  # proxies that cannot be used
            return Failure(
                f"no request can be sent to {self._place.url} ({type(error).__name__}); look at "
                "the proxies in the environment (HTTP_PROXY, HTTPS_PROXY, ALL_PROXY)"
            )

    def _client(self) -> httpx.AsyncClient:
        """A client for one request.

        What a connection saves is nothing beside the time that a model takes, and none is left over
        that belongs to an event loop of the past.
        """
        import httpx  # noqa: PLC0415

        url = httpx.URL(self._place.url)
        own = is_loopback(url.host) or url.host.endswith(".localhost")
        # certificates take longer to load than all the rest; without any, none would be trusted
        bare = own and url.scheme == "http"
        return httpx.AsyncClient(
            follow_redirects=False,
            verify=ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT) if bare else True,
            trust_env=not own,
            timeout=httpx.Timeout(None, connect=self._settings.connect_timeout_s),
            headers={
                "Accept": "application/json",
                "Accept-Encoding": "identity",
                "User-Agent": f"gpsfsm/{VERSION}",
            },
        )

    async def _read(self, response: httpx.Response, *, grammar: bool) -> Any:
        if response.headers.get("content-encoding", "identity").lower() != "identity":
            what = "it is packed, although that was not asked for"
            return broken(what, self._place)
        if response.status_code != 200:
            content = await _content(response, _MAX_REFUSAL)
            wait_s = asked_to_wait_s(response.headers, time.time())
            said = _said(content[:_MAX_REFUSAL])
            return refused(response.status_code, said, self._place, grammar=grammar, wait_s=wait_s)
        kind = response.headers.get("content-type", "").partition(";")[0].strip().lower()
        if kind and not (kind == "application/json" or kind.endswith("+json")):
            what = f"with {kind[:60]!r} and not with JSON; is it the address of a model server?"
            return broken(what, self._place)
        content = await _content(response, self._settings.max_answer_bytes)
        if len(content) > self._settings.max_answer_bytes:
            what = f"with more than {self._settings.max_answer_bytes:,} bytes (max-answer-bytes)"
            return broken(what, self._place)
        try:
            return strict_loads(content.decode("utf-8"))
        except UnicodeDecodeError as error:
            return broken(f"not in UTF-8 (byte {error.start + 1})", self._place, again=True)
        except (ValueError, RecursionError):
            return broken("what came is not JSON", self._place, again=True)


class _Bearer:
    """Puts the key into a request. As an object of its own, so that no frame of ours holds it."""

    def __init__(self, key: Secret) -> None:
        self._key = key

    def __call__(self, request: httpx.Request) -> httpx.Request:
        if self._key:
            request.headers["Authorization"] = f"Bearer {self._key.reveal()}"
        return request


async def _content(response: httpx.Response, most: int) -> bytes:
    """The body; of one that has more than ``most`` bytes only the beginning."""
    content = bytearray()
    async for part in response.aiter_raw():
        content += part
        if len(content) > most:
            break
        await asyncio.sleep(0)  # time may be over, however many parts have come already
    return bytes(content)


def _said(content: bytes) -> str:
    """What the body of a refusal says; a page of HTML says nothing."""
    text = content.decode("utf-8", "replace").strip()
    try:
        found = said_wrong(json.loads(text))
    except (ValueError, RecursionError):
        return "" if text.startswith("<") else text
    return found


def _tried(found: Failure, sent: int) -> Failure:
    return replace(found, text=f"{found.text} (asked {sent} times)")
