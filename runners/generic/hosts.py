"""Hosts that the user allows, and addresses as they may be shown."""

from __future__ import annotations

import ipaddress
import re

__all__ = ["allowed_host", "host_name", "shown"]

_LABEL = r"[a-z0-9_](?:[a-z0-9_-]{0,61}[a-z0-9_])?"
_NAME = re.compile(rf"{_LABEL}(?:\.{_LABEL})*")
_HOST = re.compile(r"(\[[^\]]*\]|[^:\[\]]*)(?::([0-9]{1,5}))?")
_HOW = "write a host, as in robot.local, or with a port, as in robot.local:8080 or [::1]:8080"


def allowed_host(text: str) -> str:
    """What ``--allow-host`` names: ``host`` or ``host:port`` in lower case.

    Raises ValueError, which says what to write, for anything else.

    >>> allowed_host("Robot.local:8080"), allowed_host("[0::1]")
    ('robot.local:8080', '[::1]')
    """
    match = _HOST.fullmatch(text.lower())
    if match is None:
        raise ValueError(_why(text))
    name, port = match.groups()
    if port is not None and not 0 < int(port) < 65_536:
        raise ValueError(f"the port {port} is none: ports go from 1 to 65535")
    if name.startswith("["):
        try:
            name = host_name(str(ipaddress.IPv6Address(name[1:-1].partition("%")[0])))
        except ValueError:
            raise ValueError(f"{name[:80]} is no IPv6 address; {_HOW}") from None
        if "%" in text:
            raise ValueError(f"an address with a zone cannot be allowed; {_HOW}")
    elif len(name) > 253 or not _NAME.fullmatch(name):
        raise ValueError(_why(text))
    return name if port is None else f"{name}:{int(port)}"


def _why(text: str) -> str:
    """What is wrong with a text that is no host, and what to write."""
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
        return f"write [{ipaddress.IPv6Address(text)}], with brackets"
    except ValueError:
        pass
    if not text.isascii():
        return f"names with other letters are written in their ASCII form (xn--…); {_HOW}"
    return f"it is no host; {_HOW}"


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
        return f"[{ipaddress.IPv6Address(name)}]"
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
