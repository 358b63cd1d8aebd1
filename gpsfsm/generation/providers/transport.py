"""One JSON request over HTTP: bounded in time and size, sent again where and when that may help.

No error, log or traceback shows the key: exceptions of httpx, whose frames hold headers, are
dropped and never chained. Failures say what to do.
"""

from __future__ import annotations

import asyncio
import errno
import hashlib
import json
import math
import re
import socket
import ssl
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from gpsfsm.generation.providers.address import is_loopback
from gpsfsm.generation.providers.dialect import said_wrong
from gpsfsm.model.printable import clip
from gpsfsm.strict_json import strict_loads
from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Iterator, Mapping

    import httpx

    from gpsfsm.generation.providers import ModelSettings
    from gpsfsm.generation.providers.address import Secret


_CLIPPED = 400
_AGAIN = frozenset({408, 409, 425, 429})
_GRAMMAR = re.compile(
    r"grammar|gbnf|ebnf|lark|guided|structured|schema|response_format|\bformat\b", re.IGNORECASE
)
_TOO_LONG = re.compile(
    r"context.?(?:length|size|window)|maximum context|too many tokens|prompt is too long"
    r"|exceed_context_size",
    re.IGNORECASE,
)
_NO_MONEY = re.compile(r"insufficient_quota|exceeded your current quota|billing", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Failure:
    """The reason for which a request failed; ``retry`` says whether to send it again by itself.

    ``again`` says whether it may help to ask once more later. ``status`` is that of HTTP, 0 if
    there was none. ``wait_s`` is what the server asks to wait. ``empty``: the model has answered
    with nothing.
    """

    text: str
    retry: bool = False
    again: bool = False
    status: int = 0
    wait_s: float | None = None
    empty: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """An endpoint in messages: its address, key, and what to do if it is not there."""

    url: str
    key: Secret
    start_hint: str


def refused(
    status: int, said: str, place: Place, *, grammar: bool, wait_s: float | None
) -> Failure:
    """An answer with a status other than 200; ``said`` is what the server says went wrong.

    ``grammar`` tells whether one was sent.
    """
    retry = status in _AGAIN or status >= 500
    words = f": {clip(place.key.hidden(said), _CLIPPED)}" if said else ""
    hint = ""
    if status == 429 and _NO_MONEY.search(said):
        retry, hint = False, "; the account has no credit left"
    elif status == 429:
        hint = "; ask less often, or wait longer (max-wait)"
    elif status == 407:
        hint = "; the proxy in the environment requires a password"
    elif status in (401, 403):
        hint = _about_key(status, place.key)
    elif status in (400, 413, 422, 500) and _TOO_LONG.search(said):
        retry, hint = False, "; --context says how much the model can read, so prompts get shorter"
    elif status in (400, 422) and grammar and _GRAMMAR.search(said):
        hint = "; it does not accept the grammar: use --no-constrain"
    elif status in (400, 422) and "chat_template" in said:
        hint = "; with 'thinking = true' in the configuration that field is not sent"
    elif status in (404, 405):
        hint = f"; is {place.url} the right address (--base-url)?"
    elif 300 <= status <= 399:
        hint = "; redirects are not followed, so that no key goes astray; set --base-url"
    return Failure(
        f"the server says {status}{words}{hint}", retry, again=retry, status=status, wait_s=wait_s
    )


def _about_key(status: int, key: Secret) -> str:
    if not key:
        return f"; no key was sent, since {key.source or 'none'} is not set in the environment"
    verb = "is not accepted" if status == 401 else "does not allow this"
    return f"; the key in {key.source} {verb}"


def unreachable(error: BaseException, place: Place) -> Failure:
    """No connection, or one that ended early. The text holds nothing of the exception's own."""
    causes = tuple(_causes(error))
    name = type(error).__name__
    for cause in causes:
        if isinstance(cause, ssl.SSLCertVerificationError):
            why = clip(cause.verify_message or "it cannot be verified", 200)
            return Failure(
                f"the certificate of {place.url} is not trusted: {why}; SSL_CERT_FILE in the "
                "environment names further authorities"
            )
        if isinstance(cause, ssl.SSLError):
            return Failure(
                f"no encrypted connection to {place.url}; is it perhaps http:// and not https://?"
            )
        if isinstance(cause, socket.gaierror):
            passing = cause.errno == socket.EAI_AGAIN
            return Failure(
                f"the host in {place.url} does not exist, or the network is down",
                retry=passing,
                again=passing,
            )
        if isinstance(cause, ConnectionRefusedError) or _number(cause) == errno.ECONNREFUSED:
            text = f"no one answers at {place.url}; {place.start_hint}"
            return Failure(text, retry=True, again=True)
    if name == "ConnectTimeout":
        return Failure(f"no connection to {place.url} in time", retry=True, again=True)
    if name == "ConnectError":
        text = f"no connection to {place.url}; {place.start_hint}"
        return Failure(text, retry=True, again=True)
    if name == "ProxyError":
        return Failure(
            f"the proxy in the environment (HTTP_PROXY, HTTPS_PROXY, ALL_PROXY) does not connect "
            f"to {place.url}; NO_PROXY names hosts that need none",
        )
    if name in ("UnsupportedProtocol", "LocalProtocolError", "InvalidURL"):
        return Failure(f"no request can be sent to {place.url} ({name})")
    return Failure(
        f"the connection to {place.url} ended before the answer did ({name})",
        retry=True,
        again=True,
    )


def broken(what: str, place: Place, *, again: bool = False) -> Failure:
    """An answer with status 200 that cannot be read."""
    return Failure(f"{place.url} answered, but {what}", again=again, status=200)


def _number(error: BaseException) -> int | None:
    return error.errno if isinstance(error, OSError) else None


def _causes(error: BaseException) -> Iterator[BaseException]:
    """An exception and all that led to it, each once."""
    left: list[BaseException] = [error]
    seen: set[int] = set()
    while left:
        cause = left.pop()
        if id(cause) in seen or len(seen) > 100:
            continue
        seen.add(id(cause))
        yield cause
        if isinstance(cause, BaseExceptionGroup):
            left.extend(cause.exceptions)
        left.extend(each for each in (cause.__context__, cause.__cause__) if each is not None)


_MAX_REFUSAL = 1 << 16  # bytes that are read of an error message
_LISTING_S = 10.0
_FIRST_S = 0.5
_LONGEST_S = 30.0


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
            outcome = await self._bounded(
                "POST", path, content, grammar=grammar, timeout_s=self._settings.timeout_s
            )
            if not isinstance(outcome, Failure):
                data, latency_s = outcome
                return Received(data, latency_s, sent)
            if not outcome.retry or sent > most:
                return outcome if sent == 1 else _tried(outcome, sent)
            requested_s, longest_s = outcome.wait_s, self._settings.max_wait_s
            await self._sleep(
                pause_s(sent, requested_s=requested_s, longest_s=longest_s, seed=content[:65_536])
            )

    async def get(self, path: str) -> Any:
        """The content of a short list; None if it cannot be had soon."""
        timeout_s = min(_LISTING_S, self._settings.timeout_s)
        outcome = await self._bounded("GET", path, b"", grammar=False, timeout_s=timeout_s)
        return None if isinstance(outcome, Failure) else outcome[0]

    async def _bounded(
        self, method: str, path: str, content: bytes, *, grammar: bool, timeout_s: float
    ) -> tuple[Any, float] | Failure:
        """The JSON of an answer and how long it took."""
        began_s = time.monotonic()
        cancelled: asyncio.CancelledError | None = None
        outcome: Any = None
        try:
            async with asyncio.timeout(timeout_s):
                outcome = await self._once(method, path, content, grammar=grammar)
        except TimeoutError:
            text = f"no answer from {self._place.url} within {timeout_s:g} s"
            return Failure(f"{text}; --timeout allows more", again=True)
        except asyncio.CancelledError as error:
            cancelled = error
        if cancelled is not None:  # without the frames of httpx, in which headers are
            cancelled.__cause__ = cancelled.__context__ = None
            raise cancelled.with_traceback(None)
        return outcome if isinstance(outcome, Failure) else (outcome, time.monotonic() - began_s)

    async def _once(self, method: str, path: str, content: bytes, *, grammar: bool) -> Any:
        """The JSON of an answer, or a Failure."""
        import httpx

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
        import httpx

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
            what = "it is compressed, although that was not requested"
            return broken(what, self._place)
        if response.status_code != 200:
            content = await _content(response, _MAX_REFUSAL)
            wait_s = requested_wait_s(response.headers, time.time())
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
    """The text of a refusal; a page of HTML says nothing."""
    text = content.decode("utf-8", "replace").strip()
    try:
        reason = said_wrong(json.loads(text))
    except (ValueError, RecursionError):
        return "" if text.startswith("<") else text
    return reason


def _tried(failure: Failure, sent: int) -> Failure:
    return replace(failure, text=f"{failure.text} (asked {sent} times)")


def requested_wait_s(headers: Mapping[str, str], now_s: float) -> float | None:
    """The wait that the server asks for, in seconds or until a date; None if it does not say.

    ``now_s`` is the time of day in seconds since 1970. What makes no sense counts as not said.
    """
    for name, unit_s in (("retry-after-ms", 0.001), ("retry-after", 1.0)):
        text = headers.get(name, "").strip()[:100]
        if not text:
            continue
        try:
            seconds = float(text) * unit_s
        except ValueError:
            seconds = _until(text, now_s) if unit_s == 1.0 else math.nan
        if math.isfinite(seconds) and seconds >= 0:
            return seconds
    return None


def pause_s(attempt: int, *, requested_s: float | None, longest_s: float, seed: bytes) -> float:
    """The seconds to wait after a number of attempts, from 1.

    What the server asks for counts, up to ``longest_s``. Otherwise the pause doubles each time,
    less up to a half that ``seed`` decides: so many robots do not come back at the same moment, and
    the same request waits as long each time.
    """
    if requested_s is not None:
        return min(requested_s, longest_s)
    digest = hashlib.sha256(seed + attempt.to_bytes(4, "big")).digest()
    part = 0.5 + int.from_bytes(digest[:4], "big") / 2**33
    full = min(_FIRST_S * 2.0 ** min(attempt, 30), _LONGEST_S)
    return min(full * part, longest_s)


def _until(text: str, now_s: float) -> float:
    """Seconds up to an HTTP date, 0 for one that is over; NaN for what is no date."""
    from email.utils import parsedate_to_datetime

    try:
        return max(0.0, parsedate_to_datetime(text).timestamp() - now_s)
    except (ValueError, OverflowError, OSError, TypeError):
        return math.nan
