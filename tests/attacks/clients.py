"""Hostile clients against a real service: nobody else is refused for what they do.

Each case is a mix of what such clients send: plans that take long, and such as do not look like
it, bodies that are too long or come
byte by byte, names of other hosts, JSON with a key twice, headers that claim another address, more
connections than there may be. Beside them an honest client asks the gate about plans whose verdicts
are known. All of its requests have to be answered, with those verdicts. One service runs for all
cases of a process, with tokens, and one without, where all clients are one.
"""

from __future__ import annotations

import atexit
import importlib.util
import json
import socket
import tempfile
import threading
import time
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from hypothesis import strategies as st

from tests.campaigns.base import Pair
from tests.service.support import BAD, GOOD, Service, loops, nested_trees, slow_plan

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_NEEDED = ("starlette", "uvicorn")
_TOKENS = tuple(f"token-of-client-{number:02}" for number in range(6))
_HONEST = _TOKENS[0]
_REQUESTS = 5
_WITHIN_S = 60.0
_PATIENCE_S = 2.0
_WORDS = ("--workers", "1", "--time-limit", "4", "--max-body", "300000", "--connections", "64")
_VERDICTS = {
    GOOD: "accepted",
    BAD: "rejected",
    "<Plan/>": "rejected",
    "<Plan><Runner/></Plan>": "rejected",
    GOOD.replace("</Plan>", GOOD.removeprefix("<Plan>").removesuffix("</Plan>") * 29 + "</Plan>"): (
        "accepted"
    ),
}
_HEAVY = {"consistent": True, "faults": ["hang", "no-start"], "solver": "z3"}


@dataclass(frozen=True, slots=True)
class Deed:
    """What one hostile client does: so many times, and as which client of those with a token."""

    kind: str
    client: int
    times: int
    size: int


def missing() -> str:
    """What is needed and not installed."""
    gone = [name for name in _NEEDED if importlib.util.find_spec(name) is None]
    return f"{' and '.join(gone)} not installed" if gone else ""


@cache
def _service(tokens: bool) -> Service:
    words: list[object] = list(_WORDS)
    if tokens:
        folder = tempfile.TemporaryDirectory()
        atexit.register(folder.cleanup)
        file = Path(folder.name, "tokens")
        file.write_text("\n".join(_TOKENS), encoding="ascii")
        words += ["--token-file", file]
    service = Service(*words, new_workers=True).start()
    atexit.register(service.finish)
    return service


def _post(token: str, body: bytes, *lines: str, host: str = "localhost") -> bytes:
    head = [
        "POST /v1/gate HTTP/1.1",
        f"Host: {host}",
        f"Authorization: Bearer {token}",
        "Content-Type: application/json",
        f"Content-Length: {len(body)}",
        *lines,
    ]
    return "\r\n".join((*head, "", "")).encode() + body


def _plan(runners: int) -> str:
    return "<Plan>" + "".join(
        f'<Control type="parallel_any"><Runner interface="a/R{each % 5}" provider="a/R"/>'
        f'<Runner interface="a/S{each}" provider="a/S"/></Control>'
        for each in range(runners)
    ) + "</Plan>"  # fmt: skip


def _heavy(token: str, size: int) -> bytes:
    """Some 150 bytes each: up to 100 kB, and with all options that take long."""
    return _post(token, json.dumps({"plan": _plan(size * 7), "options": _HEAVY}).encode())


def _slow(token: str, size: int) -> bytes:
    """Not long, but what it takes is."""
    slow = slow_plan(depth=3 + size % 3)
    return _post(token, json.dumps({"plan": slow, "options": {"consistent": True}}).encode())


def _nearly_small(token: str, size: int) -> bytes:
    return _post(token, json.dumps({"plan": _plan(size)}).encode())


def _written_out(token: str, size: int) -> bytes:
    """Behaviour trees that are short, until their SubTrees or loops are written out."""
    plan = nested_trees(8 + size % 7) if size % 2 else loops(100 * (1 + size))
    return _post(token, json.dumps({"plan": plan, "trees": True}).encode())


def _too_long(token: str, size: int) -> bytes:
    return _post(token, b"x" * (300_001 + size))


def _dripping(token: str, size: int) -> bytes:
    """The body never comes."""
    return _post(token, b"x" * (size + 1))[: -1 - size]


def _silent(_token: str, size: int) -> bytes:
    return b"POST /v1/gate HTTP/1.1\r\nHost: loc"[:size]


def _other_host(token: str, size: int) -> bytes:
    hosts = ("[::1].evil.example", "localhost.evil.example", "localhost:80@evil.example", "x y")
    return _post(token, json.dumps({"plan": GOOD}).encode(), host=hosts[size % len(hosts)])


def _two_hosts(token: str, _size: int) -> bytes:
    return _post(token, json.dumps({"plan": GOOD}).encode(), "Host: evil.example")


def _twice(token: str, _size: int) -> bytes:
    return _post(token, json.dumps({"plan": BAD})[:-1].encode() + b', "plan": "<Plan/>"}')


def _forged(token: str, size: int) -> bytes:
    """Every time from somewhere else, if it were believed."""
    plan = json.dumps({"plan": _plan(size * 7), "options": _HEAVY}).encode()
    lines = (f"X-Forwarded-For: 203.0.113.{size}", f"Forwarded: for=198.51.100.{size}")
    return _post(token, plan, *lines)


def _nested(token: str, size: int) -> bytes:
    return _post(token, b"[" * size * 1_000)


_DEEDS: dict[str, tuple[Callable[[str, int], bytes], tuple[int, ...]]] = {
    "heavy": (_heavy, (200, 429, 503, 504, 0)),
    "slow": (_slow, (200, 429, 503, 504, 0)),
    "nearly small": (_nearly_small, (200, 429, 503, 504, 0)),
    "written out": (_written_out, (200, 429, 503, 504, 0)),
    "too long": (_too_long, (413, 0)),
    "dripping": (_dripping, (400, 408, 429, 0)),
    "silent": (_silent, (400, 408, 503, 0)),
    "other host": (_other_host, (400, 421, 429, 503)),
    "two hosts": (_two_hosts, (400,)),
    "a key twice": (_twice, (422, 429, 503)),
    "forged": (_forged, (200, 429, 503, 504, 0)),
    "nested": (_nested, (422, 429, 503, 413, 0)),
}
"""What they send, and what they may be answered; 0 is no answer, or none in time."""
_WITH_TOKENS = {"other host": (200,)}
"""What they may be answered as well if they have shown a token: then the Host does not matter."""


def _cases() -> st.SearchStrategy[tuple[bool, tuple[Deed, ...]]]:
    deed = st.builds(
        Deed,
        kind=st.sampled_from(sorted(_DEEDS)),
        client=st.integers(1, len(_TOKENS) - 1),
        times=st.integers(1, 15),
        size=st.integers(1, 90),
    )
    return st.tuples(st.booleans(), st.lists(deed, min_size=1, max_size=5).map(tuple))


def _status(line: socket.socket, until_s: float) -> int:
    """The status of an answer, 0 if there is none until then."""
    answer = b""
    with suppress(OSError):
        while b"\r\n" not in answer:
            line.settimeout(max(0.01, until_s - time.monotonic()))
            part = line.recv(65_536)
            if not part:
                break
            answer += part
    return int(answer.split()[1]) if answer.startswith(b"HTTP/1.1 ") else 0


def _do(service: Service, deed: Deed, statuses: list[int]) -> None:
    """Send all of it at once, then see what comes back."""
    make, _ = _DEEDS[deed.kind]
    content = make(_TOKENS[deed.client], deed.size)
    with ExitStack() as lines:
        opened = []
        for _ in range(deed.times):
            with suppress(OSError):
                line = lines.enter_context(service.connect())
                line.settimeout(_PATIENCE_S)
                opened.append(line)
                line.sendall(content)
        until_s = time.monotonic() + _PATIENCE_S
        statuses += [_status(line, until_s) for line in opened]


def judge(case: tuple[bool, tuple[Deed, ...]]) -> Iterator[str]:
    """Every honest request is answered with its verdict, and the hostile ones as they may be."""
    tokens, deeds = case
    service = _service(tokens)
    answers: list[list[int]] = [[] for _ in deeds]
    threads = [
        threading.Thread(target=_do, args=(service, deed, statuses))
        for deed, statuses in zip(deeds, answers, strict=True)
    ]
    for thread in threads:
        thread.start()
    try:
        _ask(service, tokens)
    finally:
        for thread in threads:
            thread.join(_WITHIN_S)
    _ask(service, tokens)  # and all is well behind them
    for deed, statuses in zip(deeds, answers, strict=True):
        _, allowed = _DEEDS[deed.kind]
        further = _WITH_TOKENS.get(deed.kind, ()) if tokens else ()
        wrong = set(statuses) - {*allowed, *further, 0}
        assert not wrong, f"{deed.kind} was answered with {wrong}"
        yield from (f"{deed.kind}: {status or 'no answer'}" for status in set(statuses))
    yield "clients have tokens" if tokens else "all clients are one"


def _ask(service: Service, tokens: bool) -> None:
    """Ask as an honest client does; on connections of its own, so that none is cut off."""
    secret = {"authorization": f"Bearer {_HONEST}"} if tokens else {}
    for number in range(_REQUESTS):
        plan = list(_VERDICTS)[number % len(_VERDICTS)]
        with service.client(headers=secret) as client:
            answer = client.post("/v1/gate", json={"plan": plan})
            assert answer.status_code == 200, f"honest request {number}: {answer.text}"
            assert answer.json()["verdict"] == _VERDICTS[plan]
            assert client.get("/metrics").status_code == 200


def _text(case: tuple[bool, tuple[Deed, ...]]) -> str:
    return f"tokens: {case[0]}\n" + "\n".join(map(str, case[1]))


PAIR = Pair(
    name="clients",
    about="hostile clients beside honest ones: all honest gate requests get their verdicts",
    cases=_cases,
    judge=judge,
    text=_text,
    full=300,
    batch=4,
    few=1,
    attack=True,
    missing=missing,
)
