"""The address of a server, as users write it."""

from __future__ import annotations

from urllib.parse import SplitResult, urlsplit

from gpsfsm.errors import UsageError

__all__ = ["address"]

_ANY = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}  # noqa: S104  (where a server listens)
_OLLAMA_PORT = 11434
_OLLAMA_PATHS = ("/api/chat", "/api/generate", "/api", "/v1")
_MAX = 2000


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
        raise UsageError(f"{provider} has no address of its own; --base-url names one")
    text = text.strip()
    if provider == "ollama" and text.startswith(":"):  # OLLAMA_HOST may be a port alone
        text = f"127.0.0.1{text}"
    found = _parts(text)
    host = found.hostname or ""
    host = _ANY.get(host, f"[{host}]" if ":" in host else host)
    port, path = found.port, found.path.rstrip("/")
    if provider == "ollama":
        path = next((path.removesuffix(p) for p in _OLLAMA_PATHS if path.endswith(p)), path)
        if port is None and "://" not in text:
            port = _OLLAMA_PORT
    elif not path:
        path = "/v1"
    else:
        path = path.removesuffix("/chat/completions")
    return f"{found.scheme}://{host}{'' if port is None else f':{port}'}{path}"


def _parts(text: str) -> SplitResult:
    if len(text) > _MAX or not (text.isascii() and text.isprintable()) or " " in text:
        raise UsageError("the base URL has blanks or odd characters, or is too long")
    try:
        found = urlsplit(text if "://" in text else f"http://{text}")
        _ = found.port
    except ValueError:
        raise UsageError("the base URL is no address, such as http://localhost:8000/v1") from None
    if "@" in found.netloc:
        raise UsageError(
            "the base URL has a user or password in it; keys belong into the environment, such as "
            "GPSFSM_API_KEY"
        )
    if found.query or found.fragment:
        raise UsageError("the base URL has a '?' or '#' in it, which belongs to no base URL")
    slashes_lost = "://" not in text and found.netloc.lower() in ("http:", "https:")
    if found.scheme not in ("http", "https") or not found.hostname or slashes_lost:
        raise UsageError("the base URL is no address, such as http://localhost:8000/v1")
    return found
