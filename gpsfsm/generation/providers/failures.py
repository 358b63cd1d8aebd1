"""Why a server has not answered, in words that say what to do."""

from __future__ import annotations

import errno
import re
import socket
import ssl
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.generation.providers.secret import Secret

__all__ = ["Failure", "Place", "broken", "refused", "unreachable"]

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
    """Why one request has failed; ``retry`` says whether to send it again by itself.

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
    """What messages about an endpoint need: its address, key, and what to do if it is not there."""

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
        hint = "; the proxy in the environment wants a password"
    elif status in (401, 403):
        hint = _about_key(status, place.key)
    elif status in (400, 413, 422, 500) and _TOO_LONG.search(said):
        retry, hint = False, "; --context says how much the model can read, so prompts get shorter"
    elif status in (400, 422) and grammar and _GRAMMAR.search(said):
        hint = "; it does not take our grammar, --no-constrain asks without"
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
                f"there is no host of the name in {place.url}, or the network is down",
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
        found = left.pop()
        if id(found) in seen or len(seen) > 100:
            continue
        seen.add(id(found))
        yield found
        if isinstance(found, BaseExceptionGroup):
            left.extend(found.exceptions)
        left.extend(each for each in (found.__context__, found.__cause__) if each is not None)
