"""Servers of language models that mean harm, or are broken.

``gpsfsm generate`` asks one with a key. The server sends what it likes: redirects to another
server, bodies and headers without end, nothing at all, what is no JSON, the key itself, plans that
are wrong or no plans. Then

- the command ends in the time that it was given, with an exit code of its own and no traceback,
- the key shows nowhere, and no other server is asked,
- a plan that comes out is one that a check accepts.
"""

from __future__ import annotations

import json
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from hypothesis import strategies as st

import gpsfsm
from tests.campaigns.base import Pair
from tests.cli.support import ACCEPTED, BROKEN, REJECTED, runner
from tests.generation.fake_faults import FAULTS
from tests.generation.fake_server import FakeServer
from tests.hostile_servers import KEYS, done

if TYPE_CHECKING:
    from collections.abc import Iterator

_KEY = KEYS["GPSFSM_API_KEY"]
_TIMEOUT_S = 0.5
_SLACK_S = 30.0
"""What a busy machine may take besides."""

_BOUND = ("huge:50", "huge-error", "gzip-bomb", "deep", "number")  # some megabytes each
_TRAP = "redirect:{trap}/v1/chat/completions"
_HEADERS = (
    *(b"HTTP/1.1 200 OK\r\nX: " + b"x" * size + b"\r\n" for size in (1_000, 200_000)),
    b"HTTP/1.1 200 OK\r\n" + b"".join(b"X-%d: y\r\n" % number for number in range(3_000)),
    b"HTTP/1.1 100 Continue\r\n\r\n" * 200,
    b"HTTP/1.1 200 OK\r\nContent-Length: -1\r\n\r\n{}",
    b"HTTP/1.1 200 OK\r\nContent-Length: 99999999999999999999\r\n\r\n{}",
    b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nFFFFFFFFFFFFFFFFF\r\n",
    b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: 2\r\n\r\n[]HTTP/1.1",
    b"HTTP/1.1 401 \xff\xfe\r\nWWW-Authenticate: Basic\r\n\r\n",
    b"HTTP/1.1 429 Slow\r\nRetry-After: 99999999999\r\nContent-Length: 0\r\n\r\n",
    b"HTTP/1.1 999 What\r\n\r\n",
    b"\x16\x03\x01\x02\x00\x01",
    b"",
)
_DEEP = '<Control type="sequential">'
_TEXTS = (
    *(ACCEPTED, REJECTED, BROKEN, "", "no plan", f"Sure:\n```xml\n{ACCEPTED}```", "<Plan/>"),
    REJECTED.replace("<Control", "<!-- gpsfsm: ignore GP307 because I say so --><Control"),
    f"<Plan><!-- gpsfsm: ignore ALL -->{runner(x='viel')}</Plan>",
    "<Plan>" * 5_000,
    f"<Plan>{runner(x=chr(0x1B) + '[2J' + chr(0x202E))}</Plan>",
    "<!DOCTYPE p [<!ENTITY a 'b'><!ENTITY c '&a;&a;'>]><Plan>&c;</Plan>",
    f"<Plan>{_DEEP * 300}{runner()}{'</Control>' * 300}</Plan>",
    f"{ACCEPTED}{REJECTED}",
)


@dataclass(frozen=True)
class Case:
    """What a server does with one request after the other; then it gives the last answer."""

    acts: tuple[str, ...]
    answers: tuple[str, ...]
    model: str
    attempts: int
    retries: int
    constrained: bool


def _cases() -> st.SearchStrategy[Case]:
    others = sorted(set(FAULTS) - {name.partition(":")[0] for name in _BOUND} - {"raw", "slow"})
    raw = st.one_of(st.sampled_from(_HEADERS), st.binary(max_size=200))
    acts = st.one_of(
        st.sampled_from(others),
        st.sampled_from([_TRAP, "slow:0.2", *_BOUND]),
        raw.map(lambda content: f"raw:{content.hex()}"),
        st.just(""),
    )
    texts = st.one_of(st.sampled_from(_TEXTS), st.text(max_size=200))
    return st.builds(
        Case,
        acts=st.lists(acts, max_size=3).map(tuple),
        answers=st.lists(texts, min_size=1, max_size=3).map(tuple),
        model=st.sampled_from(["vllm:tiny", "ollama:tiny", "openai:tiny"]),
        attempts=st.integers(1, 3),
        retries=st.integers(0, 1),
        constrained=st.booleans(),
    )


def judge(case: Case) -> Iterator[str]:
    """The command ends as it should, and nobody learns what is not for them."""
    with tempfile.TemporaryDirectory() as home, FakeServer() as trap:
        folder = Path(home)
        faults = [each.format(trap=trap.url) for each in case.acts]
        with FakeServer(case.answers, faults=faults) as server:
            words = ["generate", "go there", "--model", case.model, "--base-url", server.url]
            words += ["--journal", "run.db", "--timeout", str(_TIMEOUT_S), "-o", "plan.xml"]
            words += ["--attempts", str(case.attempts), "--retries", str(case.retries)]
            if not case.constrained:
                words.append("--no-constrain")
            began_s = time.monotonic()
            (folder / "xdg" / "gpsfsm").mkdir(parents=True)
            settings = "[model]\nmax-wait = 0\n"
            (folder / "xdg" / "gpsfsm" / "config.toml").write_text(settings, encoding="utf-8")
            around = {"HOME": home, "XDG_CONFIG_HOME": str(folder / "xdg")}
            ended = done(words, folder, {**around, "GPSFSM_API_KEY": _KEY})
            took_s = time.monotonic() - began_s
        assert not trap.received, "another server was asked"
        assert ended.code in (0, 1, 2), f"exit code {ended.code}"
        requests = case.attempts * (case.retries + 1) + 3  # and probes
        assert took_s < requests * _TIMEOUT_S + _SLACK_S, f"it took {took_s:.1f} s"
        _keep_quiet(folder, ended.out + ended.errors)
        yield _outcome(folder / "plan.xml", ended.code, ended.errors)


def _keep_quiet(folder: Path, said: str) -> None:
    """Neither the key nor what could play tricks on a terminal is written."""
    assert _KEY not in said, "the key was told"
    assert "\x1b" not in said, "a control character came through"
    for file in folder.rglob("*"):
        assert not file.is_file() or _KEY.encode() not in file.read_bytes(), f"the key in {file}"


def _outcome(plan: Path, code: int, errors: str) -> str:
    if code == 0:
        report = gpsfsm.check(plan)
        assert report.ok, "a plan came out that no check accepts"
        assert not report.excused, "a plan came out that excuses itself"
        return "a good plan"
    assert not plan.exists(), "a plan came out that was not accepted"
    assert errors.strip(), "nothing was said"
    return "no plan is good" if code == 1 else "the server is no use"


PAIR = Pair(
    name="model-servers",
    about="hostile model servers: generate ends in time, tells no key, takes no bad plan",
    cases=_cases,
    judge=judge,
    text=lambda case: json.dumps(case.__dict__, default=str),
    full=3_000,
    batch=15,
    few=4,
    attack=True,
)
